"""The store as the pipeline uses it: sessions that go on after a restart, and a house that is kept.

At the start every open session comes back as a Device: its counters from the last snapshot, then counted on over the
samples stored since, so that it stands where it stood; what its device measured meanwhile is asked of it when it is
heard. A session whose counters this steplink no longer knows is ended, and its device begins a new one.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from service.errors import CounterError, ParameterError, SnapshotError, StoreError, UnknownPersonError
from service.pipeline.device import Device
from service.pipeline.hub import Hub
from service.pipeline.journal import Journal
from service.pipeline.lineup import Lineup
from service.store.keeping import Retention
from service.store.reader import Reader
from service.store.store import Store
from service.store.values import Batch, Cursor, ReplayPage, Resumable, SessionKey
from service.wearables.contract import Wearable

DAY_NS = 86_400_000_000_000
HOUSE_S = 600.0
"""How often what has grown too old or too large is deleted."""
SLICE_S = 0.005
"""Longest stretch of a replay without a pause for others."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Keep:
    """How long things stay: raw samples by age and by the database's size, events by age. 0: without a limit."""

    raw_days: float = 0.0
    raw_mb: float = 0.0
    log_days: float = 0.0

    def retention(self, now_ns: int) -> Retention | None:
        """Return what may stay at this moment; None where everything may."""
        policy = Retention(
            raw_since_ns=_since(now_ns, self.raw_days),
            raw_bytes=round(self.raw_mb * 1e6) or None,
            log_since_ns=_since(now_ns, self.log_days),
        )
        return None if policy == Retention() else policy


def _page(key: SessionKey, after: Cursor | None, reader: Reader) -> ReplayPage:
    return reader.replay(key, after)


def _since(now_ns: int, days: float) -> int | None:
    return now_ns - round(days * DAY_NS) if days else None


class Archive:
    """A store, and how long what is in it stays."""

    def __init__(self, store: Store, keep: Keep | None = None) -> None:
        self.store = store
        self._keep = keep or Keep()
        self._ordinals: dict[str, int] = {}

    @property
    def trouble(self) -> StoreError | None:
        """Why nothing is stored at the moment; None while all is well."""
        return self.store.statistics().trouble

    def journal(self) -> Journal:
        """Return a new journal over the store."""
        return Journal(self.store, lambda device: self._ordinals.get(device, 0))

    async def resume(self, make_wearable: Callable[[], Wearable], lineup: Lineup, hub: Hub) -> list[Device]:
        """Return the devices of all open sessions, each as it stood when it was last stored."""
        self._ordinals = {one.device: one.last_ordinal for one in await self.store.read(lambda r: r.devices())}
        open_ones = await self.store.read(lambda r: r.resume())
        newest = {found.key.device: found for found in open_ones}
        devices = []
        for found in open_ones:
            if newest[found.key.device].key != found.key:  # its end found no way to the disk
                await self._end(found)
                continue
            try:
                device = Device.restored(found, make_wearable(), hub.publish, self.journal())
                await self._replay(device, found)
                device.obey(lineup)
            except (SnapshotError, CounterError, ParameterError) as error:
                logger.warning("the session of %s cannot go on and a new one begins: %s", found.key.device, error)
                await self._end(found)
            except Exception:  # whatever is wrong with one must not keep the others from going on
                logger.exception("the session of %s cannot go on and a new one begins", found.key.device)
                await self._end(found)
            else:
                devices.append(device)
        return devices

    async def _end(self, found: Resumable) -> None:
        with contextlib.suppress(StoreError):  # then it is tried again at the next start
            await self.store.append(Batch(session=found.key, ended_ns=time.time_ns()))

    async def _replay(self, device: Device, found: Resumable) -> None:
        """Count again what was stored after the last snapshot."""
        after = found.snapshot.cursor if found.snapshot else None
        while True:
            page = await self.store.read(functools.partial(_page, found.key, after))
            began_s = time.monotonic()
            for item in page.items:
                device.session.replay(item, found.cursor)
                if time.monotonic() - began_s > SLICE_S:
                    await asyncio.sleep(0)
                    began_s = time.monotonic()
            if page.after is None:
                break
            after = page.after

    async def keep_house(self) -> None:
        """Delete what may not stay, for ever again."""
        while True:
            policy = self._keep.retention(time.time_ns())
            if policy is not None:
                try:
                    rows = await self.store.retain(policy)
                except StoreError as error:
                    logger.warning("old samples could not be deleted, trying again later: %s", error)
                else:
                    if rows:
                        logger.info("%d old rows deleted", rows)
            await asyncio.sleep(HOUSE_S)

    async def assign(self, device: Device, person: str) -> None:
        """Make a person the owner of a device and of its session; another person's session ends, and one begins."""
        owners = await self.store.read(lambda r: {one.key: one.person for one in r.sessions(device.id)})
        key = device.session.journal.key
        await self.store.assign(device.id, person)  # first: the session that then begins is theirs
        if key is not None and owners.get(key) not in {None, person}:
            await device.end_session()

    async def forget(self, person: str, devices: Iterable[Device]) -> tuple[int, list[Device]]:
        """Delete all data of a person for good; return how many sessions were deleted, and devices that were in use.

        UnknownPersonError where there are none. Those devices are disconnected and left alone; they count from nothing
        when they are wanted again.
        """
        owners = await self.store.read(lambda r: {one.key: one.person for one in r.sessions()})
        owned = await self.store.read(lambda r: {one.device for one in r.devices() if one.person == person})
        concerned = [
            device
            for device in devices
            if (key := device.session.journal.key) is not None
            and (owners[key] == person if key in owners else device.id in owned)
        ]
        if person not in owners.values() and not owned:
            raise UnknownPersonError(person)
        for device in concerned:
            await device.drop_session()
        return await self.store.forget(person), concerned
