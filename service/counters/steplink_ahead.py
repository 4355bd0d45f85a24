"""The steps of a certain walk that the network has not judged yet: the crests where the next ones are expected.

Asked once a packet, so it is there twice: `likely` looks through lists by slices, which is what plain Python does
fast, and `scan_likely` is the same as a scalar kernel. The last crest may still grow, and is told once the magnitude
falls from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor
from typing import Final

from service.counters.steplink_bouts import (
    CADENCE,
    DECIDED,
    FIRST,
    FOLLOW,
    LAST,
    LENGTH,
    NEAREST,
    NEXT,
    OFFSET,
    PART,
    RING,
    SIZE_G,
    WALKING,
    State,
)
from service.samples import GRID_HZ

CREST_SHARE: Final = 0.35
"""A crest this high, beside those before it, is told before the network has judged it."""

ROW: Final = 2
"""Index of the crest, how high it is over the valley before."""


def likely(s: Sequence[float]) -> list[tuple[float, float]]:
    """Return the crests' rows."""
    found: list[tuple[float, float]] = []
    if s[WALKING] <= 0.0 or s[NEXT] < 0.0:
        return found
    period, seen, last, offset = GRID_HZ / s[CADENCE], int(s[NEXT]), int(s[LAST]), s[OFFSET]
    due = s[DECIDED] + (1.0 - s[PART]) * period
    base = max(int(s[FIRST]), last, seen - LENGTH + 1, 0)
    recent = _recent(s, base, seen)
    least = CREST_SHARE * s[SIZE_G]
    while due < seen:
        centre = due + offset * period
        from_ = _from(due, centre, period, base, last)
        part = recent[from_ - base : max(int(centre + 0.5 * period) + 1 - base, 0)]
        if not part:
            break
        height = max(part)
        at = from_ + part.index(height)
        strength = height - min(recent[max(last, at - int(period), base) - base : at - base + 1])
        if strength >= least and height - min(recent[at - base :]) >= least:
            found.append((float(at), strength))
            last, offset = at, _followed(offset, at, due, period)
        due += period
    return found


def scan_likely(s: State, out: State) -> int:
    """Write the crests' rows to `out`; return where they end."""
    rows = 0
    if s[WALKING] <= 0.0 or s[NEXT] < 0.0:
        return rows
    period, seen, last, offset = GRID_HZ / s[CADENCE], int(s[NEXT]), int(s[LAST]), s[OFFSET]
    due = s[DECIDED] + (1.0 - s[PART]) * period
    base = max(int(s[FIRST]), last, seen - LENGTH + 1, 0)
    least = CREST_SHARE * s[SIZE_G]
    while due < seen:
        centre = due + offset * period
        at = _from(due, centre, period, base, last)
        to = min(int(centre + 0.5 * period) + 1, seen)
        if at >= to:
            break
        for i in range(at + 1, to):
            if s[RING + i % LENGTH] > s[RING + at % LENGTH]:
                at = i
        height = s[RING + at % LENGTH]
        strength = height - _least(s, max(last, at - int(period), base), at + 1)
        if strength >= least and height - _least(s, at, seen) >= least:
            out[rows], out[rows + 1] = float(at), strength
            rows += ROW
            last, offset = at, _followed(offset, at, due, period)
        due += period
    return rows


def _from(due: float, centre: float, period: float, base: int, last: int) -> int:
    """Return where the crest of the step due at `due` may lie at the earliest."""
    from_ = max(ceil(max(due, centre - 0.5 * period)), base + 2)
    return max(from_, last + 1 + int(NEAREST * period)) if last >= 0 else from_


def _followed(offset: float, at: int, due: float, period: float) -> float:
    offset += FOLLOW * ((at - due) / period - offset)
    return offset - floor(offset)


def _least(s: State, from_: int, to: int) -> float:
    low = s[RING + from_ % LENGTH]
    for i in range(from_ + 1, to):
        value = s[RING + i % LENGTH]
        low = min(low, value)
    return low


def _recent(s: Sequence[float], from_: int, to: int) -> Sequence[float]:
    """Return the magnitudes from index `from_` up to `to`."""
    a, b = RING + from_ % LENGTH, RING + to % LENGTH
    return s[a:b] if a < b else [*s[a : RING + LENGTH], *s[RING:b]]
