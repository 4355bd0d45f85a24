"""The one thread that writes, over the one connection that may.

What is handed to it within GROUP_S is one transaction, on the disk before anybody is told that it is (group commit).
While the disk is full, read-only or held by another program, the same group is tried again every RETRY_S, and what
comes after waits its turn. A batch that contradicts the store is refused alone. Maintenance runs between groups, one
small transaction at a time, so that it never holds up recording.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.errors import StoreError, StoreFault
from service.store import database
from service.store.faults import store_error
from service.store.scribe import Scribe
from service.store.values import Batch

GROUP_S = 0.05
"""Longest wait for others that go into the same transaction."""
GROUP_BATCHES = 500
"""Batches that make a transaction large enough."""
RETRY_S = 1.0
"""Wait before what could not be written is tried again."""

Job = Callable[[Scribe], Generator[None, None, Any]]
"""Maintenance: pauses by `yield` between its transactions, returns its result."""
Done = Callable[[StoreError | None, Any], None]
"""Called in the writer's thread with what went wrong, or the result."""
Connect = Callable[[Path], sqlite3.Connection]

logger = logging.getLogger(__name__)


@dataclass(slots=True, kw_only=True)
class WriterStatistics:
    """How the writer does; `trouble` says why nothing can be written at the moment."""

    queued: int = 0
    commits: int = 0
    batches: int = 0
    refused: int = 0
    retries: int = 0
    last_commit_s: float = 0.0
    longest_commit_s: float = 0.0
    trouble: StoreError | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Order:
    batch: Batch
    done: Done
    at_s: float


class Writer:
    """Takes batches and jobs from any thread. `connect` opens the writing connection, at first and after a fault."""

    def __init__(self, path: Path, *, connect: Connect = database.connect_writer, retry_s: float = RETRY_S) -> None:
        self._path = path
        self._connect = connect
        self._retry_s = retry_s
        self._scribe: Scribe | None = None
        self._gone: set[Any] = set()
        self._orders: deque[_Order] = deque()
        self._jobs: deque[tuple[Job, Done]] = deque()
        self._running: tuple[Generator[None, None, Any], Done] | None = None
        self._closing = False
        self._changed = threading.Condition()
        self._told = WriterStatistics()
        self._thread = threading.Thread(target=self._run, name="store writer", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def put(self, batch: Batch, done: Done) -> None:
        """Have a batch written; StoreError once the writer is closing."""
        self._take(self._orders.append, _Order(batch=batch, done=done, at_s=time.monotonic()))

    def run(self, job: Job, done: Done) -> None:
        """Have a job done between groups."""
        self._take(self._jobs.append, (job, done))

    def close(self, within_s: float) -> bool:
        """Write what is queued, then end; tell whether it did within that time. What cannot be written is refused."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def statistics(self) -> WriterStatistics:
        """Return how it does."""
        return dataclasses.replace(self._told, queued=len(self._orders))

    def _take(self, append: Callable[[Any], None], order: object) -> None:
        with self._changed:
            if self._closing:
                raise StoreError(StoreFault.CLOSED, "the store is closed: start the service again")
            append(order)
            self._changed.notify_all()

    # In the thread

    def _run(self) -> None:
        group: list[_Order] | None = None
        try:
            while (group := self._gather()) is not None:
                if group:
                    self._record(group)
                group = None
                self._advance_job()
            self._drop_connection(last=True)
        finally:  # however it ends, nobody waits for ever
            with self._changed:
                self._closing = True
            closed = StoreError(StoreFault.CLOSED, "the store was closed before this was done: ask again")
            _tell([*(group or ()), *self._orders], closed)
            self._end_job(closed)
            for _, done in self._jobs:
                done(closed, None)

    def _gather(self) -> list[_Order] | None:
        """Wait for work; return the next group (none: there is only a job), None when all is done and closing."""
        with self._changed:
            self._changed.wait_for(lambda: self._orders or self._jobs or self._running or self._closing)
            if self._orders and not (self._jobs or self._running):
                rest_s = self._orders[0].at_s + GROUP_S - time.monotonic()
                self._changed.wait_for(lambda: self._closing or len(self._orders) >= GROUP_BATCHES, max(0.0, rest_s))
            group = [self._orders.popleft() for _ in range(min(len(self._orders), GROUP_BATCHES))]
            return None if not group and self._closing else group

    def _record(self, group: list[_Order]) -> None:
        """Write a group, however long that takes."""
        while (fault := self._attempt(group)) is not None:
            if not fault.is_passing and len(group) > 1:  # one of them is at fault: the others shall not suffer
                for order in group:
                    self._record([order])
                return
            if not fault.is_passing or not self._may_retry(fault):
                self._told.refused += len(group)
                self._told.trouble = fault if fault.reason is StoreFault.CORRUPT else self._told.trouble
                _tell(group, fault)
                return
        self._told.batches += len(group)
        _tell(group, None)

    def _attempt(self, group: list[_Order]) -> StoreError | None:
        """Write a group as one transaction; return what prevented it."""
        began_s = time.monotonic()
        try:
            scribe = self._ready_scribe()
            with database.transaction(scribe.connection):
                for order in group:
                    scribe.write(order.batch)
        except (sqlite3.Error, OSError) as error:
            fault = store_error(error, self._path)
            if fault.is_passing and fault.reason is not StoreFault.FULL:
                self._end_job(fault)
                self._drop_connection()
        except StoreError as error:
            fault = error
        except Exception as error:  # a value that no column takes: the caller's fault, and no reason to stop recording
            fault = StoreError(StoreFault.REFUSED, f"this cannot be stored: {error!r}")
        else:
            self._note_commit(time.monotonic() - began_s)
            return None
        if self._scribe is not None:
            self._scribe.forget_numbers()
        return fault

    def _note_commit(self, took_s: float) -> None:
        told = self._told
        if told.trouble is not None:
            logger.warning("recording goes on")
        told.commits, told.trouble = told.commits + 1, None
        told.last_commit_s, told.longest_commit_s = took_s, max(took_s, told.longest_commit_s)

    def _may_retry(self, fault: StoreError) -> bool:
        """Wait until it is time to try again; False if the store is being closed instead."""
        if self._told.trouble is None or self._told.trouble.reason is not fault.reason:
            logger.warning("nothing is recorded for now: %s", fault)
        self._told.trouble = fault
        self._told.retries += 1
        with self._changed:
            return not self._changed.wait_for(lambda: self._closing, self._retry_s)

    def _advance_job(self) -> None:
        """Do one transaction of the job at hand, or of the next."""
        try:
            if self._running is None:
                if not self._jobs:
                    return
                job, done = self._jobs.popleft()
                self._running = _first_then(job, self._ready_scribe), done
            next(self._running[0])
        except StopIteration as end:
            self._end_job(None, end.value)
        except (sqlite3.Error, OSError) as error:
            self._end_job(store_error(error, self._path))
        except StoreError as error:
            self._end_job(error)
        except Exception as error:  # a fault of ours in a job must not end recording
            logger.exception("a job of the store")
            self._end_job(StoreError(StoreFault.REFUSED, f"this cannot be done: {error!r}"))

    def _end_job(self, fault: StoreError | None, result: object = None) -> None:
        """Tell how the job at hand ended, if there is one."""
        if self._running is not None:
            (_, done), self._running = self._running, None
            if fault is not None and self._scribe is not None:
                self._scribe.forget_numbers()
            done(fault, result)

    def _ready_scribe(self) -> Scribe:
        if self._scribe is None:
            self._scribe = Scribe(self._connect(self._path), self._gone)
        return self._scribe

    def _drop_connection(self, *, last: bool = False) -> None:
        """Close the connection; the next attempt opens another."""
        if self._scribe is not None:
            with contextlib.suppress(sqlite3.Error):
                if last:
                    self._scribe.connection.execute("PRAGMA optimize")
                self._scribe.connection.close()
        self._scribe = None


def _first_then(job: Job, ready: Callable[[], Scribe]) -> Generator[None, None, Any]:
    """Return a job that opens the connection itself, so that a fault in that is the job's."""
    return (yield from job(ready()))


def _tell(group: list[_Order], fault: StoreError | None) -> None:
    for order in group:
        order.done(fault, None)
