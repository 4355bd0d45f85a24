"""The line below a stream of delays: the least of each slice of time, and the lower hull's edge under them all.

Delays are never negative, so what is seen of two clocks lies on or above the line by which they drift apart, and the
best guess of that line is the one below all points that lies closest to them: the edge of their lower convex hull over
their mean time (Moon, Skelly, Towsley 1999, "Estimation and removal of clock skew from network delay measurements").
Memory and work are bounded: SLICES slices, which double in length when they are full and then move on.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

Low = tuple[float, float]
"""A time and how far what arrived then lay behind it, both in seconds."""

SLICES = 64
FIRST_S, LAST_S = 1.0, 64.0
"""A slice's length at first, and at most: the line is drawn under up to 68 minutes."""
LEAST_SLICES = 8
"""Under fewer no line is drawn."""
_WANDERS_S = 0.01
"""The smallest delay itself wanders by so much, unseen: the phase between a device's packets and its radio's slots."""


class Lows:
    """The least delays of the newest slices of time."""

    def __init__(self) -> None:
        self._length_s = FIRST_S
        self._lows: list[Low] = []

    @property
    def newest_s(self) -> float:
        """Time of the newest slice's least delay."""
        return self._lows[-1][0] if self._lows else 0.0

    def add(self, low: Low, slope: float) -> bool:
        """Take a point; return whether a slice is complete by that. Points are compared along `slope`."""
        if not self._lows:
            self._lows.append(low)
            return False
        newest = self._lows[-1]
        if low[0] // self._length_s <= newest[0] // self._length_s:
            self._lows[-1] = _lower(newest, low, slope)
            return False
        self._lows.append(low)
        if len(self._lows) > SLICES:
            self._make_room(slope)
        return True

    def since(self, s: float) -> Sequence[Low]:
        """Return the points from time `s` on."""
        return [low for low in self._lows if low[0] >= s]

    def line(self) -> tuple[float, float] | None:
        """Return the slope of the line below the complete slices and how well it is known (19 in 20); None if too few.

        How well: were twice the height that the nearer half of the points has above the line, and what the smallest
        delay wanders, all due to its slope, over the points' span.
        """
        lows = self._lows[:-1]
        if len(lows) < LEAST_SLICES:
            return None
        (x0, y0), (x1, y1) = _edge_over(sum(x for x, _ in lows) / len(lows), _lower_hull(lows))
        slope = (y1 - y0) / (x1 - x0)
        nearer = sorted(y - y0 - slope * (x - x0) for x, y in lows)[: len(lows) // 2]
        return slope, (2 * sum(nearer) / len(nearer) + _WANDERS_S) / (lows[-1][0] - lows[0][0])

    def _make_room(self, slope: float) -> None:
        if self._length_s >= LAST_S:
            del self._lows[0]
            return
        self._length_s *= 2
        joined = self._lows[:1]
        for low in self._lows[1:]:
            if low[0] // self._length_s == joined[-1][0] // self._length_s:
                joined[-1] = _lower(joined[-1], low, slope)
            else:
                joined.append(low)
        self._lows = joined


def _lower(one: Low, other: Low, slope: float) -> Low:
    """Return the one of two points that lies lower along `slope`."""
    return other if other[1] - one[1] < slope * (other[0] - one[0]) else one


def _lower_hull(lows: Sequence[Low]) -> list[Low]:
    """Return the lower convex hull of points in order of time (Andrew's monotone chain)."""
    hull: list[Low] = []
    for x, y in lows:
        while len(hull) > 1:
            (x0, y0), (x1, y1) = hull[-2:]
            if (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0):
                break
            hull.pop()
        hull.append((x, y))
    return hull


def _edge_over(x: float, hull: Sequence[Low]) -> tuple[Low, Low]:
    """Return the hull's edge over `x`, which lies within it."""
    for left, right in pairwise(hull):
        if right[0] >= x:
            return left, right
    return hull[-2], hull[-1]
