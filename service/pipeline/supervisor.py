"""The supervisor: knows every device, keeps the wanted ones connected, one connect at a time.

It scans until a wanted device is heard whose back-off has passed, stops the scanner (adapters do one thing at a time),
connects from that fresh scan result, and scans on. Each link lives in a task of its own; a lost one leaves its session
as it is and the device is looked for again. No Bluetooth at all is a state that is told, and tried again.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import AsyncIterator, Callable, Collection

from service.errors import LinkError, NotNowError, StoreError, UnknownDeviceError
from service.links.ble import PLATFORM, Backend, BleLink, Sighting, scanning
from service.pipeline.archive import Archive
from service.pipeline.device import Device
from service.pipeline.hub import Hub
from service.pipeline.journal import Journal
from service.pipeline.lifecycle import Cause
from service.pipeline.lineup import Lineup
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
        archive: Archive | None = None,
    ) -> None:
        self.hub = hub
        self._archive = archive
        self._tasks: asyncio.TaskGroup | None = None
        self.trouble: LinkError | None = None
        """Why nothing can be heard at the moment; None while the scanner works."""
        self._make_wearable = make_wearable
        self._lineup = lineup
        self._wanted = None if wanted is None else frozenset(word.casefold() for word in wanted)
        self._backend = backend
        self._devices: dict[str, Device] = {}
        """By address."""

    @property
    def devices(self) -> list[Device]:
        """Every device heard or connected since the start, in that order."""
        return list(self._devices.values())

    def device(self, key: str) -> Device:
        """Return the device with this id or address; UnknownDeviceError where there is none."""
        for device in self._devices.values():
            if key in {device.id, device.address}:
                return device
        raise UnknownDeviceError(key)

    def connect(self, key: str) -> Device:
        """Want a device connected; it happens as soon as it is heard, without waiting for a back-off."""
        device = self.device(key)
        device.want()
        return device

    def disconnect(self, key: str) -> Device:
        """Close a device's link, and leave it alone until it is wanted again."""
        device = self.device(key)
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
        """Delete all data of a person for good; return how many sessions were deleted, and whose devices were in use."""
        return await self._kept.forget(person, self.devices)

    @property
    def _kept(self) -> Archive:
        if self._archive is None:
            raise NotNowError("nothing is stored: start the service with --store")
        return self._archive

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Go on with stored sessions, scan and connect while the context is open; leaving it closes every link."""
        async with asyncio.TaskGroup() as tasks:
            keeping = [tasks.create_task(self._archive.keep_house(), name="house")] if self._archive else []
            self._tasks = tasks
            if self._archive is not None:
                for device in await self._archive.resume(self._make_wearable, self._lineup, self.hub):
                    self._remember(device)
            keeping.append(tasks.create_task(self._run(tasks), name="supervisor"))
            try:
                yield
            finally:
                for task in keeping:
                    task.cancel()
                await asyncio.gather(*(device.close() for device in self._devices.values()), return_exceptions=True)
                self._tasks = None

    def _remember(self, device: Device) -> None:
        """Take a device into the table, and keep what its session tells."""
        self._devices[device.address] = device
        device.on_new_session = self._keep
        self._keep(device)

    def _keep(self, device: Device) -> None:
        if self._tasks is not None:
            device.keeping = self._tasks.create_task(device.session.keep(), name=f"keep {device.address}")

    async def _run(self, tasks: asyncio.TaskGroup) -> None:
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
            async with scanning(services, self._backend) as sightings:
                self.trouble = None
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(SCAN_STRETCH_S):
                        async for sighting in sightings:
                            if (device := self._heard(sighting)).is_due:
                                return device, sighting

    def _heard(self, sighting: Sighting) -> Device:
        device = self._devices.get(sighting.address)
        if device is None:
            wearable = self._make_wearable()
            journal = Journal(self._archive.store) if self._archive else None
            device = Device(
                sighting.address, wearable, self._lineup, self.hub.publish, name=sighting.name, journal=journal
            )
            device.wanted = self._is_wanted(sighting)
            self._remember(device)
        device.heard(sighting, tell_every_s=SEEN_EVERY_S)
        return device

    def _is_wanted(self, sighting: Sighting) -> bool:
        if self._wanted is None:
            return True
        return not self._wanted.isdisjoint({sighting.address.casefold(), (sighting.name or "").casefold()})

    async def _connect(self, device: Device, sighting: Sighting, tasks: asyncio.TaskGroup) -> None:
        """Start the device's link task and wait until it is connected or has failed."""
        if device.task is not None and not device.task.done():
            await asyncio.wait({device.task})
        if not device.is_due:  # while the scanner stopped or the old link closed, the device was disconnected
            return
        settled = asyncio.Event()
        device.move(Cause.ATTEMPT)
        link = BleLink(sighting.handle, device.wearable.handshake(), self._backend)
        device.task = tasks.create_task(device.run(link, settled, random.random), name=f"link {device.address}")
        device.task.add_done_callback(lambda _: settled.set())
        await settled.wait()
