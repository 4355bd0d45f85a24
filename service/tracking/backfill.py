"""The Tracker that waits: what arrives late, reordered or from a device's history is counted where it belongs.

The *committed* Tracker stands at the first sample that is neither there nor declared lost. What came behind it is kept,
and the *front*, forked from the committed one, has counted that too, holes as gaps: what it says is tentative. Where
nothing is missing both are one and a packet costs what it costs a Tracker. `apply` counts a packet at the front only;
counting again is `catch_up`'s, in small slices, as long as it `has_work`.

- Told from the committed Tracker: StepCounted, Gap, Rebooted, Segmented, Gridded; each once, in order. From the front:
  Tentative, Signal and Counting, where `steps` is the committed count and `steps_now` holds all that is likely.
- A hole is lost when the device says that it does not have it any more or has sent it TRIES times in vain; when it is
  older than AWAIT_S or than what the device keeps; if it keeps nothing, when more than REORDERING packets have come
  behind it; and when the device starts again. What is behind it is then counted before the new boot's first sample.
- A boot after the session's first begins at sample 0 if the device keeps history: what it measured before it was
  connected again is asked for.
- Changed counters take effect at the hole: what is behind it is counted with the new ones.
- A snapshot is of the committed Tracker. A store gives back what came since by `replay_block` and `replay_heard`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

from service.events import Described, Event, Heard, Received
from service.samples import DeviceInfo, Packet, RawBlock, Reply
from service.tracking.awaiting import awaited
from service.tracking.behind import SLICE_SAMPLES, Behind
from service.tracking.cutting import cut
from service.tracking.doubt import REORDERING
from service.tracking.fitness import Stream
from service.tracking.fold import CounterFactory, Fold
from service.tracking.intake import Booted, Intake, Said
from service.tracking.kept import Kept
from service.tracking.readings import Readings
from service.tracking.requests import Missing, Requests
from service.tracking.tally import Tally
from service.wearables.contract import Wearable

AWAIT_S: Final = 900.0
"""Device time after which what is missing is lost."""
LATE_S: Final = 10.0
"""A live packet older than this fills no hole: its index is rather broken."""


class BackfillTracker(Readings):
    """Counts one device's steps, as a Tracker; nothing that can still come is counted without it."""

    def __init__(self, wearable: Wearable, counters: Mapping[str, CounterFactory], *, primary: str) -> None:
        self.tally = Tally()
        self._intake = Intake(wearable, self.tally)
        self._committed = Fold(counters, primary=primary, tally=self.tally)
        self._behind = Behind(self._committed, self.tally)
        self._requests = Requests()

    @property
    def _front(self) -> Fold:
        return self._behind.front

    @property
    def steps_now(self) -> int:
        """The device's steps with all that is likely, behind a hole too; may fall."""
        return self._behind.steps_now

    @property
    def stream(self) -> Stream:
        """What is known of what the device sends."""
        return dataclasses.replace(self._front.stream, has=self.info.sensors)

    @property
    def cursor(self) -> tuple[int, int, int]:
        """(run, boot, index) of the sample that the committed count waits for."""
        committed = self._committed
        return committed.run, committed.boot or 0, committed.next_index or 0

    @property
    def has_work(self) -> bool:
        """Whether `catch_up` has something to do."""
        return self._behind.has_work

    @property
    def asked(self) -> Missing | None:
        """The request that is under way."""
        return self._requests.asked

    def apply(self, packet: Packet) -> list[Event]:
        """Take one packet, live, from history or a reply. Never raises for what a device sends."""
        events: list[Event] = []
        for item in self._intake.take(packet):
            if isinstance(item, RawBlock):
                events += self._receive(item)
            elif isinstance(item, Booted):
                events += self._boot(item)
            elif isinstance(item, Said):
                if item.is_new and _matters(item.info):
                    events.append(self._heard(packet))
                events += self._describe(item)
            else:
                self._answered(item)
        return events

    def catch_up(self, samples: int = SLICE_SAMPLES) -> list[Event]:
        """Count on what can be counted for good, or make the front anew: about so many samples of it."""
        events: list[Event] = []
        while samples > 0 and self.has_work:
            samples -= self._behind.work(events)
        if events:
            self._behind.tally_awaited()
            events.append(self._behind.counting())
        return events

    def wanted(self) -> Missing | None:
        """Return what to ask the device for now; None while a request is under way or nothing is worth one."""
        if not self._behind or not self._keeps or self._requests.asked:
            return None
        return self._requests.choose(self._behind.kept[-1], self._behind.passed - REORDERING)

    def ask(self, missing: Missing) -> None:
        """Take note that the device was asked; its Reply comes with the packets."""
        if self._behind:
            self._requests.begin(missing, self._behind.kept[-1])

    def unanswered(self) -> None:
        """Take note that no answer will come: the link is lost, or it took too long. It will be wanted again."""
        self._requests.end()

    def change_counters(self, counters: Mapping[str, CounterFactory], *, primary: str) -> list[Event]:
        """Go on with other counters, as Fold.change_counters; where a hole is open, from the hole on."""
        where = self._behind or self._committed
        return where.change_counters(counters, primary=primary)

    def finish(self) -> list[Event]:
        """End the stream: what is missing is lost; decide what is still pending."""
        for kept in self._behind.kept:
            kept.lose_all()
        events: list[Event] = []
        while self._behind:
            events += self.catch_up()
        return events + self._committed.finish()

    def snapshot(self) -> dict[str, Any]:
        """Return the committed state as plain data."""
        tally = dataclasses.asdict(self.tally)
        tally["samples"] -= sum(kept.samples for kept in self._behind.kept)
        tally["samples_saturated"] -= sum(kept.saturated for kept in self._behind.kept)
        tally["samples_awaited"] = 0
        return {**self._committed.snapshot(), "tally": tally, "intake": self._intake.snapshot()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state, in a Tracker that was not used; SnapshotError where its counters differ."""
        committed = self._committed
        committed.restore(state)
        self._intake.restore(state["intake"], run=committed.run, boot=committed.boot, next_index=committed.next_index)
        for name, value in state["tally"].items():
            setattr(self.tally, name, value)

    def replay_block(self, run: int, block: RawBlock, lost_until: tuple[int, int]) -> list[Event]:
        """Take samples that a store gives back, in order of (run, index), the index unwrapped.

        What is missing before `lost_until`, the stored cursor's (run, index), was declared lost; what is behind it may
        still come.
        """
        booted = self._intake.follow(run, block)
        events = self._boot(booted) if booted else []
        events += self._receive(block, replayed=True, is_lost=(run, block.index) <= lost_until)
        return [event for event in events if not isinstance(event, Received)]

    def replay_heard(self, characteristic: str, data: bytes) -> list[Event]:
        """Take a value by which the device described itself at this place, as a store gives it back."""
        said = self._intake.hear(characteristic, data)
        return [] if said is None else self._describe(said)

    def _heard(self, packet: Packet) -> Heard:
        intake = self._intake
        return Heard(
            run=intake.run,
            boot=(self.info.boot if intake.boot is None else intake.boot) or 0,
            index=intake.next_index or 0,
            characteristic=packet.characteristic,
            data=packet.data,
        )

    def _describe(self, said: Said) -> list[Event]:
        if not self._behind:
            self._committed.describe(said.info)
        else:
            self._behind.describe(said.info)
        return [Described(info=self.info)] if said.is_change else []

    def _boot(self, booted: Booted) -> list[Event]:
        """Begin a boot: at once where nothing waits, else when all that waits has been counted."""
        self._requests.end()
        if not self._behind:
            return self._committed.begin_boot(booted.boot)
        self._behind.end_run()
        return []

    def _receive(self, block: RawBlock, *, replayed: bool = False, is_lost: bool = False) -> list[Event]:
        """Take a believed block."""
        if self._behind:
            return self._receive_behind(block, replayed=replayed, is_lost=is_lost)
        committed = self._committed
        awaits = committed.next_index
        if awaits is None:
            awaits = self._first_of_boot(block)
        if block.index > awaits and not is_lost:
            self._behind.wait_from(awaits, block.boot)
            return self._receive_behind(block, replayed=replayed, is_lost=False)
        fresh = block if block.index >= awaits else cut(block, awaits, block.index + len(block))
        if fresh is None:
            self.tally.packets_duplicate += 1
            return []
        self._behind.passed += 1
        self._behind.tally_samples(fresh)
        return [Received(run=committed.run, block=fresh), *committed.count(fresh)]

    def _receive_behind(self, block: RawBlock, *, replayed: bool, is_lost: bool) -> list[Event]:
        """Take a believed block while something is missing: what fills holes, and what is newer than all."""
        kept = self._kept_of(block)
        late = self._behind.fill(kept, block) if self._may_fill(kept, block) else []
        newest = kept.next_index
        fresh = cut(block, newest, block.index + len(block))
        events: list[Event] = [Received(run=kept.run, block=piece) for piece in late]
        self.tally.packets_duplicate += not late and fresh is None
        self.tally.packets_reordered += bool(late) and not block.history
        if fresh is not None:
            self._behind.tally_samples(fresh)
            events.append(Received(run=kept.run, block=fresh))
            events += self._behind.extend(kept, fresh, self._rate_hz, is_settled=replayed and self._keeps)
            if is_lost:
                kept.holes.lose(newest, fresh.index)
        self._expire(kept)
        if len(self._behind.kept) == 1:  # else its boot has not been told yet
            events += awaited(kept, self._behind.passed - REORDERING)
        self._behind.tally_awaited()
        return events

    @property
    def _keeps(self) -> bool:
        """Whether the device can send samples again."""
        return bool(self.info.history_samples)

    @property
    def _rate_hz(self) -> float:
        return self.info.rate_hz or 1.0  # no sample is believed before it is known

    def _may_fill(self, kept: Kept, block: RawBlock) -> bool:
        return block.history or kept.next_index - block.index <= LATE_S * self._rate_hz

    def _first_of_boot(self, block: RawBlock) -> int:
        """Return which sample a boot begins with, whose first received ones `block` holds."""
        known = self._intake.run > 0 and block.index <= (self.info.history_samples or 0)
        return 0 if known else block.index

    def _kept_of(self, block: RawBlock) -> Kept:
        """Return what is kept of the newest run, begun if it has not."""
        if self._behind.kept[-1].run != self._intake.run:
            first = self._first_of_boot(block)
            self._behind.kept.append(Kept(run=self._intake.run, boot=block.boot, first=first))
        return self._behind.kept[-1]

    def _expire(self, kept: Kept) -> None:
        """Give up what cannot come any more."""
        if not kept.holes:
            return
        if not self._keeps:
            settled = self._behind.passed - REORDERING
            for span in [span for span in kept.holes.spans if span.holes and span.since < settled]:
                self._behind.lose(span.first, span.end)
            return
        most = min(self.info.history_samples or 0, round(AWAIT_S * self._rate_hz))
        limit = kept.next_index - most
        if kept.holes.first < limit:
            first, end = self._requests.protected()
            self._behind.lose(kept.holes.first, min(limit, first) if self.asked else limit)
            if self.asked and kept.holes and end < limit:
                self._behind.lose(end, limit)

    def _answered(self, reply: Reply) -> None:
        if self._behind:
            kept = self._behind.kept[-1]
            for first, end in self._requests.answered(reply, kept):
                self._behind.lose(first, end)
            self._behind.tally_awaited()
        else:
            self._requests.end()


_PASSING: Final = frozenset({"battery_percent", "register_steps"})


def _matters(info: DeviceInfo) -> bool:
    """Whether a count may depend on what was said: readings that change all the time are not kept for a replay."""
    return any(
        getattr(info, field.name) is not None for field in dataclasses.fields(info) if field.name not in _PASSING
    )
