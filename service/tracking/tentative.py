"""Likely steps as they come and go: told at once, taken back where the counter thinks better of it.

For each step the same order holds, whatever the packets: told as likely, then either retracted or confirmed. One that
is confirmed in the packet in which it is first seen is told just before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any

from service.events import Tentative
from service.samples import Likely, Step

_LONGEST_S = 2.0
"""A longer time since the step before is a pause, not an interval."""


class TentativeSteps:
    """What a counter calls likely, from block to block, as events."""

    def __init__(self) -> None:
        self._open: dict[float, Tentative] = {}
        """What was told and neither confirmed nor retracted, by device time."""
        self._confirmed_s: float | None = None

    @property
    def open(self) -> dict[float, Tentative]:
        """What was told and neither confirmed nor retracted, by device time."""
        return self._open

    def follow(self, counter: str, boot: int, likely: Sequence[Likely], confirmed: Sequence[Step]) -> list[Tentative]:
        """Return the events that lead from what was told to `counter`'s `likely` and to its steps `confirmed` now."""
        if not likely and not self._open and not confirmed:
            return []
        certain = {step.at_s for step in confirmed}
        now = {at_s: (strength, passes) for at_s, strength, passes in likely if at_s not in certain}
        told = self._open
        self._open = {at_s: event for at_s, event in told.items() if at_s in now}
        events = [
            replace(event, interval_s=None, retracted=True)
            for at_s, event in told.items()
            if at_s not in now and at_s not in certain
        ]
        for step in confirmed:
            if step.at_s not in told:
                events.append(self._tell(counter, boot, step.at_s, step.strength, passes=True))
            self._confirmed_s = step.at_s
        for at_s in sorted(now.keys() - told.keys()):
            strength, passes = now[at_s]
            self._open[at_s] = self._tell(counter, boot, at_s, strength, passes=passes)
            events.append(self._open[at_s])
        return events

    def snapshot(self) -> list[object]:
        """Return the state as plain data."""
        told = [[event.counter, event.boot, at_s, event.strength, event.passes] for at_s, event in self._open.items()]
        return [told, self._confirmed_s]

    def restore(self, state: Sequence[Any]) -> None:
        """Take over a snapshot's state."""
        told, self._confirmed_s = state
        self._open = {entry[2]: _event(*entry) for entry in told}

    def _tell(self, counter: str, boot: int, at_s: float, strength: float, *, passes: bool) -> Tentative:
        return replace(_event(counter, boot, at_s, strength, passes), interval_s=self._interval_s(at_s))

    def _interval_s(self, at_s: float) -> float | None:
        sure = [event.at_s for event in self._open.values() if event.passes and event.at_s < at_s]
        if self._confirmed_s is not None and self._confirmed_s < at_s:
            sure.append(self._confirmed_s)
        since_s = at_s - max(sure, default=-inf)
        return since_s if since_s <= _LONGEST_S else None


def _event(counter: str, boot: int, at_s: float, strength: float, passes: bool) -> Tentative:
    return Tentative(
        counter=counter, boot=boot, at_s=at_s, strength=strength, interval_s=None, passes=passes, retracted=False
    )
