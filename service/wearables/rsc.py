"""The Bluetooth SIG's Running Speed and Cadence (service 0x1814): cadence and speed, and no count of steps.

| measurement (2A53, notify) at | type | field |
| --- | --- | --- |
| 0 | u8  | bit 0: stride length follows; bit 1: total distance follows; bit 2: running, else walking; others zero |
| 1 | u16 | speed, 1/256 m/s |
| 3 | u8  | cadence, per minute |
| 4 | u16 | stride length, cm, where bit 0 says so |
| … | u32 | total distance, 0.1 m, where bit 1 says so |

Feature (2A54, read): u16, bits 0–2 as above: what it can measure. Devices differ by a factor of two in what they call
cadence, steps of one foot or of both; ours are of both.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from service.errors import WireError, WireFault

SERVICE: Final = "00001814-0000-1000-8000-00805f9b34fb"
MEASUREMENT: Final = "00002a53-0000-1000-8000-00805f9b34fb"
FEATURE: Final = "00002a54-0000-1000-8000-00805f9b34fb"
STRIDE: Final = 0x01
DISTANCE: Final = 0x02
RUNNING: Final = 0x04
_KNOWN: Final = STRIDE | DISTANCE | RUNNING
_U8, _U16, _U32 = 0xFF, 0xFFFF, 0xFFFFFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """How fast somebody goes, and how often a foot comes down; None: not told."""

    speed_m_s: float
    cadence_spm: int
    running: bool = False
    stride_m: float | None = None
    distance_m: float | None = None


def encode(measurement: Measurement) -> bytes:
    """Return the measurement's bytes; a value beyond its field is sent as the field's limit."""
    flags = (
        STRIDE * (measurement.stride_m is not None)
        | DISTANCE * (measurement.distance_m is not None)
        | RUNNING * measurement.running
    )
    speed, cadence = _held(measurement.speed_m_s * 256, _U16), _held(measurement.cadence_spm, _U8)
    data = struct.pack("<BHB", flags, speed, cadence)
    if measurement.stride_m is not None:
        data += struct.pack("<H", _held(measurement.stride_m * 100, _U16))
    if measurement.distance_m is not None:
        data += struct.pack("<I", _held(measurement.distance_m * 10, _U32))
    return data


def decode(data: bytes) -> Measurement:
    """Return what is measured; WireError where it breaks the format."""
    if not data:
        raise WireError(WireFault.LENGTH, "a measurement of no bytes")
    flags = data[0]
    if flags & ~_KNOWN:
        raise WireError(WireFault.VALUE, f"flags {flags:#04x}; bits 3–7 are reserved")
    layout = "<BHB" + "H" * bool(flags & STRIDE) + "I" * bool(flags & DISTANCE)
    if len(data) != struct.calcsize(layout):
        raise WireError(WireFault.LENGTH, f"a measurement of {len(data)} bytes, not {struct.calcsize(layout)}")
    _, speed, cadence, *more = struct.unpack(layout, data)
    return Measurement(
        speed_m_s=speed / 256,
        cadence_spm=cadence,
        running=bool(flags & RUNNING),
        stride_m=more.pop(0) / 100 if flags & STRIDE else None,
        distance_m=more.pop(0) / 10 if flags & DISTANCE else None,
    )


def encode_feature(features: int) -> bytes:
    """Return the feature characteristic's value: STRIDE, DISTANCE, RUNNING, or'ed."""
    return struct.pack("<H", features)


def decode_feature(data: bytes) -> int:
    """Return what a device can measure; WireError where that is no u16."""
    if len(data) != 2:
        raise WireError(WireFault.LENGTH, f"features of {len(data)} bytes, not 2")
    return int.from_bytes(data, "little")


def _held(value: float, limit: int) -> int:
    return min(max(round(value), 0), limit)
