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
from collections import deque
from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, Final

from service.errors import WireError
from service.samples import (
    Counting,
    Described,
    DeviceInfo,
    Event,
    Heard,
    Packet,
    RawBlock,
    Received,
    Reply,
    Segmented,
    Signal,
    StepCounted,
    Tentative,
)
from service.tracking.account import Account
from service.tracking.awaiting import awaited, corrections
from service.tracking.cutting import cut
from service.tracking.doubt import REORDERING
from service.tracking.fitness import Stream
from service.tracking.fold import CounterFactory, Fold
from service.tracking.holes import Span
from service.tracking.intake import Booted, Intake, Said
from service.tracking.kept import Kept
from service.tracking.requests import Missing, Requests
from service.tracking.tally import Tally
from service.wearables.contract import Wearable

AWAIT_S: Final = 900.0
"""Device time after which what is missing is lost."""
LATE_S: Final = 10.0
"""A live packet older than this fills no hole: its index is rather broken."""
SLICE_SAMPLES: Final = 256
"""Samples that one call of `catch_up` counts at most, but for one chunk."""


class _Build:
    """A front in the making."""

    def __init__(self, fold: Fold, closed: int) -> None:
        self.fold, self.closed = fold, closed
        self.serial = 0
        self.sure: list[StepCounted] = []


class BackfillTracker:
    """Counts one device's steps, as a Tracker; nothing that can still come is counted without it."""

    def __init__(self, wearable: Wearable, counters: Mapping[str, CounterFactory], *, primary: str) -> None:
        self.tally = Tally()
        self._intake = Intake(wearable, self.tally)
        self._committed = Fold(counters, primary=primary, tally=self.tally)
        self._kept: deque[Kept] = deque()
        """What waits, run by run; empty where nothing is missing and the committed Tracker is the front."""
        self._front: Fold | None = None
        self._build: _Build | None = None
        self._account = Account()
        self._requests = Requests()
        self._forked_at: int | None = None
        """Where the committed Tracker stood when the front was forked from it."""
        self._passed = 0
        """Packets that brought newer samples than all before."""
        self._closed = 0
        self._front_closed = 0
        """Spans that were closed, and those of them that the front has counted closed."""

    @property
    def primary(self) -> str:
        """The counter whose count is the device's."""
        return self._committed.primary

    @property
    def info(self) -> DeviceInfo:
        """What the device has said of itself."""
        return self._intake.info

    @property
    def last_fault(self) -> WireError | None:
        """What was wrong with the newest bad packet."""
        return self._intake.last_fault

    @property
    def steps(self) -> dict[str, int]:
        """Each counter's confirmed steps."""
        return self._committed.steps

    @property
    def total(self) -> int:
        """The device's confirmed steps; never falls."""
        return self._committed.total

    @property
    def steps_now(self) -> int:
        """The device's steps with all that is likely, behind a hole too; may fall."""
        committed, front = self._committed, self._front
        if front is None:
            return committed.steps_now
        pending = front.steps_now - front.total
        if committed.next_index == self._forked_at:
            return committed.total + self._account.sure_after(-inf) + pending
        return committed.steps_now + self._account.sure_after(committed.now_s) + pending

    @property
    def now_s(self) -> float:
        """Device time of the newest sample counted, seconds after boot."""
        return self._newest.now_s

    @property
    def cadence_spm(self) -> float | None:
        """Steps a minute now; None while nobody walks."""
        return self._newest.cadence_spm

    @property
    def measured_rate_hz(self) -> float | None:
        """The device's sampling rate as its own clock tells it."""
        return self._newest.measured_rate_hz

    @property
    def counter_faults(self) -> dict[str, str]:
        """Why a counter does not count now, as a sentence."""
        return self._newest.counter_faults

    @property
    def stream(self) -> Stream:
        """What is known of what the device sends."""
        return dataclasses.replace(self._newest.stream, has=self.info.sensors)

    @property
    def cursor(self) -> tuple[int, int, int]:
        """(run, boot, index) of the sample that the committed count waits for."""
        committed = self._committed
        return committed.run, committed.boot or 0, committed.next_index or 0

    @property
    def has_work(self) -> bool:
        """Whether `catch_up` has something to do."""
        if not self._kept:
            return False
        kept = self._kept[0]
        return len(self._kept) > 1 or kept.is_ready or not kept.holes or self._is_stale or self._build is not None

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
                if item.is_new:
                    events.append(self._heard(packet))
                events += self._describe(item)
            else:
                self._answered(item)
        return events

    def catch_up(self, samples: int = SLICE_SAMPLES) -> list[Event]:
        """Count on what can be counted for good, or make the front anew: about so many samples of it."""
        events: list[Event] = []
        while samples > 0 and self.has_work:
            samples -= self._work(events)
        if events:
            self._tally_awaited()
            events.append(self._counting())
        return events

    def wanted(self) -> Missing | None:
        """Return what to ask the device for now; None while a request is under way or nothing is worth one."""
        if not self._kept or not self.info.history_samples or self._requests.asked:
            return None
        return self._requests.choose(self._kept[-1], self._passed - REORDERING)

    def ask(self, missing: Missing) -> None:
        """Take note that the device was asked; its Reply comes with the packets."""
        if self._kept:
            self._requests.begin(missing, self._kept[-1])

    def unanswered(self) -> None:
        """Take note that no answer will come: the link is lost, or it took too long. It will be wanted again."""
        self._requests.end()

    def change_counters(self, counters: Mapping[str, CounterFactory], *, primary: str) -> list[Event]:
        """Go on with other counters, as Fold.change_counters; where a hole is open, from the hole on."""
        before = self.primary
        told = self._committed.change_counters(counters, primary=primary)
        if not self._kept:
            return told
        events = self._commit(told, before)
        if any(isinstance(event, Segmented) for event in told):
            events += self._account.retract()
        if self._front is not None:
            self._front.change_counters(counters, primary=primary)
        self._build, self._front_closed = None, -1
        return [*events, self._counting()]

    def finish(self) -> list[Event]:
        """End the stream: what is missing is lost; decide what is still pending."""
        for kept in self._kept:
            kept.lose_all()
        events: list[Event] = []
        while self._kept:
            events += self.catch_up()
        return events + self._committed.finish()

    def snapshot(self) -> dict[str, Any]:
        """Return the committed state as plain data."""
        tally = dataclasses.asdict(self.tally)
        tally["samples"] -= sum(kept.samples for kept in self._kept)
        tally["samples_saturated"] -= sum(kept.saturated for kept in self._kept)
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

    @property
    def _newest(self) -> Fold:
        return self._front or self._committed

    @property
    def _is_stale(self) -> bool:
        return self._front is None or self._front_closed != self._closed

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
        if not self._kept:
            self._committed.describe(said.info)
        else:
            self._kept[-1].say(said.info)
            if self._front is not None:
                self._front.describe(said.info)
        return [Described(info=self.info)] if said.is_change else []

    def _boot(self, booted: Booted) -> list[Event]:
        """Begin a boot: at once where nothing waits, else when all that waits has been counted."""
        self._requests.end()
        if not self._kept:
            return self._committed.begin_boot(booted.boot)
        self._kept[-1].lose_all()
        self._front = self._build = None
        return []

    def _receive(self, block: RawBlock, *, replayed: bool = False, is_lost: bool = False) -> list[Event]:
        """Take a believed block."""
        if self._kept:
            return self._receive_behind(block, replayed=replayed, is_lost=is_lost)
        committed = self._committed
        awaits = committed.next_index
        if awaits is None:
            awaits = self._first_of_boot(block)
        if block.index > awaits and not is_lost:
            self._wait_from(awaits, block.boot)
            return self._receive_behind(block, replayed=replayed, is_lost=False)
        fresh = block if block.index >= awaits else cut(block, awaits, block.index + len(block))
        if fresh is None:
            self.tally.packets_duplicate += 1
            return []
        self._passed += 1
        self._tally_samples(fresh)
        return [Received(run=committed.run, block=fresh), *committed.count(fresh)]

    def _receive_behind(self, block: RawBlock, *, replayed: bool, is_lost: bool) -> list[Event]:
        """Take a believed block while something is missing: what fills holes, and what is newer than all."""
        kept = self._kept_of(block)
        late = self._fill(kept, block)
        newest = kept.next_index
        fresh = cut(block, newest, block.index + len(block))
        events: list[Event] = [Received(run=kept.run, block=piece) for piece in late]
        self.tally.packets_duplicate += not late and fresh is None
        self.tally.packets_reordered += bool(late) and not block.history
        if fresh is not None:
            self._tally_samples(fresh)
            events.append(Received(run=kept.run, block=fresh))
            events += self._extend(kept, fresh, replayed=replayed)
            if is_lost:
                kept.holes.lose(newest, fresh.index)
            self._passed += 1
        self._expire(kept)
        events += awaited(kept, self._passed - REORDERING)
        self._tally_awaited()
        return events

    def _fill(self, kept: Kept, block: RawBlock) -> list[RawBlock]:
        """Keep what of a block fills holes, and return it."""
        if not block.history and kept.next_index - block.index > LATE_S * (self.info.rate_hz or 1.0):
            return []
        end = block.index + len(block)
        holes = [(hole.first, hole.end) for hole in kept.holes.within(block.index, end)]
        late = [piece for first, last in holes if (piece := cut(block, first, last)) is not None]
        for piece in late:
            kept.add(piece)
            self._tally_samples(piece)
            self._closed += kept.holes.fill(piece.index, piece.index + len(piece))
        return late

    def _extend(self, kept: Kept, block: RawBlock, *, replayed: bool) -> list[Event]:
        """Keep the newest samples, note the hole before them if there is one, and have the front count them."""
        front, span = self._front, None
        if block.index > kept.next_index:
            rate_hz = self.info.rate_hz or 1.0
            since = -inf if replayed else self._passed
            span = Span(
                first=kept.next_index,
                end=block.index,
                since=since,
                from_s=max(0, kept.next_index - 1) / rate_hz,
                to_s=block.index / rate_hz,
            )
            kept.holes.add(span)
        kept.add(block)
        if front is None:
            return []
        if span is not None and front.next_index is not None:
            span.from_s = front.now_s
        told = self._follow(front.count(block))
        if span is not None:
            span.to_s = max(span.from_s, front.now_s - (len(block) - 1) / (front.measured_rate_hz or 1.0))
        return [*told, self._counting()]

    def _first_of_boot(self, block: RawBlock) -> int:
        """Return which sample a boot begins with, whose first received ones `block` holds."""
        known = self._intake.run > 0 and block.index <= (self.info.history_samples or 0)
        return 0 if known else block.index

    def _wait_from(self, index: int, boot: int) -> None:
        """Begin to wait for samples from `index` on: the front goes on from the committed Tracker."""
        committed = self._committed
        self._kept.append(Kept(run=committed.run, boot=boot, first=index))
        self._front, self._forked_at = committed.fork(), committed.next_index
        self._front_closed = self._closed
        self._account = Account(committed.likely())

    def _kept_of(self, block: RawBlock) -> Kept:
        """Return what is kept of the newest run, begun if it has not."""
        if self._kept[-1].run != self._intake.run:
            first = self._first_of_boot(block)
            self._kept.append(Kept(run=self._intake.run, boot=block.boot, first=first))
        return self._kept[-1]

    def _expire(self, kept: Kept) -> None:
        """Give up what cannot come any more."""
        if not kept.holes:
            return
        if not self.info.history_samples:
            settled = self._passed - REORDERING
            for span in [span for span in kept.holes.spans if span.holes and span.since < settled]:
                self._closed += kept.holes.lose(span.first, span.end)
            return
        most = min(self.info.history_samples, round(AWAIT_S * (self.info.rate_hz or 1.0)))
        limit = kept.next_index - most
        if kept.holes.first < limit:
            first, end = self._requests.protected()
            self._closed += kept.holes.lose(kept.holes.first, min(limit, first) if self.asked else limit)
            if self.asked and kept.holes and end < limit:
                self._closed += kept.holes.lose(end, limit)

    def _answered(self, reply: Reply) -> None:
        if self._kept:
            kept = self._kept[-1]
            for first, end in self._requests.answered(reply, kept):
                self._closed += kept.holes.lose(first, end)
            self._tally_awaited()
        else:
            self._requests.end()

    def _work(self, events: list[Event]) -> int:
        """Do the next piece of what is to be done; return about how many samples it was worth."""
        kept = self._kept[0]
        block = kept.ready()
        if block is not None:
            self._build = None
            self._hear(kept, block.index)
            events += self._commit(self._committed.count(block), self.primary)
            kept.counted(block)
            return len(block)
        if len(self._kept) > 1:
            self._next_boot(events)
        elif not kept.holes:
            self._promote(kept, events)
        else:
            return self._rebuild(kept, events)
        return SLICE_SAMPLES

    def _hear(self, kept: Kept, index: int) -> None:
        """Let the committed Tracker know what the device said up to sample `index`."""
        for serial, said in kept.said(index, 0):
            self._committed.describe(said)
            kept.heeded(serial)

    def _next_boot(self, events: list[Event]) -> None:
        """End a boot of which all was counted, and begin the next."""
        kept = self._kept.popleft()
        self._hear(kept, kept.next_index)
        now_s = self._committed.now_s
        *last, rebooted = self._committed.begin_boot(self._kept[0].boot)
        events += self._commit(last, self.primary)
        events += self._account.retract()
        events += corrections(kept, self._account, now_s)
        events.append(rebooted)
        self._account = Account()

    def _promote(self, kept: Kept, events: list[Event]) -> None:
        """Nothing is missing any more: the committed Tracker is the front."""
        self._hear(kept, kept.next_index)
        events += self._account.settle(self._committed.likely(), ())
        events += corrections(kept, self._account, self._committed.now_s)
        self._kept.clear()
        self._front = self._build = None

    def _rebuild(self, kept: Kept, events: list[Event]) -> int:
        """Make another front, from the committed Tracker and what was received behind it."""
        if self._build is None:
            self._build = _Build(self._committed.fork(), self._closed)
            return SLICE_SAMPLES
        build = self._build
        block = kept.after(build.fold.next_index or 0)
        said = kept.said(kept.next_index if block is None else block.index, build.serial)
        for build.serial, what in said:
            build.fold.describe(what)
        if block is None:
            self._replace_front(kept, build, events)
            return SLICE_SAMPLES
        for event in build.fold.count(block):
            if isinstance(event, StepCounted) and event.counter == self.primary:
                build.sure.append(event)
        return len(block)

    def _replace_front(self, kept: Kept, build: _Build, events: list[Event]) -> None:
        self._front, self._front_closed, self._build = build.fold, build.closed, None
        self._forked_at = self._committed.next_index
        events += self._account.settle(build.fold.likely(), build.sure)
        events += corrections(kept, self._account, build.fold.now_s)

    def _follow(self, told: Iterable[Event]) -> list[Event]:
        """Return what is to be told of what the front tells."""
        events: list[Event] = []
        for event in told:
            if isinstance(event, Tentative):
                events += self._account.follow(event)
            elif isinstance(event, StepCounted) and event.counter == self.primary:
                self._account.assume(event)
            elif isinstance(event, Signal):
                events.append(event)
        return events

    def _commit(self, told: Iterable[Event], primary: str) -> list[Event]:
        """Return what is to be told of what the committed Tracker tells while another is the front."""
        events: list[Event] = []
        for event in told:
            if isinstance(event, StepCounted) and event.counter == primary:
                events += self._account.confirm(event)
            elif not isinstance(event, (Tentative, Signal, Counting)):
                events.append(event)
        return events

    def _counting(self) -> Counting:
        return Counting(now_s=self.now_s, steps=self.total, steps_now=self.steps_now, cadence_spm=self.cadence_spm)

    def _tally_samples(self, block: RawBlock) -> None:
        self.tally.samples += len(block)
        self.tally.samples_saturated += len(block.saturated)

    def _tally_awaited(self) -> None:
        """Count what is missing and not yet told as lost."""
        awaited, counted = 0, self._committed.next_index
        for kept in self._kept:
            first = kept.first if counted is None else counted
            awaited += kept.next_index - first - kept.samples
            counted = None
        self.tally.samples_awaited = awaited
