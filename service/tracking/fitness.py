"""Whether a counter can count what a device sends, and the sentence that says why not.

Judged as soon as a device has described itself, before its first sample, and again whenever its samples carry something
else or its rate turns out otherwise. A counter that cannot count is left out meanwhile; when it can again, it goes on
as after a gap.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

from service.counters.contract import StepCounter, lacking
from service.samples import ACCELEROMETER_ONLY, MIN_RATE_HZ, Sensor

_SLOWEST_HZ: Final = 0.99 * MIN_RATE_HZ
"""A clock that lags a little does not make a device of 10 Hz too slow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """What is known of a device's stream: sensors it says it has, sensors its samples hold, samples a second."""

    has: Collection[Sensor] | None
    holds: Collection[Sensor] | None
    rate_hz: float | None

    @property
    def too_slow(self) -> bool:
        """Whether there are too few samples a second to tell steps apart."""
        return self.rate_hz is not None and self.rate_hz < _SLOWEST_HZ


def faults(counters: Mapping[str, StepCounter], stream: Stream) -> dict[str, str]:
    """Return why each counter that cannot count `stream` does not, as a sentence."""
    told = {name: why_not(name, counter.sensors, stream) for name, counter in counters.items()}
    return {name: why for name, why in told.items() if why is not None}


def why_not(name: str, needed: Collection[Sensor], stream: Stream) -> str | None:
    """Return why the counter `name`, which needs these sensors, cannot count `stream`; None where it can."""
    if stream.too_slow:
        return f"{name} needs {MIN_RATE_HZ:g} samples a second or more; the device takes {stream.rate_hz:.3g}"
    has = stream.holds if stream.has is None else stream.has
    if has is not None and (why := lacking(name, needed, has)) is not None:
        return why
    unsent = [] if stream.holds is None else sorted(set(needed).difference(stream.holds, ACCELEROMETER_ONLY))
    if unsent:
        return f"{name} needs {', '.join(unsent)}, which the device has and does not send: is the link's MTU too small?"
    return None
