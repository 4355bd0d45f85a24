"""Host time of a moment of device time: a label for people, never used for counting.

A packet arrives after its newest sample was taken, by a delay that is never negative and often small. So the smallest
(arrival − device time) seen within WINDOW_NS is the offset between the two clocks, up to the smallest delay.
"""

from __future__ import annotations

WINDOW_NS = 60_000_000_000
"""Offsets are looked at over one to two of these: ±200 ppm of drift move them by less than 25 ms."""
_SMOOTHING = 0.05
"""Weight of the newest arrival in the mean: the last four seconds at five packets a second."""


class HostClock:
    """Maps device seconds to host UTC nanoseconds."""

    def __init__(self) -> None:
        self._least: int | None = None
        self._before: int | None = None
        """Least offset of the current window and of the one before."""
        self._since = 0
        self.uncertainty_s = 0.0
        """How far arrivals lie behind the least delay, on average: the least delay itself may be off by so much."""

    def arrived(self, device_s: float, at_ns: int) -> None:
        """Take a packet whose newest sample has device time `device_s`, arrived at `at_ns`."""
        offset = at_ns - round(device_s * 1e9)
        if self._least is None:
            self._least, self._since = offset, at_ns
        elif not 0 <= at_ns - self._since <= WINDOW_NS:
            self._before, self._least, self._since = self._least, offset, at_ns
        else:
            self._least = min(self._least, offset)
        self.uncertainty_s += _SMOOTHING * ((offset - self._least) / 1e9 - self.uncertainty_s)

    def at_ns(self, device_s: float) -> int:
        """Return host UTC, in nanoseconds, of device time `device_s`; 0 before the first packet."""
        if self._least is None:
            return 0
        offset = self._least if self._before is None else min(self._least, self._before)
        return offset + round(device_s * 1e9)
