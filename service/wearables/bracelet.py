"""The steplink bracelet: our own service, made so that nothing is counted twice and nothing is lost in silence.

Service `5e9a0001-4b1d-4c0e-8f3a-73746570b001`; all numbers little endian; every value fits MTU 23 (20 bytes).

| characteristic | UUID 5e9aNNNN-… | access | value |
| --- | --- | --- | --- |
| data      | 0002 | notify | one packet, below |
| scale     | 0003 | read   | u16, LSB per g (4096: ±8 g) |
| rate      | 0004 | read   | u16, samples per second × 100 |
| boot      | 0005 | read   | u32, number of the boot: one more at each reset, wraps |
| device id | 0006 | read   | 1–20 bytes of UTF-8, the same for ever |
| clock     | 0007 | read   | u32 index of a sample (a multiple of 128), u64 tick at it |
| sensors   | 0008 | read   | what it measures, below; without this characteristic acceleration only |
| control   | 0009 | write, indicate | requests and answers, tabled in `service.wearables.bracelet_control` |
| history   | 000a | read   | u32, how many of its newest samples it keeps and sends again; 0: none |
| register  | 000b | read, notify | u32, steps its own simple counter has counted since boot |
| utc       | 000c | read   | u64, ms since 1970 by its own clock; 0 until it knows the time |

Those from 0008 on may be missing. With `control` a device sends data between the requests start and stop only, and a
new connection begins stopped; without it, to whoever subscribes to data. A host subscribes to control, then to data,
then writes start.

| packet at | type | field |
| --- | --- | --- |
| 0 | u8  | bits 0–3 version = 1; bit 4: sent again from history; bits 5, 6: samples hold g, m; bit 7 zero |
| 1 | u8  | low 8 bits of the boot number |
| 2 | u32 | index of the first sample since boot; wraps |
| 6 | u16 | low 16 bits of the tick (1/1024 s since boot) at sample `index − index mod 128` |
| 8 | n × 3k × i16 | n ≥ 1 samples, each x, y, z of acceleration, then of g, then of m, of those it holds |

| sensors at | type | field |
| --- | --- | --- |
| 0 | u8  | bit 0: accelerometer, always 1; bit 1: gyroscope; bit 2: magnetometer; bits 3–7 zero |
| 1 | u16 | g: LSB per rad/s of angular rate (900: ±36 rad/s or 2086 °/s); 0 without a gyroscope |
| 3 | u16 | m: LSB per 100 µT of field (6400: ±512 µT, ten times the Earth's); 0 without a magnetometer |

| samples of | bytes | n at MTU 23 | at 185 | at 517 |
| --- | --- | --- | --- | --- |
| acceleration | 6 | 2 | 29 | 84 |
| acceleration and g or m | 12 | 1 | 14 | 42 |
| all three | 18 | none: m is left out | 9 | 28 |

A packet tells by itself what its samples hold. Where one sample of all sensors does not fit (MTU 23 to 28), m is left
out and the rest sent; who needs m asks for a larger MTU. Axes are the same for all three, right-handed.
The index counts samples, not packets, and the tick is taken at every 128th sample only: so packets of any size say the
same about the same samples. A value outside i16 is sent as its limit, and one at its limit is taken for saturated.
Samples sent again (bit 4) have the numbers, ticks and values they had; they come in order, between live packets.
Beside it stand the standard Battery (180F), Device Information (180A) and perhaps Running Speed and Cadence (1814).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from service.errors import WireError, WireFault
from service.samples import ACCELEROMETER_ONLY, TICK_EVERY, Columns, DeviceInfo, RawBlock, Reply, Sensor, Sensors
from service.wearables import bracelet_control as control
from service.wearables.bracelet_values import (
    BATTERY_LEVEL,
    BOOT,
    CLOCK,
    CONTROL,
    DATA,
    DEVICE_ID,
    FIRMWARE_REVISION,
    HISTORY,
    MANUFACTURER_NAME,
    MODEL_NUMBER,
    RATE,
    REGISTER,
    SCALE,
    SENSORS,
    SENSORS_LAYOUT,
    SERVICE,
    UTC,
    decode_battery,
    decode_clock,
    decode_device_id,
    decode_history,
    decode_rate,
    decode_register,
    encode_boot,
    encode_clock,
    encode_device_id,
    encode_history,
    encode_rate,
    encode_register,
    encode_scale,
    encode_sensors,
    encode_utc,
    fixed,
    text,
)
from service.wearables.contract import Action, Read, Subscribe, Write

__all__ = [
    "ATT_HEADER",
    "BATTERY_LEVEL",
    "BOOT",
    "CLOCK",
    "CONTROL",
    "DATA",
    "DEFAULT_LSB_PER_100_UT",
    "DEFAULT_LSB_PER_G",
    "DEFAULT_LSB_PER_RAD_S",
    "DEVICE_ID",
    "FIRMWARE_REVISION",
    "FLAG_GYROSCOPE",
    "FLAG_HISTORY",
    "FLAG_MAGNETOMETER",
    "HISTORY",
    "MANUFACTURER_NAME",
    "MODEL_NUMBER",
    "RATE",
    "REGISTER",
    "SCALE",
    "SENSORS",
    "SERVICE",
    "UTC",
    "VERSION",
    "Bracelet",
    "DataPacket",
    "encode",
    "encode_boot",
    "encode_clock",
    "encode_device_id",
    "encode_history",
    "encode_rate",
    "encode_register",
    "encode_scale",
    "encode_sensors",
    "encode_utc",
    "packet_sensors",
    "samples_per_packet",
    "tick_index",
]

VERSION: Final = 1
FLAG_HISTORY: Final = 0x10
FLAG_GYROSCOPE: Final = 0x20
FLAG_MAGNETOMETER: Final = 0x40
_FLAGS_RESERVED: Final = 0x80
ATT_HEADER: Final = 3
"""Bytes of a notification that are not value: op code and handle."""
_HEADER: Final = struct.Struct("<BBIH")
_TRIPLE_BYTES: Final = 6
_I16_MIN, _I16_MAX = -32768, 32767
_LOWEST, _HIGHEST = struct.pack("<h", _I16_MIN), struct.pack("<h", _I16_MAX)
DEFAULT_LSB_PER_G: Final = 4096
"""±8 g in 16 bits: running on the wrist passes ±4 g."""
DEFAULT_LSB_PER_RAD_S: Final = 900
"""±2086 °/s: the widest range of the usual gyroscopes is ±2000."""
DEFAULT_LSB_PER_100_UT: Final = 6400
"""±512 µT: the Earth's field is 25 to 65, a magnet near the wrist several times that."""
_OPTIONAL: Final = (Sensor.GYROSCOPE, Sensor.MAGNETOMETER)
_UNITS: Final = {Sensor.GYROSCOPE: 1.0, Sensor.MAGNETOMETER: 100.0}
"""What a scale on the wire is per, in rad/s and µT."""
_HELD: Final[dict[int, Sensors]] = {
    0: ACCELEROMETER_ONLY,
    FLAG_GYROSCOPE: (Sensor.ACCELEROMETER, Sensor.GYROSCOPE),
    FLAG_MAGNETOMETER: (Sensor.ACCELEROMETER, Sensor.MAGNETOMETER),
    FLAG_GYROSCOPE | FLAG_MAGNETOMETER: tuple(Sensor),
}


def packet_sensors(mtu: int, sensors: Sensors) -> Sensors:
    """Return those of `sensors` that a packet's samples hold at an ATT MTU of `mtu` bytes: the last do not fit 23."""
    return sensors[: (mtu - ATT_HEADER - _HEADER.size) // _TRIPLE_BYTES]


def samples_per_packet(mtu: int, sensors: Sensors = ACCELEROMETER_ONLY) -> int:
    """Return how many samples one notification holds at an ATT MTU of `mtu` bytes: of acceleration 2 at 23."""
    return (mtu - ATT_HEADER - _HEADER.size) // (_TRIPLE_BYTES * len(packet_sensors(mtu, sensors)))


def tick_index(index: int) -> int:
    """Return the index of the sample whose tick a packet that starts at `index` carries."""
    return index - index % TICK_EVERY


@dataclass(frozen=True, slots=True, kw_only=True)
class DataPacket:
    """One packet before encoding; `counts` are each sample's x, y, z of each of `sensors`, in LSB.

    They are saturated to i16 when encoded.
    """

    boot: int
    index: int
    tick: int
    counts: Sequence[Sequence[int]]
    history: bool = False
    sensors: Sensors = ACCELEROMETER_ONLY


def encode(packet: DataPacket) -> bytes:
    """Return the packet's bytes; ValueError where a sample is not as wide as its sensors."""
    if any(len(sample) != 3 * len(packet.sensors) for sample in packet.counts):
        raise ValueError(f"three values a sample of each of {', '.join(packet.sensors)}")
    flags = VERSION | (FLAG_HISTORY if packet.history else 0)
    flags |= FLAG_GYROSCOPE if Sensor.GYROSCOPE in packet.sensors else 0
    flags |= FLAG_MAGNETOMETER if Sensor.MAGNETOMETER in packet.sensors else 0
    header = _HEADER.pack(flags, packet.boot & 0xFF, packet.index & 0xFFFFFFFF, packet.tick & 0xFFFF)
    flat = [min(max(value, _I16_MIN), _I16_MAX) for sample in packet.counts for value in sample]
    return header + struct.pack(f"<{len(flat)}h", *flat)


class Bracelet:
    """The host's side of the protocol: what to do after connecting, and bytes to samples."""

    services: Sequence[str] = (SERVICE,)

    def __init__(self) -> None:
        self._sensors = ACCELEROMETER_ONLY
        self._scales: dict[Sensor, float] = {}
        """LSB per unit of each sensor whose scale was read."""
        self._boot: int | None = None
        self._keeps = False
        """Whether it keeps samples to send again."""
        self._readers: dict[str, Callable[[bytes], RawBlock | DeviceInfo | Reply]] = {
            DATA: self._data,
            SCALE: self._scale,
            RATE: decode_rate,
            BOOT: self._boot_number,
            DEVICE_ID: decode_device_id,
            CLOCK: decode_clock,
            SENSORS: self._sensors_told,
            BATTERY_LEVEL: decode_battery,
            HISTORY: self._history_told,
            REGISTER: decode_register,
            CONTROL: control.reply,
            MANUFACTURER_NAME: lambda data: DeviceInfo(manufacturer=text(data, MANUFACTURER_NAME)),
            MODEL_NUMBER: lambda data: DeviceInfo(model=text(data, MODEL_NUMBER)),
            FIRMWARE_REVISION: lambda data: DeviceInfo(firmware=text(data, FIRMWARE_REVISION)),
        }

    def handshake(self) -> Sequence[Action]:
        """Read who, how fast and how large; subscribe; begin. What old firmware or a plain one lacks is optional."""
        optional = (MANUFACTURER_NAME, MODEL_NUMBER, FIRMWARE_REVISION, BATTERY_LEVEL, HISTORY, REGISTER)
        return (
            *(Read(characteristic=uuid) for uuid in (DEVICE_ID, BOOT)),
            Read(characteristic=SENSORS, optional=True),
            *(Read(characteristic=uuid) for uuid in (SCALE, RATE, CLOCK)),
            *(Read(characteristic=uuid, optional=True) for uuid in optional),
            *(Subscribe(characteristic=uuid, optional=True) for uuid in (CONTROL, BATTERY_LEVEL, REGISTER)),
            Subscribe(characteristic=DATA),
            control.start(),
        )

    def feed(self, characteristic: str, data: bytes) -> RawBlock | DeviceInfo | Reply | None:
        """Decode one value; WireError where it breaks the format, None for a characteristic that is not ours."""
        reader = self._readers.get(characteristic)
        return None if reader is None else reader(data)

    def history(self, boot: int, first: int, samples: int) -> Sequence[Write]:
        """Return the request for samples again; nothing where this bracelet keeps none."""
        return (control.report(boot, first, samples),) if self._keeps and samples > 0 else ()

    def _history_told(self, data: bytes) -> DeviceInfo:
        said = decode_history(data)
        self._keeps = bool(said.history_samples)
        return said

    def _data(self, data: bytes) -> RawBlock:
        if len(data) < _HEADER.size:
            raise WireError(WireFault.LENGTH, f"a packet of {len(data)} bytes; its header alone has {_HEADER.size}")
        flags, boot_low, index, tick = _HEADER.unpack_from(data)
        if flags & 0x0F != VERSION or flags & _FLAGS_RESERVED:
            raise WireError(WireFault.VERSION, f"version and flags {flags:#04x}; this is version {VERSION}")
        if Sensor.ACCELEROMETER not in self._scales:
            raise WireError(WireFault.ORDER, "a packet before the scale was read")
        held = _HELD[flags & (FLAG_GYROSCOPE | FLAG_MAGNETOMETER)]
        values = _values(data, held)
        return RawBlock(
            boot=self._full_boot(boot_low),
            index=index,
            tick=tick,
            history=bool(flags & FLAG_HISTORY),
            saturated=_saturated(data, values, held),
            acc_g=self._columns(Sensor.ACCELEROMETER, values, held),
            gyro_rad_s=self._columns(Sensor.GYROSCOPE, values, held) if flags & FLAG_GYROSCOPE else None,
            mag_ut=self._columns(Sensor.MAGNETOMETER, values, held) if flags & FLAG_MAGNETOMETER else None,
        )

    def _columns(self, sensor: Sensor, values: tuple[int, ...], held: Sensors) -> Columns:
        """Return a sensor's x, y and z in its unit, from the values of all."""
        scale = self._scales.get(sensor)
        if scale is None:
            raise WireError(WireFault.ORDER, f"samples of a {sensor} whose scale was not told")
        first, width = 3 * held.index(sensor), 3 * len(held)
        x, y, z = ([value / scale for value in values[first + axis :: width]] for axis in range(3))
        return x, y, z

    def _full_boot(self, low: int) -> int:
        """Return the first boot number from the one read on whose low byte is `low`: boots count upwards."""
        known = self._boot or 0
        return (known + (low - known) % 256) & 0xFFFFFFFF

    def _boot_number(self, data: bytes) -> DeviceInfo:
        (self._boot,) = fixed("<I", data, BOOT)
        return DeviceInfo(boot=self._boot)

    def _scale(self, data: bytes) -> DeviceInfo:
        (lsb_per_g,) = fixed("<H", data, SCALE)
        if lsb_per_g == 0:
            raise WireError(WireFault.VALUE, "a scale of 0 LSB per g")
        self._scales[Sensor.ACCELEROMETER] = float(lsb_per_g)
        return DeviceInfo(lsb_per_g=float(lsb_per_g), sensors=self._sensors)

    def _sensors_told(self, data: bytes) -> DeviceInfo:
        mask, *scales = fixed(SENSORS_LAYOUT, data, SENSORS)
        if not mask & 1 or mask >> len(Sensor):
            raise WireError(WireFault.VALUE, f"sensors {mask:#04x}; bit 0 is set and bits 3–7 are not")
        sensors = tuple(sensor for bit, sensor in enumerate(Sensor) if mask >> bit & 1)
        told = {sensor: scale for sensor, scale in zip(_OPTIONAL, scales, strict=True) if sensor in sensors}
        if 0 in told.values():
            raise WireError(WireFault.VALUE, "a scale of 0 for a sensor that is there")
        self._sensors = sensors
        self._scales = {sensor: scale for sensor, scale in self._scales.items() if sensor not in _OPTIONAL}
        self._scales |= {sensor: scale / _UNITS[sensor] for sensor, scale in told.items()}
        return DeviceInfo(sensors=sensors)


def _values(data: bytes, held: Sensors) -> tuple[int, ...]:
    """Return a packet's values as they stand; WireError where they are no whole samples."""
    n, rest = divmod(len(data) - _HEADER.size, _TRIPLE_BYTES * len(held))
    if rest or n == 0:
        why = f"a packet of {len(data)} bytes; {_HEADER.size} + {_TRIPLE_BYTES * len(held)} n are valid, n ≥ 1"
        raise WireError(WireFault.LENGTH, why)
    values: tuple[int, ...] = struct.unpack_from(f"<{3 * len(held) * n}h", data, _HEADER.size)
    return values


def _saturated(data: bytes, values: tuple[int, ...], held: Sensors) -> Sequence[int]:
    """Return which samples hold a value at its limit; the bytes tell at once that there is none."""
    if _LOWEST not in data and _HIGHEST not in data:
        return ()
    return sorted({i // (3 * len(held)) for i, value in enumerate(values) if value in {_I16_MIN, _I16_MAX}})
