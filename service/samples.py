"""The vocabulary every room speaks: samples, what a counter says of them, what a device says of itself.

Device time is seconds after the device's boot. Sample k of the grid lies at k / GRID_HZ seconds of it. Host time is a
label added by the session and influences no count. Columns are any indexable of floats: lists while live, float64
arrays where a whole recording is counted at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GRID_HZ = 50
"""Rate every counter runs at: the source documents' own (000 and 003 sample at 50 Hz)."""

TICK_HZ = 1024
"""Resolution of a device tick; 16 low bits wrap every 64 s."""

TICK_EVERY = 128
"""A tick is taken at every sample whose index is a multiple of this, so that time does not depend on packet size."""

MIN_RATE_HZ = 10.0
"""A run has up to 4 steps a second, and its second harmonic tells the feet apart: less is no signal to count."""

Column = Sequence[float] | NDArray[np.float64]
Columns = tuple[Column, Column, Column]


class Sensor(StrEnum):
    """What a device can measure."""

    ACCELEROMETER = "accelerometer"
    GYROSCOPE = "gyroscope"
    MAGNETOMETER = "magnetometer"


Sensors = tuple[Sensor, ...]
"""Sensors of a device or of its samples, in the order of the enumeration; every device has the first."""

ACCELEROMETER_ONLY: Sensors = (Sensor.ACCELEROMETER,)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawBlock:
    """n samples as a device sent them, at its own rate.

    `index` is that of the first sample since boot (u32, wraps); `tick` is the low 16 bits of the device tick
    (1/1024 s) at sample `index - index % TICK_EVERY`, None where a device has no clock.
    """

    boot: int
    index: int
    tick: int | None
    history: bool = False
    """Sent again because a host asked for it."""
    acc_g: Columns
    gyro_rad_s: Columns | None = None
    mag_ut: Columns | None = None
    saturated: Sequence[int] = ()
    """Which samples, counted from the block's first, hold a value at its limit: the true one is unknown."""

    def __len__(self) -> int:
        return len(self.acc_g[0])

    @property
    def sensors(self) -> Sensors:
        """What every sample of the block holds."""
        return _HELD[self.gyro_rad_s is not None, self.mag_ut is not None]


_HELD = {
    (gyro, mag): tuple(sensor for sensor, held in zip(Sensor, (True, gyro, mag), strict=True) if held)
    for gyro in (False, True)
    for mag in (False, True)
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleBlock:
    """n consecutive samples of the 50 Hz grid; `start` is the grid index of the first.

    A block that does not start where the last one ended says by that that samples are missing between them.
    """

    start: int
    acc_g: Columns
    gyro_rad_s: Columns | None = None
    mag_ut: Columns | None = None

    def __len__(self) -> int:
        return len(self.acc_g[0])


class Step(NamedTuple):
    """One counted step.

    `at_s` is device time after boot, the filter's delay removed. `interval_s` is the time since the previous step of
    the same bout (None for its first). `strength` is peak minus valley in the counter's own unit; `peak`, `valley`,
    `upper`, `lower` (None where a counter has no such thing) are what decided it, on the counter's filtered signal.
    """

    at_s: float
    strength: float
    interval_s: float | None = None
    peak: float | None = None
    valley: float | None = None
    upper: float | None = None
    lower: float | None = None


class Band(NamedTuple):
    """Both thresholds in force over a window of device time, for the plot."""

    from_s: float
    to_s: float
    upper: float
    lower: float


Likely = tuple[float, float, bool]
"""A step that may come: device time, strength, whether it passes what is in force. Confirmed, it has the same time."""


class Verdict(StrEnum):
    """What a counter that recognises walking makes of the motion it was given."""

    REST = "rest"
    """Hardly any motion."""
    OTHER = "other"
    """Motion that is no walking: its peaks are refused."""
    PERHAPS = "perhaps"
    """It may be walking and is not certain yet: its steps wait, and are credited in retrospect or refused."""
    WALKING = "walking"


class Gait(NamedTuple):
    """Whether somebody walks, as of device time `at_s`: a little before the newest sample.

    `confidence` is the probability of walking, 0 to 1; `cadence_hz` is in steps a second, None unless walking.
    """

    at_s: float
    verdict: Verdict
    confidence: float
    cadence_hz: float | None


class Update(NamedTuple):
    """What a counter says after a block: steps now certain, how many more are likely, and its view for the plot.

    `likely` names every peak that can still become a step, where the counter can tell them apart; one it names no more
    and has not confirmed is retracted. `pending` counts those of them that pass what is in force. `trace` holds the
    filtered signal, one value a sample of the block, the first at device time `trace_from_s`. `gait` is the newest of a
    counter that recognises walking, which has one in every update, None of any other. A tuple, since one is made a
    packet and counter, and a frozen dataclass takes twice as long to make.
    """

    steps: tuple[Step, ...] = ()
    pending: int = 0
    likely: Sequence[Likely] = ()
    trace_from_s: float = 0.0
    trace: Sequence[float] = ()
    bands: tuple[Band, ...] = ()
    gait: Gait | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Packet:
    """Bytes of one characteristic, as they arrived.

    `at_ns` is host UTC in nanoseconds at arrival: a label, never used for counting.
    """

    characteristic: str
    data: bytes
    at_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceInfo:
    """What a device says of itself; None until it has said it."""

    device: str | None = None
    boot: int | None = None
    rate_hz: float | None = None
    lsb_per_g: float | None = None
    lsb_per_rad_s: float | None = None
    lsb_per_ut: float | None = None
    battery_percent: int | None = None
    clock: tuple[int, int] | None = None
    """(sample index, full tick at that sample): tells the high bits of the tick once a connection."""
    manufacturer: str | None = None
    model: str | None = None
    firmware: str | None = None
    sensors: Sensors | None = None
    history_samples: int | None = None
    """How many of its newest samples it can send again; 0 or None: none."""
    register_steps: int | None = None
    """What its own simple counter has counted since boot: to be shown beside our count, never summed into it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """A device's answer to a request.

    `request` names it ("start", "stop", "rate", "range", "time", "history", "extent", "abort"); `why` is a sentence
    where it was not `accepted`. Of history, the device has sent again all that it held of the range asked for:
    `samples` of them from `first` (u32) of boot `boot` on. What was asked for and lies outside of that it does not
    have any more.
    """

    request: str
    accepted: bool
    why: str = ""
    boot: int | None = None
    first: int = 0
    samples: int = 0
