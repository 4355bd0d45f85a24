"""What a device is asked to send again: the oldest hole worth asking for, one request at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from service.samples import Reply
from service.tracking.doubt import INDEX_SPAN, index_ahead
from service.tracking.kept import Kept

PIECE_SAMPLES: Final = 3000
"""Most that is asked for at once: a minute, so that progress is committed as it comes."""
BRIDGE_SAMPLES: Final = 128
"""So much that is there already is rather sent again than parting a request in two."""
TRIES: Final = 3
"""What was sent so often and did not arrive is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """Samples to ask a device for: its boot, the first index (u32) and how many."""

    boot: int
    first: int
    samples: int


class Requests:
    """The request that is under way, if one is. Indices inside are unwrapped."""

    def __init__(self) -> None:
        self.asked: Missing | None = None
        self._first = 0

    def choose(self, kept: Kept, settled: float) -> Missing | None:
        """Return what to ask for: from the oldest hole that was seen before `settled` packets had come on."""
        first = end = None
        for hole in kept.holes:
            if first is None or end is None:
                if hole.span.since < settled:
                    first, end = hole.first, hole.end
            elif hole.first - end <= BRIDGE_SAMPLES and hole.span.since < settled:
                end = hole.end
            else:
                break
        if first is None or end is None:
            return None
        return Missing(boot=kept.boot, first=first % INDEX_SPAN, samples=min(PIECE_SAMPLES, end - first))

    def begin(self, missing: Missing, kept: Kept) -> None:
        """Take note that a device was asked."""
        self.asked = missing
        self._first = kept.next_index + index_ahead(missing.first, kept.next_index % INDEX_SPAN)

    def protected(self) -> tuple[int, int]:
        """Return the range that is under way, an empty one where there is none."""
        return (self._first, self._first + self.asked.samples) if self.asked else (0, 0)

    def end(self) -> None:
        """Forget the request: it was answered, or it will not be."""
        self.asked = None

    def answered(self, reply: Reply, kept: Kept) -> list[tuple[int, int]]:
        """Take a device's answer; return the ranges that are lost with it."""
        asked = self.asked
        if asked is None or reply.request != "history":
            return []
        if reply.accepted and reply.boot != asked.boot:
            return []
        first, end = self.protected()
        self.asked = None
        if asked.boot != kept.boot:
            return []
        if not reply.accepted:
            return self._tried(kept, first, end)
        sent = first + index_ahead(reply.first, asked.first)
        has = (max(first, sent), min(end, sent + reply.samples)) if reply.samples else (end, end)
        if has[0] >= has[1]:
            return [(first, end)]
        return [(first, has[0]), *self._tried(kept, *has), (has[1], end)]

    def _tried(self, kept: Kept, first: int, end: int) -> list[tuple[int, int]]:
        """Count a try of every hole in the range; return those that were tried often enough."""
        lost = []
        for hole in kept.holes.within(first, end):
            hole.tries += 1
            if hole.tries >= TRIES:
                lost.append((max(first, hole.first), min(end, hole.end)))
        return lost
