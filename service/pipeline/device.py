"""A device as the service knows it: its connection's state, its session, and the task that holds its link."""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections.abc import Callable

from service.counters import registry
from service.errors import CounterError, LinkError, LinkFault, NotNowError
from service.links.contract import Link
from service.pipeline.calibration import Calibration, Plan
from service.pipeline.calibrations import Calibrations
from service.pipeline.journal import Journal
from service.pipeline.lifecycle import LINKED, PATIENCE, WAITING, Cause, Patience, Standing, State
from service.pipeline.lineup import Lineup
from service.pipeline.notices import DeviceChanged
from service.pipeline.session import Publish, Session
from service.store.values import Resumable
from service.tracking.backfill import BackfillTracker
from service.tracking.fitness import why_not
from service.wearables.contract import Wearable

logger = logging.getLogger(__name__)

TWIN_WAIT_S = 300.0
"""Wait before a device is tried again that calls itself by the name of one which is connected."""
TWIN_GRACE_S = 5.0
"""Once that one has been lost for so long, its twin is tried at once: it may be the same, under a new address."""
FORGET_S = 1800.0
"""An address that never told an id is kept for so long after it was last heard; private ones change every 15 min."""
UNHEARD = "not heard since the service started"


class Device:
    """One device, from the first time it is heard; or, without `rssi_dbm`, known from before and not heard yet."""

    def __init__(
        self,
        *,
        address: str,
        name: str | None = None,
        rssi_dbm: int | None = None,
        wearable: Wearable,
        lineup: Lineup,
        publish: Publish,
        patience: Patience = PATIENCE,
        journal: Journal | None = None,
    ) -> None:
        self.address = address
        self.name = name
        self.rssi_dbm = rssi_dbm
        self.wearable = wearable
        self.lineup = lineup
        self._told_lineup = lineup.plain()
        """As the service was told to count when the session began."""
        self._publish = publish
        self.session = self._new_session(journal)
        self.calibrations = Calibrations(self.session)
        self.reason: str | None = UNHEARD if rssi_dbm is None else None
        self.since_ns = time.time_ns()
        self._told_id: str | None = None
        """The id it told in a session before."""
        self.wanted = False
        self.spared = False
        """Whether it is left alone for the sake of an option, and not because somebody asked for that."""
        self.asked = False
        """Whether somebody asked for it to be connected, as opposed to an option that wants all or some."""
        self.twin: Device | None = None
        """The connected device for whose sake this one was turned away."""
        self.task: asyncio.Task[None] | None = None
        self.keep: Callable[[Session], asyncio.Task[None]] | None = None
        """Begins to keep what a session tells, from the first link on; None where nothing is stored."""
        self._keeping: asyncio.Task[None] | None = None
        self._patience = patience
        self._standing = Standing(state=State.LOST if rssi_dbm is None else State.SEEN)
        self._fault: LinkFault | None = None
        """Why the last attempt failed or the last link was lost."""
        self._moved_s = self._heard_s = time.monotonic()
        self._told_s = 0.0

    @classmethod
    def restored(cls, found: Resumable, wearable: Wearable, publish: Publish, journal: Journal) -> Device:
        """Return the device of a stored session as its last snapshot has it; what was stored since is to be replayed.

        SnapshotError, CounterError, ParameterError or KeyError where the session cannot go on.
        """
        about = found.about or {}
        device = cls(
            address=about["address"],
            name=about["name"],
            wearable=wearable,
            lineup=Lineup.from_plain(about["lineup"]),
            publish=publish,
            journal=journal,
        )
        device._told_lineup = about["told_lineup"]
        device.wanted, device.asked = about["wanted"], about["asked"]
        device.session.resume(found)
        return device

    def obey(self, lineup: Lineup) -> None:
        """Count as the service is told to now, if that is not what it was told when the session began."""
        if self._told_lineup == lineup.plain():
            return
        self._told_lineup = lineup.plain()
        try:
            self.count_with(lineup)
        except CounterError as error:
            logger.warning("%s goes on with its counters: %s", self.id, error)

    def begin_keeping(self) -> None:
        """Have what the session tells stored, from now on."""
        if self._keeping is None and self.keep is not None:
            self._keeping = self.keep(self.session)

    def _new_session(self, journal: Journal | None) -> Session:
        tracker = BackfillTracker(self.wearable, self.lineup.makers, primary=self.lineup.primary)
        return Session(lambda: self.id, tracker, self._publish, journal, self._about, self.wearable.history)

    def _about(self) -> dict[str, object]:
        """Return what a restart needs beside the count, as plain data."""
        return {
            "address": self.address,
            "name": self.name,
            "wanted": self.wanted or self.spared,
            "asked": self.asked,
            "lineup": self.lineup.plain(),
            "told_lineup": self._told_lineup,
            "after": self.session.after,
        }

    @property
    def id(self) -> str:
        """The id the device gave itself; its address until it has."""
        return self.session.tracker.info.device or self._told_id or self.address

    @property
    def is_provisional(self) -> bool:
        """Whether the device has not told its id yet."""
        return self.session.tracker.info.device is None and self._told_id is None

    @property
    def is_forgettable(self) -> bool:
        """Whether it is but an address that has not been heard for long: a private one, changed since."""
        return self.is_provisional and self.state in WAITING and time.monotonic() - self._heard_s >= FORGET_S

    @property
    def state(self) -> State:
        """Where its connection stands."""
        return self._standing.state

    @property
    def not_before_s(self) -> float:
        """Monotonic time before which no attempt is made."""
        return self._standing.not_before_s

    @property
    def is_due(self) -> bool:
        """Whether an advertisement should start an attempt now."""
        if not self.wanted:
            return False
        return self._standing.is_due(time.monotonic()) or (self.state in WAITING and self._twin_is_gone())

    def count_with(self, lineup: Lineup) -> None:
        """Go on with these counters; CounterError where the device is known to lack what the primary needs."""
        registry.require_sensors(lineup.primary, self.session.tracker.info.sensors)
        before, self.lineup = self.lineup, lineup
        try:
            self.session.change_counters(lineup)
        except Exception:
            self.lineup = before
            raise

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

    def heard(self, name: str | None, rssi_dbm: int, *, tell_every_s: float) -> None:
        """Take an advertisement."""
        self.name, self.rssi_dbm = name or self.name, rssi_dbm
        self._heard_s = time.monotonic()
        if time.monotonic() - self._told_s >= tell_every_s:
            self.describe()

    def moved_to(self, other: Device) -> None:
        """Go on under the address of `other`, which turned out to be this one."""
        self.address, self.name, self.rssi_dbm = other.address, other.name or self.name, other.rssi_dbm
        if other.asked and not self.wanted:
            self.want()
        self.describe()

    def describe(self) -> None:
        """Tell that the device's description has changed."""
        self._told_s = time.monotonic()
        self.session.tell(DeviceChanged(), time.time_ns())

    def move(self, cause: Cause, reason: str | None = None, *, least_s: float = 0.0) -> None:
        """Move the connection's state on, and tell."""
        self._moved_s = time.monotonic()
        how = {"jitter": random.random(), "least_s": least_s}  # noqa: S311  # no secret
        self._standing = self._standing.after(cause, now_s=self._moved_s, patience=self._patience, **how)
        self.reason, self.since_ns = reason, time.time_ns()
        self.session.state_changed(self.state, reason)

    def want(self) -> None:
        """Have it connected as soon as it is heard."""
        self.wanted, self.asked, self.spared = True, True, False
        if self.state is State.DISCONNECTED:
            self.move(Cause.WANTED)
        else:
            self._standing = self._standing.after(Cause.WANTED, now_s=time.monotonic())

    def unwant(self) -> None:
        """Close its link and leave it alone."""
        self.wanted = self.asked = False
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
        wanted, asked = self.wanted, self.asked
        if wanted:
            self.unwant()
        await self._rest()
        await self.session.close(ended=True)
        self._begin_anew()
        if wanted:
            self.want()
            self.asked = asked

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
        for task in (self.task, self._keeping):
            if task is not None:
                task.cancel()
                await asyncio.wait({task})
        self._keeping = None

    def _begin_anew(self) -> None:
        self.calibrations.leave()
        self._told_id = self.session.tracker.info.device
        before = self.session
        self.session = self._new_session(before.journal.successor())
        self.session.take_over(before)
        self.calibrations = Calibrations(self.session)
        self.describe()

    async def run(self, link: Link, on_connected: Callable[[], None]) -> None:
        """Follow an open link until it is lost (LinkError) or the task is cancelled."""
        self.move(Cause.CONNECTED)
        self.twin = None
        on_connected()
        self.begin_keeping()
        await self.session.follow(link)

    def lost(self, error: LinkError) -> None:
        """Note that the link failed or was lost, and why; nothing where it is not wanted any more."""
        if self.state not in LINKED:
            return
        # What BlueZ remembered of the services has been forgotten: once more at once, from then on with patience.
        again = error.reason is LinkFault.NOT_OURS and self._fault is LinkFault.NOT_OURS
        least_s = TWIN_WAIT_S if error.reason is LinkFault.TWIN else self._patience.cap_s if again else 0.0
        self._fault = error.reason
        self.move(Cause.FAILED if self.state is State.CONNECTING else Cause.DROPPED, error.why, least_s=least_s)

    def _twin_is_gone(self) -> bool:
        twin = self.twin
        return twin is not None and twin.state not in LINKED and time.monotonic() - twin._moved_s >= TWIN_GRACE_S  # noqa: SLF001  # its own kind
