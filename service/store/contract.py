"""What every store promises, as three seams: who records, who reads, who keeps house.

    async with open_store(path, queue_batches=…) as store:
        await store.append(batch)                              # returns when it is on the disk
        page = await store.read(lambda reader: reader.log(LogQuery(device="sim-1")))
        await store.retain(Retention(raw_bytes=10 << 30))

A batch is stored as a whole or not at all, in the order of the calls; storing it again changes nothing. Nothing blocks
the event loop. Whatever goes wrong is a StoreError; `is_passing` ones end by themselves or by somebody's help, and
meanwhile up to `queue_batches` batches wait and are not lost.
"""

from __future__ import annotations

from typing import Protocol

from service.samples import Sensor
from service.store.keeping import Retention
from service.store.signal import RawSignal
from service.store.values import (
    Batch,
    Cursor,
    LogPage,
    LogQuery,
    ReplayPage,
    Resumable,
    SessionKey,
    StoredDevice,
    StoredSession,
)
from service.store.writer import WriterStatistics


class Reading(Protocol):
    """What there is and what happened, as it stands at the call."""

    def devices(self) -> list[StoredDevice]:
        """Return every device, by id."""

    def sessions(self, device: str | None = None) -> list[StoredSession]:
        """Return the sessions of one device or of all, oldest first."""

    def log(self, query: LogQuery) -> LogPage:
        """Return a page of a device's events, in order of their numbers."""


class RawReading(Protocol):
    """What devices sent."""

    def resume(self) -> list[Resumable]:
        """Return the open sessions, oldest first, with all that is needed to go on."""

    def replay(self, key: SessionKey, after: Cursor | None = None, *, limit: int = ...) -> ReplayPage:
        """Return chunks and descriptions from the sample `after` on, in order, each sample once; a page of it."""

    def raw(
        self,
        key: SessionKey,
        *,
        sensor: Sensor = ...,
        start: Cursor | None = None,
        stop: Cursor | None = None,
    ) -> RawSignal:
        """Return a session's samples of one sensor as one array, each sample once."""


class Recorder(Protocol):
    """Takes what sessions tell."""

    async def append(self, batch: Batch) -> None:
        """Store a batch; return when it is on the disk."""

    def statistics(self) -> WriterStatistics:
        """Return how full the queue is, how long commits take, and why nothing is written where that is so."""


class Keeper(Protocol):
    """Decides what stays, and whose it is."""

    async def assign(self, device: str, person: str) -> int:
        """Make a person the owner of a device and of its sessions that have none; return the number of sessions."""

    async def forget(self, person: str) -> int:
        """Delete all data of a person for good; return the number of sessions deleted."""

    async def retain(self, policy: Retention) -> int:
        """Delete what may not stay, oldest first; return the number of rows deleted."""
