"""What lies behind a hole: samples kept until they count for good, the front that has counted them, and catching up.

The committed Tracker is given; it is moved on here while something waits, and tells what is to be told. `work` does one
small piece at a time: it counts a chunk for good, ends a boot, makes the committed Tracker the front again, or counts a
chunk for a new front, which replaces the old one when it has come up to the newest sample.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from math import inf
from typing import Final

from service.events import Counting, Event, Segmented, Signal, StepCounted, Tentative
from service.samples import DeviceInfo, RawBlock
from service.tracking.account import Account
from service.tracking.awaiting import corrections
from service.tracking.cutting import cut
from service.tracking.fold import CounterFactory, Fold
from service.tracking.holes import Span
from service.tracking.kept import Kept
from service.tracking.tally import Tally

SLICE_SAMPLES: Final = 100
"""Samples that are counted again at a time, and then to the end of a chunk; a fork takes about as long."""


class _Build:
    """A front in the making."""

    def __init__(self, fold: Fold, closed: int) -> None:
        self.fold, self.closed = fold, closed
        self.serial = 0
        self.sure: list[StepCounted] = []


class Behind:
    """What waits behind the first hole of what `committed` has counted."""

    def __init__(self, committed: Fold, tally: Tally) -> None:
        self.kept: deque[Kept] = deque()
        """What waits, run by run; empty where nothing is missing and the committed Tracker is the front."""
        self.passed = 0
        """Packets that brought newer samples than all before."""
        self.closed = 0
        """Spans that were closed after some of them had come."""
        self._committed = committed
        self._tally = tally
        self._front: Fold | None = None
        self._front_closed = 0
        """How many of the closed spans the front has counted so."""
        self._forked_at: int | None = None
        """Where the committed Tracker stood when the front was forked from it."""
        self._build: _Build | None = None
        self._account = Account()

    def __bool__(self) -> bool:
        return bool(self.kept)

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
    def front(self) -> Fold:
        """The Tracker that has counted the newest samples."""
        return self._front or self._committed

    @property
    def has_work(self) -> bool:
        """Whether `work` has something to do."""
        if not self.kept:
            return False
        kept = self.kept[0]
        return len(self.kept) > 1 or kept.is_ready or not kept.holes or self._is_stale or self._build is not None

    def wait_from(self, index: int, boot: int) -> None:
        """Begin to wait for samples from `index` on: the front goes on from the committed Tracker."""
        committed = self._committed
        self.kept.append(Kept(run=committed.run, boot=boot, first=index))
        self._front, self._forked_at = committed.fork(), committed.next_index
        self._front_closed = self.closed
        self._account = Account(committed.likely())

    def fill(self, kept: Kept, block: RawBlock) -> list[RawBlock]:
        """Keep what of a block fills holes, and return it."""
        end = block.index + len(block)
        holes = [(hole.first, hole.end) for hole in kept.holes.within(block.index, end)]
        late = [piece for first, last in holes if (piece := cut(block, first, last)) is not None]
        for piece in late:
            kept.add(piece)
            self.tally_samples(piece)
            self.closed += kept.holes.fill(piece.index, piece.index + len(piece))
        return late

    def extend(self, kept: Kept, block: RawBlock, rate_hz: float, *, is_settled: bool) -> list[Event]:
        """Keep the newest samples, note the hole before them if there is one, and have the front count them.

        A hole `is_settled` where nothing reordered can fill it.
        """
        front, span = self._front, None
        if block.index > kept.next_index:
            since = -inf if is_settled else self.passed
            span = Span(
                first=kept.next_index,
                end=block.index,
                since=since,
                from_s=max(0, kept.next_index - 1) / rate_hz,
                to_s=block.index / rate_hz,
            )
            kept.holes.add(span)
        kept.add(block)
        self.passed += 1
        if front is None:
            return []
        if span is not None and front.next_index is not None:
            span.from_s = front.now_s
        told = self._follow(front.count(block))
        if span is not None:
            span.to_s = max(span.from_s, front.now_s - (len(block) - 1) / (front.measured_rate_hz or 1.0))
        return [*told, self.counting()]

    def describe(self, said: DeviceInfo) -> None:
        """Take what the device says of itself behind the newest sample."""
        self.kept[-1].say(said)
        if self._front is not None:
            self._front.describe(said)

    def lose(self, first: int, end: int) -> None:
        """Wait for the samples [first, end) of the newest run no longer."""
        self.closed += self.kept[-1].holes.lose(first, end)

    def end_run(self) -> None:
        """Wait for nothing of the newest run; all of it is counted for good before another boot has a front."""
        self.kept[-1].lose_all()
        self._front = self._build = None

    def change_counters(self, counters: Mapping[str, CounterFactory], *, primary: str) -> list[Event]:
        """Go on with other counters from the hole on; the front is made anew."""
        before = self._committed.primary
        told = self._committed.change_counters(counters, primary=primary)
        events = self._commit(told, before)
        if any(isinstance(event, Segmented) for event in told):
            events += self._account.retract()
        if self._front is not None:
            self._front.change_counters(counters, primary=primary)
        self._build, self._front_closed = None, -1
        return [*events, self.counting()]

    def work(self, events: list[Event]) -> int:
        """Do the next piece of what is to be done; return about how many samples it was worth."""
        kept = self.kept[0]
        block = kept.ready()
        if block is not None:
            self._build = None
            self._hear(kept, block.index)
            events += self._commit(self._committed.count(block), self._committed.primary)
            kept.counted(block)
            return len(block)
        if len(self.kept) > 1:
            self._next_boot(events)
        elif not kept.holes:
            self._promote(kept, events)
        else:
            return self._rebuild(kept, events)
        return SLICE_SAMPLES

    def counting(self) -> Counting:
        """Return both counts as they stand."""
        return Counting(
            now_s=self.front.now_s,
            steps=self._committed.total,
            steps_now=self.steps_now,
            cadence_spm=self.front.cadence_spm,
            gait=self.front.gait,
        )

    def tally_samples(self, block: RawBlock) -> None:
        """Count samples that were not there before."""
        self._tally.samples += len(block)
        self._tally.samples_saturated += len(block.saturated)

    def tally_awaited(self) -> None:
        """Count what is missing and not yet told as lost."""
        awaited, counted = 0, self._committed.next_index
        for kept in self.kept:
            first = kept.first if counted is None else counted
            awaited += kept.next_index - first - kept.samples
            counted = None
        self._tally.samples_awaited = awaited

    @property
    def _is_stale(self) -> bool:
        return self._front is None or self._front_closed != self.closed

    def _hear(self, kept: Kept, index: int) -> None:
        """Let the committed Tracker know what the device said up to sample `index`."""
        for serial, said in kept.said(index, 0):
            self._committed.describe(said)
            kept.heeded(serial)

    def _next_boot(self, events: list[Event]) -> None:
        """End a boot of which all was counted, and begin the next."""
        kept = self.kept.popleft()
        self._hear(kept, kept.next_index)
        now_s = self._committed.now_s
        *last, rebooted = self._committed.begin_boot(self.kept[0].boot)
        events += self._commit(last, self._committed.primary)
        events += self._account.retract()
        events += corrections(kept, self._account, now_s)
        events.append(rebooted)
        self._account = Account()

    def _promote(self, kept: Kept, events: list[Event]) -> None:
        """Nothing is missing any more: the committed Tracker is the front."""
        self._hear(kept, kept.next_index)
        events += self._account.settle(self._committed.likely(), ())
        events += corrections(kept, self._account, self._committed.now_s)
        self.kept.clear()
        self._front = self._build = None

    def _rebuild(self, kept: Kept, events: list[Event]) -> int:
        """Make another front, from the committed Tracker and what was received behind it."""
        if self._build is None:
            self._build = _Build(self._committed.fork(), self.closed)
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
            if isinstance(event, StepCounted) and event.counter == self._committed.primary:
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
            elif isinstance(event, StepCounted) and event.counter == self._committed.primary:
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
