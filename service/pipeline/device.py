"""A device as the service knows it: its connection's state, its session, and the task that holds its link."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable

from service.counters import registry
from service.errors import CounterError, LinkError, NotNowError
from service.links.ble import Sighting
from service.links.contract import Link
from service.pipeline.calibration import Calibration, Plan
from service.pipeline.calibrations import Calibrations
from service.pipeline.journal import Journal
from service.pipeline.lifecycle import HEALTHY_S, LINKED, WAITING, Cause, State, advance, backoff_s
from service.pipeline.lineup import Lineup
from service.pipeline.notices import DeviceChanged
from service.pipeline.session import Publish, Session
from service.store.values import Resumable
from service.tracking.backfill import BackfillTracker
from service.tracking.fitness import why_not
from service.wearables.contract import Wearable

logger = logging.getLogger(__name__)


class Device:
    """One device, from the first time it is heard."""

    def __init__(
        self,
        address: str,
        wearable: Wearable,
        lineup: Lineup,
        publish: Publish,
        *,
        name: str | None = None,
        journal: Journal | None = None,
    ) -> None:
        self.address = address
        self.name = name
        self.rssi_dbm: int | None = None
        self.wearable = wearable
        self.lineup = lineup
        self._asked_lineup = lineup.plain()
        """As the service was told to count when the session began."""
        self._publish = publish
        self.session = self._new_session(journal)
        self.calibrations = Calibrations(self.session)
        self.state = State.SEEN
        self.reason: str | None = None
        self.since_ns = time.time_ns()
        self.wanted = False
        self.not_before_s = 0.0
        """Monotonic time before which no attempt is made."""
        self.task: asyncio.Task[None] | None = None
        self.keeping: asyncio.Task[None] | None = None
        """Has what the session tells stored."""
        self.on_new_session: Callable[[Device], None] = lambda _: None
        """Called when another session has begun, to begin keeping it."""
        self._failures = 0
        self._told_s = 0.0

    @classmethod
    def restored(cls, found: Resumable, wearable: Wearable, publish: Publish, journal: Journal) -> Device:
        """Return the device of a stored session as it was at its last snapshot; what was stored since is to be replayed.

        SnapshotError, CounterError, ParameterError or KeyError where
        the session cannot go on.
        """
        about = found.about or {}
        kept = Lineup.from_plain(about["lineup"])
        device = cls(about["address"], wearable, kept, publish, name=about["name"], journal=journal)
        device._asked_lineup = about["asked"]
        device.wanted = about["wanted"]
        device.state = State.LOST if device.wanted else State.DISCONNECTED
        device.session.resume(found)
        return device

    def obey(self, lineup: Lineup) -> None:
        """Count as the service is told to now, if that is not what it was told when the session began."""
        if self._asked_lineup == lineup.plain():
            return
        self._asked_lineup = lineup.plain()
        try:
            self.count_with(lineup)
        except CounterError as error:
            logger.warning("%s goes on with its counters: %s", self.id, error)

    def _new_session(self, journal: Journal | None) -> Session:
        tracker = BackfillTracker(self.wearable, self.lineup.makers, primary=self.lineup.primary)
        return Session(lambda: self.id, tracker, self._publish, journal, self._about)

    def _about(self) -> dict[str, object]:
        """Return what a restart needs beside the count, as plain data."""
        return {
            "address": self.address,
            "name": self.name,
            "wanted": self.wanted,
            "lineup": self.lineup.plain(),
            "asked": self._asked_lineup,
        }

    @property
    def id(self) -> str:
        """The id the device gave itself; its address until it has."""
        return self.session.tracker.info.device or self.address

    @property
    def is_due(self) -> bool:
        """Whether an advertisement should start an attempt now."""
        return self.wanted and self.state in WAITING and time.monotonic() >= self.not_before_s

    def count_with(self, lineup: Lineup) -> None:
        """Go on with these counters; CounterError where the device is known to lack what the primary needs."""
        registry.require_sensors(lineup.primary, self.session.tracker.info.sensors)
        self.lineup = lineup
        self.session.change_counters(lineup)

    def require_streaming(self) -> None:
        """Raise NotNowError unless the device streams."""
        if self.state is not State.STREAMING:
            raise NotNowError(f"{self.id} is {self.state.value}: connect it first, then begin")

    def calibrate(self, plan: Plan) -> Calibration:
        """Begin a calibration; NotNowError where it cannot be now, CounterError where the counter cannot count it."""
        self.require_streaming()
        name = plan.choice.name
        if (why := why_not(name, registry.kind(name).sensors, self.session.tracker.stream)) is not None:
            raise CounterError(why)
        return self.calibrations.begin(plan)

    def heard(self, sighting: Sighting, *, tell_every_s: float) -> None:
        """Take an advertisement."""
        self.name, self.rssi_dbm = sighting.name or self.name, sighting.rssi_dbm
        if time.monotonic() - self._told_s >= tell_every_s:
            self._told_s = time.monotonic()
            self.session.tell(DeviceChanged(), time.time_ns())

    def move(self, cause: Cause, reason: str | None = None) -> None:
        """Move the connection's state on, and tell."""
        self.state = advance(self.state, cause)
        self.reason, self.since_ns = reason, time.time_ns()
        self.session.state_changed(self.state, reason)

    def want(self) -> None:
        """Have it connected as soon as it is heard."""
        self.wanted = True
        self.not_before_s, self._failures = 0.0, 0
        if self.state is State.DISCONNECTED:
            self.move(Cause.WANTED)

    def unwant(self) -> None:
        """Close its link and leave it alone."""
        self.wanted = False
        self.move(Cause.UNWANTED)
        self.stop()

    def stop(self) -> None:
        """Close its link."""
        if self.task is not None:
            self.task.cancel()

    async def close(self) -> None:
        """Close its link, and store what is not stored yet."""
        await self._rest()
        await self.session.close()

    async def end_session(self) -> None:
        """End the session and begin another that counts from nothing; a wanted device is connected again by itself."""
        wanted = self.wanted
        await self._rest()
        await self.session.close(ended=True)
        self._begin_anew()
        if wanted:
            self.want()

    async def drop_session(self) -> None:
        """Leave the device alone, keep nothing of its session, and begin another that counts from nothing."""
        if self.wanted:
            self.unwant()
        await self._rest()
        self.session.journal.drop()
        self._begin_anew()

    async def _rest(self) -> None:
        """Close its link and stop storing; return when both have ended."""
        self.stop()
        for task in (self.task, self.keeping):
            if task is not None:
                task.cancel()
                await asyncio.wait({task})

    def _begin_anew(self) -> None:
        self.calibrations.leave()
        before = self.session
        self.session = self._new_session(before.journal.successor())
        self.session.take_over(before)
        self.calibrations = Calibrations(self.session)
        self.session.tell(DeviceChanged(), time.time_ns())
        self.on_new_session(self)

    async def run(self, link: Link, settled: asyncio.Event, jitter: Callable[[], float]) -> None:
        """Hold the link until it is lost or no longer wanted; `settled` is set once it is connected or has failed."""
        connected_s: float | None = None
        try:
            async with link:
                connected_s = time.monotonic()
                self.move(Cause.CONNECTED)
                settled.set()
                await self.session.follow(link)
        except LinkError as error:
            self._lost(error.why, connected_s, jitter())
        except Exception as error:
            logger.exception("link of %s", self.address)
            self._lost(f"an internal error: {error!r}", connected_s, jitter())

    def _lost(self, why: str, connected_s: float | None, jitter: float) -> None:
        """Note that the link failed or was lost, and when to try again."""
        if self.state not in LINKED:
            return
        if connected_s is not None and time.monotonic() - connected_s >= HEALTHY_S:
            self._failures = 0
        self._failures += 1
        self.not_before_s = time.monotonic() + backoff_s(self._failures, jitter)
        self.move(Cause.FAILED if connected_s is None else Cause.DROPPED, why)
