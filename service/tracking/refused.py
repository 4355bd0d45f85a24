"""What the primary refused and why: steps of counters beside it that it did not count, by what it made of the motion.

The primary credits a walk's first steps in retrospect. So another counter's step waits until all of the primary's near
it are certain, which is `latency_s` later. Then it is refused if the primary has none within NEAR_S of it and did not
call the motion walking; one that differs by a few steps inside a walk has not been refused. Nothing here depends on how
samples were cut into blocks.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from operator import itemgetter
from typing import Any, Final

from service.samples import Gait, Verdict
from service.tracking.walking import FRAME_S

NEAR_S: Final = 1.0
"""Two counters put the same step at most so far apart: a slow stride, of which one may see the other foot."""
KEPT_S: Final = 60.0
"""What the primary said is kept so long: no counter confirms a step later than some ten seconds."""
WHY: Final = (Verdict.REST, Verdict.OTHER, Verdict.PERHAPS)
"""Verdicts by which steps are refused."""


class Refused:
    """Counts what a primary, which credits at most `latency_s` in retrospect, refuses; nothing where it has no verdict.

    `counts` has the counters of which a step was refused, each with a number by verdict.
    """

    def __init__(self, latency_s: float) -> None:
        self.counts: dict[str, dict[Verdict, int]] = {}
        self._wait_s = latency_s + NEAR_S
        self._waiting: list[tuple[float, str]] = []
        """Steps of other counters that are not judged yet, in order: their time and counter."""
        self._own: deque[float] = deque()
        """Times of the primary's steps."""
        self._runs: deque[tuple[float, Verdict]] = deque()
        """From when on which verdict stood."""
        self._decided_s = 0.0
        """Until when the newest does."""

    def say(self, gait: Gait | None) -> None:
        """Take the primary's newest verdict; None: it has none, and what waits is nobody's to judge."""
        if gait is None:
            self._forget()
            return
        follows = bool(self._runs) and gait.at_s - self._decided_s <= FRAME_S
        if not follows or self._runs[-1][1] is not gait.verdict:
            self._runs.append((self._decided_s if follows else gait.at_s, gait.verdict))
        self._decided_s = gait.at_s

    def count(self, at_s: float) -> None:
        """Take a step of the primary's."""
        if self._runs:
            self._own.append(at_s)

    def count_beside(self, counter: str, at_s: float) -> None:
        """Take another counter's step."""
        if self._runs:
            insort(self._waiting, (at_s, counter))

    def settle(self) -> None:
        """Judge what is certain by now: called after a block, when every counter has counted it."""
        if not self._runs:
            return
        certain = bisect_right(self._waiting, self._decided_s - self._wait_s, key=itemgetter(0))
        if certain:
            self._judge(self._waiting[:certain])
            del self._waiting[:certain]
        kept_s = self._decided_s - KEPT_S
        while self._own and self._own[0] < kept_s:
            self._own.popleft()
        while len(self._runs) > 1 and self._runs[1][0] < kept_s:
            self._runs.popleft()

    def end(self) -> None:
        """Judge all that waits, since nothing more comes: the boot or the stream is over."""
        self._judge(self._waiting)
        self._forget()

    def keep(self, counters: Collection[str]) -> None:
        """Go on with these counters beside the primary; what others counted is forgotten."""
        self.counts = {name: count for name, count in self.counts.items() if name in counters}
        self._waiting = [one for one in self._waiting if one[1] in counters]

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data."""
        return {
            "counts": {name: dict(count) for name, count in self.counts.items()},
            "waiting": [list(one) for one in self._waiting],
            "own": list(self._own),
            "runs": [list(run) for run in self._runs],
            "decided_s": self._decided_s,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state."""
        self.counts = {name: {why: count[why] for why in WHY} for name, count in state["counts"].items()}
        self._waiting = [(at_s, name) for at_s, name in state["waiting"]]
        self._own = deque(state["own"])
        self._runs = deque((from_s, Verdict(verdict)) for from_s, verdict in state["runs"])
        self._decided_s = state["decided_s"]

    def _judge(self, steps: Sequence[tuple[float, str]]) -> None:
        for at_s, counter in steps:
            verdict = self._verdict(at_s)
            if verdict in WHY and not any(abs(own_s - at_s) <= NEAR_S for own_s in self._own):
                self.counts.setdefault(counter, dict.fromkeys(WHY, 0))[verdict] += 1

    def _verdict(self, at_s: float) -> Verdict:
        """Return what the primary made of the motion at `at_s`; of what it did not come to before a gap, its last."""
        return next((verdict for from_s, verdict in reversed(self._runs) if from_s < at_s), self._runs[0][1])

    def _forget(self) -> None:
        self._waiting = []
        self._own.clear()
        self._runs.clear()
        self._decided_s = 0.0
