"""What did not arrive: holes in a run's numbered samples, while they may still be filled.

A Span is a hole as it was first seen; late samples narrow it and cut it into Holes, and it is over when none is left.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field


@dataclass(slots=True, kw_only=True, eq=False)
class Span:
    """Samples [first, end) that were passed over. `since` is how many packets had come behind holes before it was seen.

    From `from_s` to `to_s` lies the hole on the grid as far as it was counted with it.
    """

    first: int
    end: int
    since: float
    from_s: float
    to_s: float
    holes: int = 1
    """How many holes are left of it."""
    came: bool = False
    """Whether some of it came late."""
    is_told: bool = False
    """Whether Awaited was told and its end was not."""


@dataclass(slots=True, kw_only=True)
class Hole:
    """Samples [first, end) that are missing now; `tries` counts the requests that were answered in vain."""

    first: int
    end: int
    span: Span = field(repr=False)
    tries: int = 0


class Holes:
    """Open holes of one run, in order."""

    def __init__(self) -> None:
        self._open: list[Hole] = []
        self.spans: list[Span] = []
        """Those with open holes, and those that were told and are over; in order."""

    def __bool__(self) -> bool:
        return bool(self._open)

    def __iter__(self) -> Iterator[Hole]:
        return iter(self._open)

    @property
    def first(self) -> int:
        """Index of the first missing sample; there is one."""
        return self._open[0].first

    @property
    def samples(self) -> int:
        """How many are missing."""
        return sum(hole.end - hole.first for hole in self._open)

    def add(self, span: Span) -> None:
        """Take a new hole behind all others."""
        self.spans.append(span)
        self._open.append(Hole(first=span.first, end=span.end, span=span))

    def within(self, start: int, end: int) -> list[Hole]:
        """Return the holes that hold a sample of [start, end)."""
        at = max(0, bisect_right(self._open, start, key=lambda hole: hole.first) - 1)
        found = []
        for hole in self._open[at:]:
            if hole.first >= end:
                break
            if hole.end > start:
                found.append(hole)
        return found

    def fill(self, start: int, end: int) -> bool:
        """Take the samples [start, end) as there; return whether a span is over with that."""
        return self._remove(start, end, filled=True)

    def lose(self, start: int, end: int) -> bool:
        """Wait for the samples [start, end) no longer; return whether a span of which some came is over with that."""
        return self._remove(start, end, filled=False)

    def forget_over(self) -> None:
        """Forget the spans that are over: their end was told."""
        self.spans = [span for span in self.spans if span.holes]

    def _remove(self, start: int, end: int, *, filled: bool) -> bool:
        over = came = False
        for hole in self.within(start, end):
            left = [
                Hole(first=first, end=last, span=hole.span, tries=hole.tries)
                for first, last in ((hole.first, min(start, hole.end)), (max(end, hole.first), hole.end))
                if first < last
            ]
            at = self._open.index(hole)
            self._open[at : at + 1] = left
            hole.span.holes += len(left) - 1
            hole.span.came |= filled
            over |= hole.span.holes == 0
            came |= hole.span.holes == 0 and hole.span.came
        if over:
            self.spans = [span for span in self.spans if span.holes or span.is_told]
        return came
