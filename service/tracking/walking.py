"""Whether somebody walks, as the primary says it: its newest verdict, and when walks begin and end.

The verdict is as of a time a little before the newest sample, and a walk is certain only some steps after its first. So
a walk is told as begun where it was first called possible, and as over where it was first called none. The same
samples give the same walks, however they are cut into blocks, as long as no block holds two verdicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from service.samples import Gait, Verdict, Walked


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
        if gait is not None and (before is None or before.verdict not in {Verdict.PERHAPS, gait.verdict}):
            self._perhaps_s = gait.at_s
        walked, walks = (one is not None and one.verdict is Verdict.WALKING for one in (before, gait))
        last = gait or before
        if last is None or walks == walked:
            return []
        at_s = max(self._perhaps_s, last.at_s - self._latency_s) if walks else last.at_s
        return [Walked(counter=self._counter, boot=boot, at_s=at_s, begins=walks)]

    def snapshot(self) -> list[object]:
        """Return the state as plain data."""
        return [None if self.gait is None else list(self.gait), self._perhaps_s]

    def restore(self, state: Sequence[Any]) -> None:
        """Take over a snapshot's state."""
        gait, self._perhaps_s = state
        self.gait = None if gait is None else Gait(gait[0], Verdict(gait[1]), *gait[2:])
