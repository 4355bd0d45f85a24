"""The store as the service uses it: awaited from the event loop, written by one thread, read by a few others.

The queue to the writer is bounded by `queue_batches`. Policy: block; who has waited for room for `patience_s` is told
why nothing is written (StoreError). Readers have connections of their own and never wait for the writer.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sqlite3
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from filelock import FileLock, Timeout

from service.errors import StoreError, StoreFault
from service.store import database, keeping
from service.store.contract import Keeper, Recorder
from service.store.faults import told
from service.store.keeping import Retention
from service.store.reader import Reader
from service.store.values import Batch
from service.store.writer import RETRY_S, Connect, Done, Job, Writer, WriterStatistics

PATIENCE_S = 5.0
"""Longest wait for room in the queue."""
CLOSE_S = 2.0
"""Longest wait for the writer at the end: the service exits within three seconds."""
READERS = 2
"""Threads that read: one long export leaves one for everybody else."""

_BUSY = "the disk is too slow for what arrives: record fewer devices or move the database to a faster disk"

Result = TypeVar("Result")

logger = logging.getLogger(__name__)


class Store:
    """A store that is open; made by `open_store`."""

    def __init__(self, path: Path, writer: Writer, *, queue_batches: int, patience_s: float) -> None:
        self.path = path
        self._writer = writer
        self._room = asyncio.Semaphore(queue_batches)
        self._patience_s = patience_s
        self._threads = ThreadPoolExecutor(max_workers=READERS, thread_name_prefix="store reader")
        self._own = threading.local()
        self._connections: list[sqlite3.Connection] = []
        self._waiting: set[asyncio.Future[Any]] = set()

    async def append(self, batch: Batch) -> None:
        """Store a batch; return when it is on the disk. StoreError where it is refused, or finds no room in time."""
        try:
            async with asyncio.timeout(self._patience_s):
                await self._room.acquire()
        except TimeoutError:
            raise self.statistics().trouble or StoreError(StoreFault.BUSY, _BUSY) from None
        await self._ordered(lambda done: self._writer.put(batch, done), self._room.release)

    async def read(self, query: Callable[[Reader], Result]) -> Result:
        """Return what `query` reads, in a thread of its own."""
        return await asyncio.get_running_loop().run_in_executor(self._threads, self._read, query)

    async def assign(self, device: str, person: str) -> int:
        """Make a person the owner of a device and of its sessions that have none; return the number of sessions."""
        return await self._run(lambda scribe: keeping.assign(scribe, device, person))

    async def forget(self, person: str) -> int:
        """Delete all data of a person for good; return the number of sessions deleted.

        What is still appended to these sessions is refused (`gone`): stop them before.
        """
        return await self._run(lambda scribe: keeping.forget(scribe, person))

    async def go_on_forgetting(self) -> int:
        """Finish deletions that a crash or a full disk interrupted; return the number of sessions deleted."""
        return await self._run(keeping.go_on_forgetting)

    async def retain(self, policy: Retention) -> int:
        """Delete what may not stay, oldest first, and shrink the file; return the number of rows deleted."""
        return await self._run(lambda scribe: keeping.retain(scribe, policy))

    def statistics(self) -> WriterStatistics:
        """Return how full the queue is, how long commits take, and why nothing is written where that is so."""
        return self._writer.statistics()

    async def _run(self, job: Job) -> int:
        rows: int = await self._ordered(lambda done: self._writer.run(job, done), lambda: None)
        return rows

    async def _ordered(self, order: Callable[[Done], None], settled: Callable[[], None]) -> Any:  # noqa: ANN401
        """Hand an order to the writer and wait for it; `settled` is called when it is done, even if nobody waits."""
        loop = asyncio.get_running_loop()
        future = loop.create_future()

        def settle(fault: StoreError | None, result: object) -> None:
            settled()
            if future.done():
                return
            if fault is None:
                future.set_result(result)
            else:
                future.set_exception(fault)

        def done(fault: StoreError | None, result: object) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody waits
                loop.call_soon_threadsafe(settle, fault, result)

        try:
            order(done)
        except StoreError:
            settled()
            raise
        self._waiting.add(future)
        future.add_done_callback(self._waiting.discard)
        return await future

    def _read(self, query: Callable[[Reader], Result]) -> Result:
        reader = getattr(self._own, "reader", None)
        if reader is None:
            with told(self.path):
                connection = database.connect_reader(self.path)
            self._connections.append(connection)
            reader = self._own.reader = Reader(connection, self.path)
        return query(reader)

    async def close(self) -> None:
        """End every reader, then write what is queued, within CLOSE_S, and end the writer.

        The writer is the last, so that the journal is emptied into the database: the one file is all there is.
        """
        for connection in self._connections:
            connection.interrupt()
        await asyncio.to_thread(self._threads.shutdown, cancel_futures=True)
        for connection in self._connections:
            connection.close()
        if not await asyncio.to_thread(self._writer.close, CLOSE_S):
            for future in [future for future in self._waiting if not future.done()]:
                future.set_exception(StoreError(StoreFault.CLOSED, "the disk did not answer before the store closed"))


PROMISES: tuple[type[Recorder], type[Keeper]] = (Store, Store)
"""The contract that the type checker holds a Store to."""


@contextlib.asynccontextmanager
async def open_store(
    path: Path,
    *,
    queue_batches: int,
    patience_s: float = PATIENCE_S,
    retry_s: float = RETRY_S,
    connect: Connect = database.connect_writer,
) -> AsyncIterator[Store]:
    """Open the database at `path`, made or migrated where needed; StoreError says why it cannot be.

    One process at a time: another one's events would be numbered as ours. A deletion that was begun before a crash is
    gone on with. Leaving writes what is queued and closes.
    """
    async with _alone(path):
        await asyncio.to_thread(database.prepare, path)
        async with _opened(path, queue_batches, patience_s, retry_s, connect) as store:
            yield store


@contextlib.asynccontextmanager
async def _alone(path: Path) -> AsyncIterator[None]:
    """Hold a lock beside the database, which the system lets go of however the process ends."""
    lock = FileLock(path.with_name(f"{path.name}.lock"), timeout=0)
    with told(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire()
        except Timeout:
            why = f"{path} is in use by another steplink: end it, or name another file with --store"
            raise StoreError(StoreFault.IN_USE, why) from None
    try:
        yield
    finally:
        lock.release()


@contextlib.asynccontextmanager
async def _opened(
    path: Path, queue_batches: int, patience_s: float, retry_s: float, connect: Connect
) -> AsyncIterator[Store]:
    writer = Writer(path, connect=connect, retry_s=retry_s)
    store = Store(path, writer, queue_batches=queue_batches, patience_s=patience_s)
    writer.start()
    try:
        try:
            await store.go_on_forgetting()
        except StoreError as error:
            if not error.is_passing:
                raise
            logger.warning("a person's deletion waits for the next start: %s", error)
        yield store
    finally:
        await store.close()
