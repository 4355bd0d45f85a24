"""A session: one device's Tracker, what it told, and the notices made of it; it outlives every single link.

Steps and events are kept in memory, the newest LOG_NOTICES of them.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable

from service.links.contract import Link
from service.pipeline.lifecycle import State
from service.pipeline.lineup import Lineup
from service.pipeline.notices import UNNUMBERED, DeviceChanged, Notice, StateChanged, Told
from service.samples import Described, Event, Gap, Gridded, Packet, Rebooted, StepCounted, Tentative
from service.signals.hosttime import HostClock
from service.tracking.tracker import Tracker

LOG_NOTICES = 100_000
"""Durable notices kept: a day of walking, 30 MB. Policy: the oldest go."""
YIELD_EVERY = 64
"""Packets handled in a row before others may run: 64 × 100 µs."""

TELL_EVERY_NS = 1_000_000_000
"""While packets come, the device's description (packets, losses, signal) is told so often."""

Publish = Callable[[Notice], None]

logger = logging.getLogger(__name__)


class Session:
    """One device's counting, over any number of links. `name_device` gives its id, `publish` takes each notice."""

    def __init__(self, name_device: Callable[[], str], tracker: Tracker, publish: Publish) -> None:
        self._name_device = name_device
        self.tracker = tracker
        self.since_ns = time.time_ns()
        self.log: deque[Notice] = deque(maxlen=LOG_NOTICES)
        self.observers: list[Publish] = []
        """Told of everything at once and in order, of the grid samples too; they do not wait and do not raise."""
        self._publish = publish
        self._clock = HostClock()
        self._ordinal = 0
        self._told_ns = 0
        self._faults: dict[str, str] = {}
        self._warned: set[str] = set()

    async def follow(self, link: Link) -> None:
        """Take the link's packets until it is lost (LinkError) or the task is cancelled."""
        handled = 0
        async for packet in link:
            self.apply(packet)
            handled += 1
            if handled % YIELD_EVERY == 0:
                await asyncio.sleep(0)

    def apply(self, packet: Packet) -> None:
        """Take one packet, from any link."""
        samples = self.tracker.tally.samples
        events, clock = self.tracker.apply(packet), self._clock
        if any(isinstance(event, Rebooted) for event in events):
            self._clock = HostClock()
        if self.tracker.tally.samples != samples:
            self._clock.arrived(self.tracker.now_s, packet.at_ns)
        for event in events:
            if isinstance(event, Rebooted):  # what came before it happened in the other boot's device time
                clock = self._clock
            self.tell(event, self._host_ns(event, clock))
        self._tell_faults()
        if abs(packet.at_ns - self._told_ns) >= TELL_EVERY_NS:
            self._told_ns = packet.at_ns
            self.tell(DeviceChanged(), packet.at_ns)

    def change_counters(self, lineup: Lineup) -> None:
        """Go on with other counters, and tell what that decided."""
        for event in self.tracker.change_counters(lineup.makers, primary=lineup.primary):
            self.tell(event, self._host_ns(event, self._clock))
        self.tell(DeviceChanged(), time.time_ns())
        self._tell_faults()

    def state_changed(self, state: State, reason: str | None) -> None:
        """Tell that the device's connection came into another state."""
        self.tell(StateChanged(state=state, reason=reason), time.time_ns())

    def tell(self, event: Told, at_ns: int) -> None:
        """Tell the observers, publish the event unless it is for them only, and keep it if it is durable."""
        private = isinstance(event, Gridded)
        if private and not self.observers:
            return
        if isinstance(event, Described):
            event = DeviceChanged()
        ordinal = None
        if not isinstance(event, UNNUMBERED):
            self._ordinal += 1
            ordinal = self._ordinal
        notice = Notice(
            device=self._name_device(),
            at_ns=at_ns,
            uncertainty_s=self._clock.uncertainty_s,
            ordinal=ordinal,
            event=event,
        )
        for observe in tuple(self.observers):
            observe(notice)
        if ordinal is not None:
            self.log.append(notice)
        if not private:
            self._publish(notice)

    def steps(self) -> list[Notice]:
        """Return the steps kept, in the order they were confirmed."""
        return [notice for notice in self.log if isinstance(notice.event, StepCounted)]

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

    def _host_ns(self, event: Event, clock: HostClock) -> int:
        match event:
            case StepCounted():
                return clock.at_ns(event.step.at_s)
            case Tentative():
                return clock.at_ns(event.at_s)
            case Gap():
                return clock.at_ns(event.to_s)
            case _:
                return clock.at_ns(self.tracker.now_s)
