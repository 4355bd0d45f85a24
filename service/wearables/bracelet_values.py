"""The bracelet's characteristics and the values of those that are read: who it is, how fast, how large, how full.

Encoders serve a device, decoders a host; the tables are in `service.wearables.bracelet`.
"""

from __future__ import annotations

import struct
from typing import Final

from service.errors import ParameterError, WireError, WireFault
from service.samples import TICK_EVERY, DeviceInfo, Sensor, Sensors


def _uuid(number: int) -> str:
    return f"5e9a{number:04x}-4b1d-4c0e-8f3a-73746570b001"


def _sig(number: int) -> str:
    return f"0000{number:04x}-0000-1000-8000-00805f9b34fb"


SERVICE: Final = _uuid(1)
DATA: Final = _uuid(2)
SCALE: Final = _uuid(3)
RATE: Final = _uuid(4)
BOOT: Final = _uuid(5)
DEVICE_ID: Final = _uuid(6)
CLOCK: Final = _uuid(7)
SENSORS: Final = _uuid(8)
CONTROL: Final = _uuid(9)
HISTORY: Final = _uuid(10)
REGISTER: Final = _uuid(11)
UTC: Final = _uuid(12)
BATTERY_LEVEL: Final = _sig(0x2A19)
MANUFACTURER_NAME: Final = _sig(0x2A29)
MODEL_NUMBER: Final = _sig(0x2A24)
FIRMWARE_REVISION: Final = _sig(0x2A26)

ID_RULE: Final = "1 to 20 bytes of printable UTF-8 without /"
SENSORS_LAYOUT: Final = "<BHH"
LONGEST_UPTIME_TICKS: Final = 1 << 42
"""136 years: no device runs longer, and device time stays exact to far below a sample."""
LATEST_UTC_MS: Final = 253_402_300_800_000
"""The year 10000, which no calendar of ours reaches."""


def encode_scale(lsb_per_g: int) -> bytes:
    """Return the scale characteristic's value; `lsb_per_g` 1…65535."""
    return struct.pack("<H", lsb_per_g)


def encode_rate(rate_hz: float) -> bytes:
    """Return the rate characteristic's value; `rate_hz` 0.01…655.35."""
    return struct.pack("<H", round(rate_hz * 100))


def encode_boot(boot: int) -> bytes:
    """Return the boot characteristic's value."""
    return struct.pack("<I", boot & 0xFFFFFFFF)


def encode_device_id(device: str) -> bytes:
    """Return the device id characteristic's value; ParameterError where the id breaks its rule."""
    data = device.encode()
    if not _valid_id(device, data):
        raise ParameterError("device_id", device, ID_RULE)
    return data


def encode_clock(index: int, tick: int) -> bytes:
    """Return the clock characteristic's value: the full tick at sample `index`, a multiple of 128."""
    return struct.pack("<IQ", index & 0xFFFFFFFF, tick)


def encode_sensors(sensors: Sensors, *, lsb_per_rad_s: int, lsb_per_100_ut: int) -> bytes:
    """Return the sensors characteristic's value; scales 1…65535, those of sensors that are not there are left out."""
    mask = sum(1 << bit for bit, sensor in enumerate(Sensor) if sensor in sensors)
    gyroscope = lsb_per_rad_s if Sensor.GYROSCOPE in sensors else 0
    magnetometer = lsb_per_100_ut if Sensor.MAGNETOMETER in sensors else 0
    return struct.pack(SENSORS_LAYOUT, mask, gyroscope, magnetometer)


def encode_history(samples: int) -> bytes:
    """Return the history characteristic's value: how many of its newest samples it keeps."""
    return struct.pack("<I", samples)


def encode_register(steps: int) -> bytes:
    """Return the step register's value."""
    return struct.pack("<I", steps & 0xFFFFFFFF)


def encode_utc(utc_ms: int) -> bytes:
    """Return the UTC characteristic's value; 0 until the device knows what time it is."""
    return struct.pack("<Q", utc_ms)


def decode_rate(data: bytes) -> DeviceInfo:
    """Return the rate; WireError where no counter could use it."""
    (hundredths,) = fixed("<H", data, RATE)
    if not 100 <= hundredths <= 40_000:
        raise WireError(WireFault.VALUE, f"a rate of {hundredths / 100} Hz; 1 to 400 are valid")
    return DeviceInfo(rate_hz=hundredths / 100)


def decode_clock(data: bytes) -> DeviceInfo:
    """Return index and full tick of a sample."""
    index, tick = fixed("<IQ", data, CLOCK)
    if index % TICK_EVERY:
        raise WireError(WireFault.VALUE, f"a clock at sample {index}, no multiple of {TICK_EVERY}")
    if tick >= LONGEST_UPTIME_TICKS:
        raise WireError(WireFault.VALUE, f"a clock of {tick} ticks, more than a hundred years after boot")
    return DeviceInfo(clock=(index, tick))


def decode_battery(data: bytes) -> DeviceInfo:
    """Return the charge."""
    (percent,) = fixed("<B", data, BATTERY_LEVEL)
    if percent > 100:
        raise WireError(WireFault.VALUE, f"a battery at {percent} %")
    return DeviceInfo(battery_percent=percent)


def decode_device_id(data: bytes) -> DeviceInfo:
    """Return the id."""
    told = text(data, DEVICE_ID)
    if not _valid_id(told, data):
        raise WireError(WireFault.VALUE, f"a device id of {len(data)} bytes; {ID_RULE} are valid")
    return DeviceInfo(device=told)


def decode_history(data: bytes) -> DeviceInfo:
    """Return how many samples it keeps."""
    return DeviceInfo(history_samples=fixed("<I", data, HISTORY)[0])


def decode_register(data: bytes) -> DeviceInfo:
    """Return what the device's own step counter has counted."""
    return DeviceInfo(register_steps=fixed("<I", data, REGISTER)[0])


def decode_utc(data: bytes) -> int | None:
    """Return the device's own UTC in ms since 1970, None where it does not know it."""
    (utc_ms,) = fixed("<Q", data, UTC)
    if utc_ms >= LATEST_UTC_MS:
        raise WireError(WireFault.VALUE, f"a time of {utc_ms} ms, beyond the year 9999")
    return utc_ms or None


def text(data: bytes, characteristic: str) -> str:
    """Return a text; WireError where it is no UTF-8."""
    try:
        return data.decode("utf-8").rstrip("\0")
    except UnicodeDecodeError:
        raise WireError(WireFault.VALUE, f"{characteristic} is no UTF-8") from None


def fixed(layout: str, data: bytes, characteristic: str) -> tuple[int, ...]:
    """Return the values of a layout; WireError where there are more or fewer bytes."""
    if len(data) != struct.calcsize(layout):
        raise WireError(WireFault.LENGTH, f"{characteristic}: {len(data)} bytes, not {struct.calcsize(layout)}")
    values: tuple[int, ...] = struct.unpack(layout, data)
    return values


def _valid_id(text: str, data: bytes) -> bool:
    return 1 <= len(data) <= 20 and text.isprintable() and "/" not in text
