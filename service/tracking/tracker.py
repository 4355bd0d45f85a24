"""The Tracker: a pure fold over a device's packets, in order of (boot, index), that gives events.

Intake, timebase and counters in one synchronous object without I/O or clocks: the same packets give the same steps at
the same device times, whether they come live, from a store or on another machine. Bad packets are counted and
skipped; samples seen before are dropped; samples that arrive late, behind newer ones, are counted as such. Who can
wait for them takes a BackfillTracker.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from service.events import Described, Event
from service.samples import Packet, RawBlock
from service.tracking.fitness import Stream
from service.tracking.fold import CounterFactory, Fold
from service.tracking.intake import Booted, Intake, Said
from service.tracking.readings import Readings
from service.tracking.tally import Tally
from service.wearables.contract import Wearable


class Tracker(Readings):
    """Counts one device's steps.

    `counters` makes each counter by name; `primary` names the one whose count is the device's `steps`.
    """

    def __init__(self, wearable: Wearable, counters: Mapping[str, CounterFactory], *, primary: str) -> None:
        self.tally = Tally()
        self._intake = Intake(wearable, self.tally)
        self._committed = Fold(counters, primary=primary, tally=self.tally)

    @property
    def steps_now(self) -> int:
        """The device's steps with what is pending; may fall."""
        return self._committed.steps_now

    @property
    def stream(self) -> Stream:
        """What is known of what the device sends."""
        return self._committed.stream

    def apply(self, packet: Packet) -> list[Event]:
        """Take one packet; return what it tells. Never raises for what a device sends."""
        events: list[Event] = []
        for item in self._intake.take(packet):
            if isinstance(item, RawBlock):
                events += self._count(item)
            elif isinstance(item, Booted):
                events += self._committed.begin_boot(item.boot)
            elif isinstance(item, Said):
                self._committed.describe(item.info)
                if item.is_change:
                    events.append(Described(info=self.info))
        return events

    def change_counters(self, counters: Mapping[str, CounterFactory], *, primary: str) -> list[Event]:
        """Go on with other counters, as Fold.change_counters."""
        return self._committed.change_counters(counters, primary=primary)

    def finish(self) -> list[Event]:
        """End the stream: decide what is still pending."""
        return self._committed.finish()

    def snapshot(self) -> dict[str, Any]:
        """Return the whole state as plain data."""
        return {
            **self._committed.snapshot(),
            "tally": dataclasses.asdict(self.tally),
            "intake": self._intake.snapshot(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state; SnapshotError where its counters are not ours."""
        fold = self._committed
        fold.restore(state)
        self._intake.restore(state["intake"], run=fold.run, boot=fold.boot, next_index=fold.next_index)
        for field in dataclasses.fields(Tally):
            setattr(self.tally, field.name, state["tally"][field.name])

    def _count(self, block: RawBlock) -> list[Event]:
        awaited = self._committed.next_index
        fresh = len(block) if awaited is None else min(len(block), block.index + len(block) - awaited)
        if fresh <= 0:
            self.tally.packets_duplicate += 1
            return []
        self.tally.samples += fresh
        self.tally.samples_saturated += sum(at >= len(block) - fresh for at in block.saturated)
        return self._committed.count(block)
