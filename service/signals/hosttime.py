"""Host time of a moment of device time: a label for people, never used for counting.

A packet arrives after its newest sample was taken, by a delay that is never negative and often small. So the least
(arrival − device time) is the offset between the two clocks, up to the smallest delay, and the line below all of them
is how the clocks drift apart. Its slope is taken from up to 68 minutes, its height from the last two: clocks change
with temperature. No drift of more than DRIFT_PRIOR is believed, nor one told, before the delays leave no other.

A host clock that is set back is followed at once, one set forward after JUMP_AFTER_S and JUMP_PACKETS (within twice
LEVEL_S if by less than JUMP_S or than delays are spread over). A host that sleeps, and packets that come late for it,
change nothing.

The smallest delay, constant as long as the link is, cannot be seen from one side: host times are late by it, and
`uncertainty_s` does not hold it (over Bluetooth some milliseconds of radio, and what a device waits between measuring
and sending).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from service.signals.lows import Low, Lows

JUMP_S = 0.5
"""No packet arrives so far below the line, and only behind a clock that was set do all arrive so far above it."""
JUMP_AFTER_S = 10.0
JUMP_PACKETS = 20
"""For so long and so many: a backlog is over before, and delays of a second's mean hardly ever do that by chance."""
LEVEL_S = 120.0
"""Age of the oldest packet that tells how high the line lies."""
KNOWN_PPM = 50.0
"""A drift that is less well known is not told."""
STEEPEST = 0.03
"""No device's clock is further off: not even one that only counts its samples."""
DRIFT_PRIOR = 200e-6
"""What clocks drift apart at most where nothing was seen yet: a poor crystal, or a good one in the cold."""

_SMOOTHING = 0.05
"""Weight of the newest arrival in the means: the last four seconds at five packets a second."""
_SPREAD = 3.0
"""Mean deviations above the mean that cover 19 of 20 delays, be they spread evenly or exponentially."""
_LATEST_S = 10.0
"""What is later counts as so late in the means, so that one packet does not spoil them for a minute."""
_UNSEEN_S = 0.25
"""What delays may be spread over before any were seen; after n of them the least is within an n-th of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """By how much a device's clock is faster than the host's, and how well that is known (19 in 20)."""

    ppm: float
    uncertainty_ppm: float


class HostClock:
    """Maps device seconds of one boot to host UTC nanoseconds."""

    def __init__(self) -> None:
        self._origin: tuple[float, int] | None = None
        """Device and host time of the first arrival since the host's clock was set: where the line is 0 at no delay."""
        self._before = self._slope, self._slope_within = 0.0, DRIFT_PRIOR
        """Host seconds that go by in a device second, beyond one, and how well that is known; and before the origin."""
        self._height_s = 0.0
        self._height_within_s = 0.0
        """The line's height above the origin, and what drift since the packet that told it may have added."""
        self._lows = Lows()
        self._late: tuple[float, int, int, Low] | None = None
        """Late arrivals in a row: how far behind the line is late, host time of the first, how many, the least late."""
        self._arrivals = 0
        self._mean_s = 0.0
        self._deviation_s = 0.0
        """How far arrivals lie behind the line: mean, and mean deviation from it."""
        self._resumed = False

    @property
    def uncertainty_s(self) -> float:
        """How far arrivals lie behind the line, 19 in 20 of them, and how far clocks drift since it was known.

        More while few were seen, and while it is open whether the host's clock was set.
        """
        unseen_s = _UNSEEN_S / max(1, self._arrivals)
        set_s = self._behind_s(self._late[-1]) if self._late else 0.0
        return max(self._spread_s + unseen_s + self._height_within_s, set_s)

    @property
    def drift(self) -> Drift | None:
        """How the device's clock drifts against the host's; None until that is known to KNOWN_PPM."""
        if self._slope_within > KNOWN_PPM * 1e-6:
            return None
        return Drift(ppm=-self._slope / (1 + self._slope) * 1e6, uncertainty_ppm=self._slope_within * 1e6)

    def arrived(self, device_s: float, at_ns: int) -> None:
        """Take a packet whose newest sample has device time `device_s`, arrived at `at_ns`."""
        if self._origin is None or self._resumed:
            self._begin(device_s, at_ns)
        low = self._seen(device_s, at_ns)
        behind_s = self._behind_s(low)
        late_s = max(JUMP_S, self._spread_s) + self._slope_within * max(0.0, low[0] - self._lows.newest_s)
        if behind_s < -late_s:
            self._begin(device_s, at_ns)
        elif behind_s > (self._late[0] if self._late else late_s):
            self._doubt(low, at_ns, late_s)
        else:
            self._late = None
            self._follow(low, behind_s)
        self._take_spread(self._behind_s(self._seen(device_s, at_ns)))

    def at_ns(self, device_s: float) -> int:
        """Return host UTC, in nanoseconds, of device time `device_s`; 0 before the first packet."""
        if self._origin is None:
            return 0
        origin_s, origin_ns = self._origin
        x = device_s - origin_s
        return origin_ns + round((x + self._height_s + self._slope * x) * 1e9)

    def snapshot(self) -> dict[str, Any]:
        """Return as plain data how device seconds map to host time, and the drift."""
        origin = list(self._origin) if self._origin else None
        return {"origin": origin, "height_s": self._height_s, "slope": [self._slope, self._slope_within]}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Map as the clock of `state` did until the next arrival; from then on keep only its drift.

        The host's clock may have been set, or be another host's.
        """
        self._forget()
        self._origin = (state["origin"][0], state["origin"][1]) if state["origin"] else None
        self._height_s = state["height_s"]
        self._slope, self._slope_within = state["slope"]
        self._resumed = True

    @property
    def _spread_s(self) -> float:
        return self._mean_s + _SPREAD * self._deviation_s

    def _seen(self, device_s: float, at_ns: int) -> Low:
        """Return an arrival as a point: seconds after the origin, and how far host time has gone beyond them."""
        origin_s, origin_ns = self._origin or (device_s, at_ns)
        x = device_s - origin_s
        return x, (at_ns - origin_ns) / 1e9 - x

    def _behind_s(self, low: Low) -> float:
        return low[1] - self._height_s - self._slope * low[0]

    def _begin(self, device_s: float, at_ns: int) -> None:
        """Forget all but the drift: the host's clock is another, and this packet's delay is the least of it so far."""
        self._forget()
        self._origin = (device_s, at_ns)
        if self._slope_within > DRIFT_PRIOR:
            self._slope, self._slope_within = 0.0, DRIFT_PRIOR
        self._before = self._slope, self._slope_within
        self._lows.add((0.0, 0.0), self._slope)

    def _forget(self) -> None:
        """Forget every arrival."""
        self._lows, self._late, self._resumed = Lows(), None, False
        self._height_s, self._height_within_s = 0.0, 0.0
        self._arrivals, self._mean_s, self._deviation_s = 0, 0.0, 0.0

    def _doubt(self, low: Low, at_ns: int, late_s: float) -> None:
        """Take a late arrival; where they were late for long enough, the host's clock has been set forward."""
        late_s, first_ns, count, least = self._late or (late_s, at_ns, 0, low)
        if self._behind_s(low) < self._behind_s(least):
            least = low
        self._late = (late_s, first_ns, count + 1, least)
        if count + 1 >= JUMP_PACKETS and at_ns - first_ns >= JUMP_AFTER_S * 1e9:
            origin_s, origin_ns = self._origin or (0.0, 0)
            self._begin(origin_s + least[0], origin_ns + round((least[0] + least[1]) * 1e9))

    def _follow(self, low: Low, behind_s: float) -> None:
        """Move the line below an arrival; draw it anew where a slice of time is complete."""
        if self._lows.add(low, self._slope):
            self._draw(low[0])
        elif behind_s < 0.0:
            self._height_s += behind_s
            self._height_within_s = 0.0

    def _draw(self, now: float) -> None:
        """Draw the line below what arrived up to `now`; its slope is the one before until disproved or bettered."""
        self._slope, self._slope_within = before, before_within = self._before
        line = self._lows.line()
        if line is not None:
            slope, within = min(max(line[0], -STEEPEST), STEEPEST), line[1]
            if within < before_within or abs(slope - before) > within + before_within:
                self._slope, self._slope_within = slope, within
        heights = ((y - self._slope * x, self._slope_within * (now - x)) for x, y in self._lows.since(now - LEVEL_S))
        self._height_s, self._height_within_s = min(heights, key=lambda height: height[0] + 2 * height[1])

    def _take_spread(self, behind_s: float) -> None:
        behind_s = min(max(behind_s, 0.0), _LATEST_S)
        self._arrivals += 1
        weight = max(_SMOOTHING, 1 / self._arrivals)
        self._deviation_s += weight * (abs(behind_s - self._mean_s) - self._deviation_s)
        self._mean_s += weight * (behind_s - self._mean_s)
