"""Likely steps as they come and go: told at once, taken back where the counter thinks better of it."""

from __future__ import annotations

from collections.abc import Sequence

from service.samples import Step, Tentative

_LONGEST_S = 2.0
"""A longer time since the step before is a pause, not an interval."""


class TentativeSteps:
    """What a counter calls likely, from block to block, as events."""

    def __init__(self) -> None:
        self._open: dict[float, float] = {}
        """Strength of each likely step told and neither confirmed nor retracted, by device time."""
        self._last_s: float | None = None

    def follow(self, boot: int, likely: Sequence[tuple[float, float]], confirmed: Sequence[Step]) -> list[Tentative]:
        """Return the events that lead from what was told to `likely`, steps `confirmed` meanwhile being no loss."""
        if not likely and not self._open:
            return []
        known, now = self._open, dict(likely)
        certain = {step.at_s for step in confirmed}
        events = [
            Tentative(boot=boot, at_s=at_s, strength=strength, interval_s=None, retracted=True)
            for at_s, strength in known.items()
            if at_s not in now and at_s not in certain
        ]
        for at_s in sorted(now.keys() - known.keys()):
            interval_s = self._interval_s(at_s)
            events.append(Tentative(boot=boot, at_s=at_s, strength=now[at_s], interval_s=interval_s, retracted=False))
            self._last_s = at_s
        self._open = now
        return events

    def snapshot(self) -> list[object]:
        """Return the state as plain data."""
        return [list(map(list, self._open.items())), self._last_s]

    def restore(self, state: list[list[list[float]] | float | None]) -> None:
        """Take over a snapshot's state."""
        told, last_s = state
        self._open = {entry[0]: entry[1] for entry in told} if isinstance(told, list) else {}
        self._last_s = last_s if isinstance(last_s, float) else None

    def _interval_s(self, at_s: float) -> float | None:
        since_s = None if self._last_s is None else at_s - self._last_s
        return since_s if since_s is not None and 0 < since_s <= _LONGEST_S else None
