"""Whether somebody walks, as the primary says it: its newest verdict, and when walks begin and end.

A verdict is of the motion up to a time a little before the newest sample, and a walk is certain only some steps after
its first. So a walk is told as begun where it was first called possible, and as over where it was last called one. The
same samples give the same walks, however they are cut into blocks, as long as no block holds two verdicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, TypeGuard

from service.events import Walked
from service.samples import Gait, Verdict

FRAME_S: Final = 1.0
"""Two verdicts further apart are not of frames that follow each other: there is a gap between them."""


class Walking:
    """The newest gait of the primary `counter`, which credits steps at most `latency_s` in retrospect."""

    def __init__(self, counter: str, latency_s: float) -> None:
        self.gait: Gait | None = None
        """None where the primary does not recognise walking, or cannot count."""
        self._counter, self._latency_s = counter, latency_s
        self._perhaps_s = 0.0
        """Since when it may be walking without a break."""

    def follow(self, gait: Gait | None, boot: int) -> list[Walked]:
        """Take what the primary says now; return what begins or ends with it."""
        before, self.gait = self.gait, gait
        if gait is not None:
            self._perhaps_s = self._since(before, gait)
        if _walks(gait) and not _walks(before):
            at_s = max(self._perhaps_s, gait.at_s - self._latency_s)
        elif _walks(before) and not _walks(gait):
            at_s = before.at_s
        else:
            return []
        return [Walked(counter=self._counter, boot=boot, at_s=at_s, begins=_walks(gait))]

    def snapshot(self) -> list[object]:
        """Return the state as plain data."""
        return [None if self.gait is None else list(self.gait), self._perhaps_s]

    def restore(self, state: Sequence[Any]) -> None:
        """Take over a snapshot's state."""
        gait, self._perhaps_s = state
        self.gait = None if gait is None else Gait(gait[0], Verdict(gait[1]), *gait[2:])

    def _since(self, before: Gait | None, gait: Gait) -> float:
        """Return since when it may be walking, if it is now."""
        if before is None or gait.at_s - before.at_s > FRAME_S:
            return gait.at_s
        return self._perhaps_s if before.verdict in {Verdict.PERHAPS, gait.verdict} else before.at_s


def _walks(gait: Gait | None) -> TypeGuard[Gait]:
    return gait is not None and gait.verdict is Verdict.WALKING
