"""The supervisor: knows every device, keeps the wanted ones connected for ever, one connect at a time.

It scans until a wanted device is heard whose back-off has passed, stops the scanner (adapters do one thing at a time),
connects from that fresh scan result, and scans on. Each link lives in a task of its own; a lost one leaves its session
as it is and the device is looked for again. A device that turns out to be one known already, under another address, is
that one: see the roster. No Bluetooth at all is a state that is told, and tried again.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Collection

from service.errors import LinkError, LinkFault, NotNowError, StoreError
from service.links.ble import DEFAULT_TIMEOUTS, PLATFORM, Backend, BleLink, Sighting, Timeouts, close_stale, scanning
from service.links.contract import Link
from service.pipeline.archive import Archive
from service.pipeline.compilation import Compilation
from service.pipeline.device import Device
from service.pipeline.hub import Hub
from service.pipeline.lifecycle import LINKED, PATIENCE, Cause, Patience
from service.pipeline.lineup import Lineup
from service.pipeline.roster import Roster, told_id
from service.pipeline.session import Session
from service.wearables.contract import Wearable

SCANNER_RETRY_S = 2.0
"""Wait before Bluetooth is tried again after the scanner could not start."""
SCAN_STRETCH_S = 10.0
"""A scan is begun anew so often: a radio that went away and came back is noticed by that."""
SEEN_EVERY_S = 5.0
"""A device that is heard but not connected is told of at most so often."""

logger = logging.getLogger(__name__)


class Supervisor:
    """All devices and their connections.

    `wanted` holds names and addresses to connect to as soon as they are heard; None means every device of a known
    kind. `make_wearable` gives the protocol, `lineup` the counters of a new device.
    """

    def __init__(
        self,
        *,
        hub: Hub,
        make_wearable: Callable[[], Wearable],
        lineup: Lineup,
        wanted: Collection[str] | None = None,
        backend: Backend = PLATFORM,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
        patience: Patience = PATIENCE,
        archive: Archive | None = None,
    ) -> None:
        self.hub = hub
        self.trouble: LinkError | None = None
        """Why nothing can be heard at the moment; None while the scanner works."""
        self._make_wearable = make_wearable
        self._lineup = lineup
        self._wanted = None if wanted is None else frozenset(word.casefold() for word in wanted)
        self._backend = backend
        self._timeouts = timeouts
        self._patience = patience
        self._roster = Roster()
        self._archive = archive
        self._tasks: asyncio.TaskGroup | None = None
        self._compilation = Compilation()

    @property
    def devices(self) -> list[Device]:
        """Every device remembered, heard or connected, in that order."""
        return self._roster.devices

    def device(self, key: str) -> Device:
        """Return the device with this id or address; UnknownDeviceError where there is none."""
        return self._roster.find(key)

    def remember(self, device: Device) -> None:
        """Take in a device of an earlier run, its session restored: it is wanted, and lost until it is heard.

        ValueError where the device is known already.
        """
        self._roster.add(device)
        device.keep = self._keep
        device.wanted = True

    def connect(self, key: str) -> Device:
        """Want a device connected; it happens as soon as it is heard, without waiting for a back-off."""
        device = self.device(key)
        device.want()
        return device

    def disconnect(self, key: str) -> Device:
        """Close a device's link, and leave it alone until it is wanted again."""
        device = self.device(key)
        device.spared = False
        if device.wanted:
            device.unwant()
        return device

    @property
    def store_trouble(self) -> StoreError | None:
        """Why nothing is stored at the moment; None while all is well, or where nothing is to be stored."""
        return None if self._archive is None else self._archive.trouble

    async def assign(self, key: str, person: str) -> None:
        """Make a person the owner of a device's data; UnknownDeviceError, NotNowError where nothing is stored."""
        await self._kept.assign(self.device(key), person)

    async def forget(self, person: str) -> tuple[int, list[Device]]:
        """Delete all data of a person for good; return how many sessions were deleted, and devices that were in use."""
        return await self._kept.forget(person, self.devices)

    @property
    def _kept(self) -> Archive:
        if self._archive is None:
            raise NotNowError("nothing is stored by this service")
        return self._archive

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Go on with stored sessions, scan and connect while the context is open; leaving it closes every link."""
        async with asyncio.TaskGroup() as tasks:
            self._tasks, own = tasks, []
            if self._archive is not None:
                for device in await self._archive.resume(self._make_wearable, self._lineup, self.hub):
                    self._take_up(device)
                own.append(tasks.create_task(self._archive.keep_house(), name="house"))
            own.append(tasks.create_task(self._run(tasks), name="supervisor"))
            try:
                yield
            finally:
                self._tasks = None
                for task in own:
                    task.cancel()
                await asyncio.gather(*(self._close(device) for device in self._roster.devices))

    async def _close(self, device: Device) -> None:
        try:
            await device.close()
        except Exception:  # what is wrong with one must not keep the others from being stored
            logger.exception("closing %s", device.id)

    def _take_up(self, device: Device) -> None:
        """Go on with a stored session; its device is left alone where it was, or where others only are wanted now."""
        was_wanted = device.wanted
        is_wanted = was_wanted and (device.asked or self._is_wanted(device.id, device.address, device.name))
        self.remember(device)
        device.begin_keeping()
        if not is_wanted:
            device.unwant()
            device.spared = was_wanted

    def _keep(self, session: Session) -> asyncio.Task[None]:
        if self._tasks is None:
            raise RuntimeError("the supervisor does not run")
        return self._tasks.create_task(session.keep(), name="keep")

    async def _run(self, tasks: asyncio.TaskGroup) -> None:
        await close_stale([device.address for device in self._roster.devices], self._backend)
        while True:
            try:
                await self._connect(*await self._hear_one_due(), tasks)
            except LinkError as error:
                if self.trouble is None or self.trouble.why != error.why:
                    logger.warning("nothing can be heard for now, trying again: %s", error.why)
                self.trouble = error
                await asyncio.sleep(SCANNER_RETRY_S)
            except Exception:  # a fault of ours in one round must not end them all
                logger.exception("the supervisor goes on after an internal error")
                await asyncio.sleep(SCANNER_RETRY_S)

    async def _hear_one_due(self) -> tuple[Device, Sighting]:
        """Scan until a device is heard that should be connected now."""
        services = self._make_wearable().services
        while True:
            self._roster.forget()
            async with scanning(services, self._backend, self._timeouts) as sightings:
                self.trouble = None
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(SCAN_STRETCH_S):
                        async for sighting in sightings:
                            if (device := self._heard(sighting)).is_due:
                                return device, sighting

    def _heard(self, sighting: Sighting) -> Device:
        device = self._roster.at(sighting.address)
        if device is None:
            device = self._new(sighting.address, sighting.name, sighting.rssi_dbm)
            device.wanted = self._is_wanted(sighting.address, sighting.name)
            self._roster.add(device)
        device.heard(sighting.name, sighting.rssi_dbm, tell_every_s=SEEN_EVERY_S)
        return device

    def _new(self, address: str, name: str | None = None, rssi_dbm: int | None = None) -> Device:
        device = Device(
            address=address,
            name=name,
            rssi_dbm=rssi_dbm,
            wearable=self._make_wearable(),
            lineup=self._lineup,
            publish=self.hub.publish,
            patience=self._patience,
            journal=self._archive.journal() if self._archive else None,
        )
        device.keep = self._keep
        return device

    def _is_wanted(self, *names: str | None) -> bool:
        return self._wanted is None or not self._wanted.isdisjoint(name.casefold() for name in names if name)

    async def _connect(self, device: Device, sighting: Sighting, tasks: asyncio.TaskGroup) -> None:
        """Start the device's link task and wait until it is connected or has failed."""
        if device.task is not None and not device.task.done():
            await asyncio.wait({device.task})
        if not device.is_due:  # while the scanner stopped or the old link closed, the device was disconnected
            return
        settled = asyncio.Event()
        device.move(Cause.ATTEMPT)
        link = BleLink(sighting.handle, device.wearable.handshake(), self._backend, self._timeouts)
        device.task = tasks.create_task(self._hold(device, link, settled), name=f"link {device.address}")
        device.task.add_done_callback(lambda _: settled.set())
        self._compilation.consider(sum(one.state in LINKED for one in self._roster.devices), self._lineup.makers)
        await settled.wait()

    async def _hold(self, device: Device, link: Link, settled: asyncio.Event) -> None:
        """Hold a link until it is lost or its device no longer wanted; `settled` is set once it is connected."""
        try:
            async with link:
                device = self._introduced(device, link)
                if device.wanted:
                    await device.run(link, settled.set)
        except LinkError as error:
            fault = error
        except Exception as error:
            logger.exception("link of %s", device.address)
            fault = LinkError(LinkFault.REFUSED, f"an internal error: {error!r}")
        else:
            return
        if device.task is asyncio.current_task():  # else it has another link by now
            device.lost(fault)

    def _introduced(self, device: Device, link: Link) -> Device:
        """Return whose link it is, now that it told its id: the device dialled, or one known from elsewhere.

        LinkError where that one is connected already.
        """
        owner = self._roster.owner(device, told_id(self._make_wearable(), link.said), self._new)
        if owner is device:
            return device
        if owner.state in LINKED:
            device.twin = owner
            raise LinkError(LinkFault.TWIN, f"it calls itself {owner.id}, which is connected from {owner.address}")
        logger.info("%s is at %s now, it was at %s", owner.id, device.address, owner.address)
        owner.task, device.task = device.task, None
        owner.wanted = owner.wanted or owner not in self._roster.devices
        self._roster.hand_over(device, owner)
        if owner.wanted:
            owner.move(Cause.ATTEMPT)
        return owner
