"""The one account of likely steps while two Trackers count: what was told, and is neither confirmed nor retracted.

The front tells steps as likely. One that it confirms behind a hole stays told, as sure, until the committed Tracker
confirms it or a settling takes it back. So each step is told, then retracted or confirmed, whoever says so.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable
from dataclasses import replace
from math import inf

from service.events import Event, StepCounted, Tentative


class Account:
    """Steps told as likely of the boot that is being committed, by device time."""

    def __init__(self, told: Iterable[Tentative] = ()) -> None:
        self._told = {event.at_s: event for event in told}
        self._sure: list[float] = []
        """Steps that the front has confirmed, in order."""
        self._committed_s = -inf
        """The last step that was confirmed for good."""
        self.added = 0
        self.removed = 0
        """Steps since the last correction that were counted and had not been told; that were sure and are none."""

        self.changed_from_s = inf
        """The first step that was removed."""

    def sure_after(self, at_s: float) -> int:
        """Return how many steps after `at_s` the front has confirmed."""
        return len(self._sure) - bisect_right(self._sure, at_s)

    def follow(self, event: Tentative) -> list[Event]:
        """Take what the front tells; return what is news."""
        at_s = event.at_s
        if event.retracted:
            return [event] if self._told.pop(at_s, None) else []
        if at_s in self._told or at_s <= self._committed_s:
            return []
        self._told[at_s] = event
        return [event]

    def assume(self, step: StepCounted) -> None:
        """Take a step of the primary's that the front confirms: it stays told."""
        if step.step.at_s > self._committed_s:
            insort(self._sure, step.step.at_s)

    def confirm(self, step: StepCounted) -> list[Event]:
        """Take a step of the primary's that is confirmed for good; return it, told before."""
        at_s = step.step.at_s
        self._committed_s = at_s
        if self._told.pop(at_s, None):
            return [step]
        self.added += 1
        return [as_told(step), step]

    def settle(self, likely: Iterable[Tentative], sure: Iterable[StepCounted]) -> list[Event]:
        """Go on from another front: retract what it does not say, tell what was not told."""
        certain = {step.step.at_s: step for step in sure}
        now = {event.at_s: event for event in likely}
        now |= {at_s: as_told(step) for at_s, step in certain.items()}
        events = self._retract(set(self._told) - now.keys())
        for at_s in sorted(now.keys() - self._told.keys()):
            self.added += at_s in certain
            self._told[at_s] = now[at_s]
            events.append(now[at_s])
        self._sure = sorted(certain)
        return events

    def retract(self) -> list[Event]:
        """Take back all that is open."""
        events = self._retract(set(self._told))
        self._sure = []
        return events

    def corrected(self) -> tuple[int, int]:
        """Return (removed, added) since the last call."""
        changed = self.removed, self.added
        self.removed = self.added = 0
        self.changed_from_s = inf
        return changed

    def _retract(self, times: set[float]) -> list[Event]:
        removed = times.intersection(self._sure)
        self.removed += len(removed)
        self.changed_from_s = min(self.changed_from_s, *removed, inf)
        return [replace(self._told.pop(at_s), interval_s=None, retracted=True) for at_s in sorted(times)]


def as_told(step: StepCounted) -> Tentative:
    """Return a step as it would have been told when it was likely."""
    return Tentative(
        counter=step.counter,
        boot=step.boot,
        at_s=step.step.at_s,
        strength=step.step.strength,
        interval_s=step.step.interval_s,
        passes=True,
        retracted=False,
        uncertainty_s=step.uncertainty_s,
        heading=step.heading,
    )
