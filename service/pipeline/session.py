"""A session: one device's count, what it told, and what is kept of it; it outlives every link and every restart.

Packets are counted at once; what a late sample changes is counted again in slices, between which everybody else has
their turn. What is missing is asked of the device while its live data goes on.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from service.errors import LinkError
from service.events import (
    Described,
    Event,
    Gap,
    Gridded,
    Heard,
    Rebooted,
    Received,
    StepCounted,
    Tentative,
    Walked,
)
from service.links.contract import Link
from service.pipeline.journal import Journal, RestartPoint
from service.pipeline.lifecycle import State
from service.pipeline.lineup import Lineup
from service.pipeline.notices import UNNUMBERED, DeviceChanged, Notice, StateChanged, Told, entry_of
from service.samples import Packet, RawBlock
from service.signals.hosttime import Drift, HostClock
from service.store.chunker import blocks
from service.store.codec import parted
from service.store.values import Chunk, Cursor, Description, Resumable, SessionKey
from service.tracking.backfill import BackfillTracker
from service.tracking.requests import Missing
from service.wearables.contract import Write

YIELD_EVERY: Final = 64
"""Packets handled in a row before others may run: 64 × 100 µs."""
SLICE_S: Final = 0.005
"""Longest stretch of counting again without a pause for others."""
ANSWER_S: Final = 10.0
"""A device that sends nothing of what it was asked for so long is asked anew."""
REFUSED_S: Final = 2.0
"""Wait after a request that was refused."""
ORDINALS_SKIPPED: Final = 1000
"""Numbers left out after a restart: before a crash as many may have been told that were not yet on the disk …"""
EVENTS_PER_S: Final = 40
"""… and so many more for each second since the last snapshot, however long the disk took nothing."""

TELL_EVERY_NS: Final = 1_000_000_000
"""While packets come, the device's description (packets, losses, signal) is told so often."""

Publish = Callable[[Notice], None]

logger = logging.getLogger(__name__)


class Session:
    """One device's counting, over any number of links.

    `name_device` gives its id, `publish` takes each notice, `about` tells what a restart needs beside the count, and
    `history` which writes ask the device for samples again.
    """

    def __init__(
        self,
        name_device: Callable[[], str],
        tracker: BackfillTracker,
        publish: Publish,
        journal: Journal | None = None,
        about: Callable[[], Mapping[str, Any]] = dict,
        history: Callable[[int, int, int], Sequence[Write]] = lambda _boot, _first, _samples: (),
    ) -> None:
        self._name_device = name_device
        self._history = history
        self.tracker = tracker
        self.since_ns = time.time_ns()
        self.journal = journal or Journal()
        self.observers: list[Publish] = []
        """Told of everything at once and in order, of the grid samples too; they do not wait and do not raise."""
        self._publish = publish
        self._about = about
        self._clocks = {0: HostClock()}
        """By run: what is counted late may belong to an earlier one."""
        self.after = self._ordinal = 0
        """Numbers of the last event before the session, and of its newest."""
        self._told_ns = self._arrived_ns = 0
        self._faults: dict[str, str] = {}
        self._warned: set[str] = set()
        self._behind = asyncio.Event()
        """Set when something may have to be counted again."""
        self._heard = asyncio.Event()
        """Set at each packet."""

    @property
    def drift(self) -> Drift | None:
        """How the device's clock drifts against the host's since its boot; None until that is known."""
        return self._clock(self.tracker.cursor[0]).drift

    # What comes in

    async def follow(self, link: Link) -> None:
        """Take the link's packets until it is lost (LinkError) or the task is cancelled; ask it for what is missing."""
        asking = asyncio.create_task(self._ask(link), name="history")
        handled = 0
        try:
            async for packet in link:
                self.apply(packet)
                handled += 1
                if handled % YIELD_EVERY == 0:
                    await asyncio.sleep(0)
        finally:
            asking.cancel()
            await asyncio.wait({asking})
            self.tracker.unanswered()

    def apply(self, packet: Packet) -> None:
        """Take one packet, from any link."""
        tracker = self.tracker
        run, newest_s = tracker.cursor[0], tracker.now_s
        events = tracker.apply(packet)
        self._arrived_ns = packet.at_ns
        if (tracker.cursor[0], tracker.now_s) != (run, newest_s):
            self._clock(tracker.cursor[0]).arrived(tracker.now_s, packet.at_ns)
        self._tell_all(events, run, packet.at_ns)
        self._heard.set()
        if tracker.has_work:
            self._behind.set()
        if abs(packet.at_ns - self._told_ns) >= TELL_EVERY_NS:
            self._told_ns = packet.at_ns
            self.tell(DeviceChanged(), packet.at_ns)

    def change_counters(self, lineup: Lineup) -> None:
        """Go on with other counters, and tell what that decided."""
        run = self.tracker.cursor[0]
        self._tell_all(self.tracker.change_counters(lineup.makers, primary=lineup.primary), run, time.time_ns())
        self.tell(DeviceChanged(), time.time_ns())
        self.journal.mark()

    def state_changed(self, state: State, reason: str | None) -> None:
        """Tell that the device's connection came into another state."""
        self.tell(StateChanged(state=state, reason=reason), time.time_ns())

    # What a restart gives back

    def resume(self, found: Resumable) -> None:
        """Take over what is stored of this session, before its samples are replayed; SnapshotError where it cannot."""
        self.since_ns = found.key.since_ns
        self.after = (found.about or {}).get("after", 0)
        stored_ns = found.snapshot.at_ns if found.snapshot else found.key.since_ns
        untold_s = max(0, time.time_ns() - stored_ns) // 10**9
        self._ordinal = found.last_ordinal + ORDINALS_SKIPPED + EVENTS_PER_S * untold_s
        self.journal.begin(found.key, found.about)
        if found.snapshot is not None:
            self.tracker.restore(found.snapshot.state["tracker"])
            for run, state in found.snapshot.state["clocks"].items():
                self._clock(int(run)).restore(state)

    def replay(self, item: Chunk | Description, counted: Cursor | None) -> None:
        """Count again what was stored.

        Up to `counted` it was told before, and what is missing there is lost. What is behind is told now: samples may
        have been stored that waited to be counted.
        """
        if isinstance(item, Description):
            self.tracker.replay_heard(item.characteristic, item.value)
            return
        place = counted.place if counted else (0, 0)
        self._arrived_ns = item.at_ns
        for piece in parted(item, place[1]) if item.run == place[0] else (item,):
            for block in blocks(piece):
                self._replay_block(item, block, place)

    def _replay_block(self, item: Chunk, block: RawBlock, counted: tuple[int, int]) -> None:
        run = self.tracker.cursor[0]
        events = self.tracker.replay_block(item.run, block, counted)
        if item.run not in self._clocks:
            self._clock(item.run).arrived(self.tracker.now_s, item.at_ns)
        if (item.run, block.index) >= counted:
            self._tell_all(_without_beginning(events) if item.run == counted[0] else events, run, item.at_ns)
        while self.tracker.has_work:
            self.catch_up()

    # What goes out

    async def keep(self) -> None:
        """Count again what late samples change, and have everything stored. Never ends by itself."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.journal.keep(self._standing, time.time_ns))
            tasks.create_task(self._catch_up())

    async def close(self, *, ended: bool = False) -> None:
        """Store what there is; `ended` ends the session for good: what is missing is lost, what is pending decided."""
        if ended:
            while self.tracker.has_work:
                self.catch_up()
                await asyncio.sleep(0)
            self._tell_all(self.tracker.finish(), self.tracker.cursor[0], time.time_ns())
        await self.journal.close(self._standing, time.time_ns, ended=ended)

    def take_over(self, before: Session) -> None:
        """Go on with the event numbers of the device's session before, and tell its observers."""
        self.after = self._ordinal = before._ordinal
        self.observers += before.observers

    def tell(self, event: Told, at_ns: int, run: int | None = None) -> None:
        """Tell the observers, publish the event unless it is for them only, and have it stored if it is durable."""
        private = isinstance(event, Gridded)
        if private and not self.observers:
            return
        if isinstance(event, Described):
            event = DeviceChanged()
        ordinal = None
        if not isinstance(event, UNNUMBERED):
            self._ordinal += 1
            ordinal = self._ordinal
        run = self.tracker.cursor[0] if run is None else run
        notice = Notice(
            device=self._name_device(),
            at_ns=at_ns,
            uncertainty_s=self._clock(run).uncertainty_s,
            ordinal=ordinal,
            event=event,
        )
        for observe in tuple(self.observers):
            observe(notice)
        if ordinal is not None:
            self.journal.log(entry_of(notice, run))
        if not private:
            self._publish(notice)

    def _tell_all(self, events: Sequence[Event], run: int, at_ns: int) -> None:
        """Tell events in order. `run` is that of the committed count before them, `at_ns` when their packet arrived."""
        for event in events:
            if isinstance(event, Rebooted):  # what comes before it happened in the earlier run's device time
                run += 1
            if isinstance(event, Received):
                self._begin_journal()
                self.journal.received(event, self.tracker.info, at_ns)
                continue
            if isinstance(event, Heard):
                self.journal.heard(event, at_ns)
                continue
            self.tell(event, self._host_ns(event, run), run)
        self._tell_faults()

    def _begin_journal(self) -> None:
        """Have the session stored once its device's name is known, which is before its first sample."""
        if self.journal.key is not None:
            return
        device = self._name_device()
        last = self.journal.last_ordinal(device)
        if self._ordinal <= last:
            self.journal.number_on(last)
            self._ordinal += last
            self.after = last
        self.journal.begin(SessionKey(device=device, since_ns=self.since_ns))

    def _standing(self) -> RestartPoint:
        return RestartPoint(cursor=self._cursor(), state=self._state, about=self._about())

    def _cursor(self) -> Cursor:
        run, boot, index = self.tracker.cursor
        return Cursor(run=run, boot=boot, index=index)

    def _state(self) -> dict[str, Any]:
        clocks = {str(run): clock.snapshot() for run, clock in self._clocks.items()}
        return {"tracker": self.tracker.snapshot(), "clocks": clocks}

    async def _catch_up(self) -> None:
        """Count again in slices whenever there is something to."""
        while True:
            await self._behind.wait()
            self._behind.clear()
            while self.tracker.has_work:
                until_s = time.perf_counter() + SLICE_S
                try:
                    while time.perf_counter() < until_s and self.tracker.has_work:
                        self.catch_up()
                except Exception:  # a fault of ours with one device must end neither its recording nor the others
                    logger.exception("counting again for %s", self._name_device())
                    break
                await asyncio.sleep(0)

    def catch_up(self) -> None:
        """Count again a slice of what late samples change."""
        run = self.tracker.cursor[0]
        events = self.tracker.catch_up()
        if self.tracker.cursor[0] != run:  # the new run's first packets have waited for the earlier one's last
            self._clock(self.tracker.cursor[0]).arrived(self.tracker.now_s, self._arrived_ns)
        self._tell_all(events, run, time.time_ns())

    async def _ask(self, link: Link) -> None:
        """Ask the device for what is missing, a piece at a time, as long as the link holds."""
        while True:
            await self._heard.wait()
            self._heard.clear()
            if (missing := self.tracker.wanted()) is None:
                continue
            self.tracker.ask(missing)
            try:
                for write in self._history(missing.boot, missing.first, missing.samples):
                    await link.request(write)
                await self._answer(missing)
            except LinkError as error:  # refused, perhaps for now; where the link is lost, this task ends with it
                logger.info("%s was not asked for what is missing: %s", self._name_device(), error)
                await asyncio.sleep(REFUSED_S)
            except Exception:
                logger.exception("asking %s for what is missing", self._name_device())
                await asyncio.sleep(REFUSED_S)
            self.tracker.unanswered()

    async def _answer(self, missing: Missing) -> None:
        """Wait for the end of an answer, as long as it goes on."""
        loop, tally = asyncio.get_running_loop(), self.tracker.tally
        awaited, until_s = tally.samples_awaited, loop.time() + ANSWER_S
        while self.tracker.asked == missing and loop.time() < until_s:
            if tally.samples_awaited < awaited:
                until_s = loop.time() + ANSWER_S
            awaited = tally.samples_awaited
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(until_s):
                    await self._heard.wait()
            self._heard.clear()

    def _tell_faults(self) -> None:
        """Tell at once that a counter cannot count, or can again; say on the log why, once a session."""
        faults = self.tracker.counter_faults
        if faults == self._faults:
            return
        self._faults = dict(faults)
        self.tell(DeviceChanged(), time.time_ns())
        for why in faults.values():
            if why not in self._warned:
                self._warned.add(why)
                logger.warning("%s: not counted: %s", self._name_device(), why)

    def _clock(self, run: int) -> HostClock:
        """Return the clock of a run; those of runs long over go."""
        if run not in self._clocks:
            self._clocks = {known: clock for known, clock in self._clocks.items() if known >= run - 1}
            self._clocks[run] = HostClock()
        return self._clocks[run]

    def _host_ns(self, event: Event, run: int) -> int:
        match event:
            case StepCounted():
                return self._clock(run).at_ns(event.step.at_s)
            case Tentative() | Walked():
                return self._clock(run).at_ns(event.at_s)
            case Gap():
                return self._clock(run).at_ns(event.to_s)
            case _:
                return self._clock(run).at_ns(self.tracker.now_s)


def _without_beginning(events: list[Event]) -> list[Event]:
    """Return what followed the beginning of a run, if they tell of it: it was told before."""
    begun = [place for place, event in enumerate(events) if isinstance(event, Rebooted)]
    return events[begun[-1] + 1 :] if begun else events
