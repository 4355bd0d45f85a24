"""Host time of a moment of device time: a label for people, never used for counting.

A packet arrives after its newest sample was taken, by a delay that is never negative and often small. So the smallest
(arrival − device time) seen within WINDOW_NS is the offset between the two clocks, up to the smallest delay. That one,
constant as long as the link is, cannot be seen from one side: host times are late by it, and `uncertainty_s` does not
hold it (over Bluetooth some milliseconds of radio, and what a device waits between measuring and sending).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

WINDOW_NS = 60_000_000_000
"""Offsets are looked at over one to two of these: ±200 ppm of drift move them by less than 25 ms."""
_SMOOTHING = 0.05
"""Weight of the newest arrival in the means: the last four seconds at five packets a second."""
_SPREAD = 3.0
"""Mean deviations above the mean that cover 19 of 20 delays, be they spread evenly or exponentially."""
_UNSEEN_S = 0.25
"""What delays may be spread over before any were seen; after n of them the least is within an n-th of it."""


class HostClock:
    """Maps device seconds to host UTC nanoseconds."""

    def __init__(self) -> None:
        self._least: int | None = None
        self._before: int | None = None
        """Least offset of the current window and of the one before."""
        self._since = 0
        self._arrivals = 0
        self._mean_s = 0.0
        self._deviation_s = 0.0
        """How far arrivals lie behind the least delay: mean, and mean deviation from it."""

    @property
    def uncertainty_s(self) -> float:
        """How far arrivals lie behind the least delay, 19 in 20 of them; more while few were seen."""
        return self._mean_s + _SPREAD * self._deviation_s + _UNSEEN_S / max(1, self._arrivals)

    def arrived(self, device_s: float, at_ns: int) -> None:
        """Take a packet whose newest sample has device time `device_s`, arrived at `at_ns`."""
        offset = at_ns - round(device_s * 1e9)
        if self._least is None:
            self._least, self._since = offset, at_ns
        elif not 0 <= at_ns - self._since <= WINDOW_NS:
            self._before, self._least, self._since = self._least, offset, at_ns
        else:
            self._least = min(self._least, offset)
        self._arrivals += 1
        behind_s, weight = (offset - self._offset()) / 1e9, max(_SMOOTHING, 1 / self._arrivals)
        self._deviation_s += weight * (abs(behind_s - self._mean_s) - self._deviation_s)
        self._mean_s += weight * (behind_s - self._mean_s)

    def at_ns(self, device_s: float) -> int:
        """Return host UTC, in nanoseconds, of device time `device_s`; 0 before the first packet."""
        if self._least is None:
            return 0
        return self._offset() + round(device_s * 1e9)

    def _offset(self) -> int:
        least = self._least or 0
        return least if self._before is None else min(least, self._before)

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data."""
        return dict(vars(self))

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state."""
        vars(self).update(state)
