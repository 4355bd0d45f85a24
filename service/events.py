"""The vocabulary of what happens: steps, gaps, walks, counts; all that a Tracker emits.

Times are device time, seconds after boot. A session adds the device's id, an ordinal to the durable ones, and UTC. What
is *ephemeral* may be left out for a slow reader; what is *never published* is for the service itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from service.samples import GRID_HZ, Band, DeviceInfo, Gait, RawBlock, SampleBlock, Step


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """The direction somebody walks in, degrees clockwise from magnetic north, and its standard uncertainty.

    Where `is_line`, that or the opposite one: `deg` is in [0, 180).
    """

    deg: float
    uncertainty_deg: float
    is_line: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCounted:
    """Durable: one confirmed step; `steps` is this counter's count with it, `boot` the boot its time belongs to.

    Its time is known to `uncertainty_s`. `heading` is None where the sensors give none.
    """

    counter: str
    boot: int
    steps: int
    step: Step
    uncertainty_s: float = 0.5 / GRID_HZ
    heading: Heading | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tentative:
    """Neither kept nor numbered: `counter`, the primary, calls its step at `at_s` likely, or it is `retracted`.

    The StepCounted of that counter, boot and time confirms it.

    `passes` tells whether it passes what was in force when it was told: the sure ones. `interval_s` is the time since
    the confirmed step or the sure one before, None after a pause. Time and heading as in StepCounted.
    """

    counter: str
    boot: int
    at_s: float
    strength: float
    interval_s: float | None
    passes: bool
    retracted: bool
    uncertainty_s: float = 0.5 / GRID_HZ
    heading: Heading | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """Durable: samples that did not arrive. `filled` ones (≤ 0.6 s) were interpolated, others start filters afresh."""

    from_s: float
    to_s: float
    index: int
    samples: int
    filled: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Awaited:
    """Not numbered: samples that did not arrive and may still come; until then what is behind them is tentative.

    Told once more packets have come behind them than a reordering lasts. Each is over with the first Corrected of its
    boot for which `Corrected.from_s <= from_s < Corrected.to_s`, whether its samples came or a Gap tells of those that
    did not.
    """

    from_s: float
    to_s: float
    index: int
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrected:
    """Durable: what was awaited came or is lost, and from `from_s` to `to_s` was counted again.

    Of the primary's steps that were sure behind it `removed` are none, and `added` were not told. Told for everything
    that was Awaited, also where no step changed; for a hole that closed before only if a sure step was removed.
    """

    boot: int
    from_s: float
    to_s: float
    removed: int
    added: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebooted:
    """Durable: the device started again; its device time begins at zero, its count goes on."""

    boot: int
    previous: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Segmented:
    """Durable: from now on `primary` counts the device's steps; `steps` is the device's count so far."""

    primary: str
    steps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Walked:
    """Durable: a walk `begins` or is over, by the verdict of `counter`, the primary, which recognises walking.

    It begins at the device time from which it may have been one without a break, at most the counter's `latency_s`
    before that was certain, and is over where it was last called one. Another boot or primary ends it too.
    """

    counter: str
    boot: int
    at_s: float
    begins: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Described:
    """The device said something of itself (identity, rate, scale, battery)."""

    info: DeviceInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Ephemeral: the primary counter's filtered signal at 50 Hz from `from_s` on, with thresholds once decided."""

    from_s: float
    values: Sequence[float]
    bands: tuple[Band, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Counting:
    """Ephemeral: both counts and cadence; `now_s` is the device time of the newest sample.

    `gait` is what the primary makes of the motion, None where it does not recognise walking.
    """

    now_s: float
    steps: int
    steps_now: int
    cadence_spm: float | None
    gait: Gait | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Gridded:
    """Never published: the grid samples that the counters were given; a Gap before them has been told."""

    block: SampleBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class Received:
    """Never published: samples that are believed and were not there before, for whoever keeps them.

    The block's index is unwrapped; `run` counts the device's boots since the session began, from 0.
    """

    run: int
    block: RawBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Never published: the device described itself by a value of a characteristic, before sample `index` of `run`."""

    run: int
    boot: int
    index: int
    characteristic: str
    data: bytes


Event = (
    StepCounted
    | Tentative
    | Gap
    | Awaited
    | Corrected
    | Rebooted
    | Segmented
    | Walked
    | Described
    | Signal
    | Counting
    | Gridded
    | Received
    | Heard
)
