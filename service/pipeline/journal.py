"""What a session has told and the disk does not hold yet: gathered, and stored as one batch a second.

A batch holds samples, the events that follow from them, and the place up to which both are counted, all of the same
moment: so whenever a crash comes, what the store holds fits together, and the rest is asked of the device again. While
nothing can be written, counting goes on and its events wait here; of the samples the newest HELD_CHUNKS do, as many as
a device keeps itself, and those that must go are made up for by a snapshot of the count.
"""

from __future__ import annotations

import asyncio
import dataclasses
import logging
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from service.errors import StoreError, StoreFault
from service.events import Heard, Received
from service.samples import DeviceInfo
from service.store.chunker import Chunker
from service.store.joined import joined
from service.store.values import (
    Batch,
    Chunk,
    Cursor,
    Description,
    Layout,
    LogEntry,
    LogPage,
    LogQuery,
    SessionKey,
    Snapshot,
)

BATCH_S = 1.0
"""How long events and samples are gathered before they are stored: what a crash costs at most is asked for again."""
SNAPSHOT_NS = 30_000_000_000
"""A restart counts at most so much again."""
GATHERED_BLOCKS = 64
"""Packets whose samples wait to be put into chunks together: ten seconds of a live device."""
HELD_CHUNKS = 600
"""Seconds of samples that wait for a disk: ten minutes, which the device itself keeps too."""
HELD_ENTRIES = 20_000
"""Events that wait for a disk: three hours of walking. Policy: the oldest are not logged; the count has them."""
RETRY_S = 1.0
CLOSE_S = 1.5
"""Longest wait for the disk at the end: the service exits within three seconds."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class RestartPoint:
    """Where a session stands, for a restart: what its count awaits, its state (made when asked for), and what else."""

    cursor: Cursor | None
    state: Callable[[], Mapping[str, Any]]
    about: Mapping[str, Any]


class JournalStore(Protocol):
    """What a journal needs of a store."""

    async def append(self, batch: Batch) -> None:
        """Store a batch; return when it is on the disk."""

    async def read(self, query: Callable[[Any], Any]) -> Any:  # noqa: ANN401
        """Return what `query` reads."""


class Journal:
    """One session's. Without a `store` it holds the newest events in memory, and no samples."""

    def __init__(
        self, store: JournalStore | None = None, last_ordinal: Callable[[str], int] = lambda _device: 0
    ) -> None:
        self.key: SessionKey | None = None
        """Set once the device's id is known; nothing is stored before."""
        self._store = self._kept_in = store
        self.last_ordinal = last_ordinal
        """Number of the last event that a device had before this session."""
        self._entries: deque[LogEntry] = deque(maxlen=HELD_ENTRIES)
        self._unsure: Batch | None = None
        """On its way to the disk, or there without our knowing."""
        self._closing = False
        self._chunker = Chunker()
        self._blocks: list[tuple[Received, int]] = []
        """New samples and when they arrived, not in a chunk yet; `_layout_of` tells their layout."""
        self._layout_of = DeviceInfo()
        self._chunks: list[Chunk] = []
        self._descriptions: list[Description] = []
        self._about: Mapping[str, Any] | None = None
        """As it was stored last."""
        self._snapshot_ns: int | None = None
        """When the last snapshot was taken; None wants one with the next batch."""
        self._changed = asyncio.Event()
        self._over = False

    def begin(self, key: SessionKey, about: Mapping[str, Any] | None = None) -> None:
        """Store under `key` from now on; `about` where the store has it already."""
        self.key, self._about = key, about
        self._changed.set()

    def number_on(self, last: int) -> None:
        """Renumber what waits, to come after the event of number `last`."""
        moved = [dataclasses.replace(entry, ordinal=entry.ordinal + last) for entry in self._entries]
        self._entries.clear()
        self._entries.extend(moved)

    def received(self, told: Received, info: DeviceInfo, at_ns: int) -> None:
        """Take samples that are new, of a device that described itself by `info`."""
        if self._store is None or self._over or info.rate_hz is None or info.lsb_per_g is None:
            return
        if self._blocks and self._layout_of is not info and self._layout_of != info:
            self._gather()
        self._layout_of = info
        self._blocks.append((told, at_ns))
        if len(self._blocks) >= GATHERED_BLOCKS:
            self._gather()
        self._changed.set()

    def heard(self, told: Heard, at_ns: int) -> None:
        """Take a value by which the device described itself."""
        if self._store is None or self._over:
            return
        said = Description(
            run=told.run,
            boot=told.boot,
            index=told.index,
            at_ns=at_ns,
            characteristic=told.characteristic,
            value=told.data,
        )
        self._descriptions.append(said)
        self._changed.set()

    def log(self, entry: LogEntry) -> None:
        """Take a durable event."""
        if self._over:
            return
        if len(self._entries) == HELD_ENTRIES and self._store is not None and self.key is not None:
            logger.error("an event of %s finds no room and will not be in the log", self.key.device)
        self._entries.append(entry)
        self._changed.set()

    def mark(self) -> None:
        """Have a snapshot stored with the next batch: something changed that samples do not tell."""
        self._snapshot_ns = None
        self._changed.set()

    async def page(self, query: LogQuery) -> LogPage:
        """Return a page of the session's device's events, those included that are not on the disk yet."""
        waiting = [
            entry for entry in (*(self._unsure.entries if self._unsure else ()), *self._entries) if _asked(entry, query)
        ]
        found = LogPage(entries=(), next_after=None)
        if self._store is not None and self.key is not None:
            found = await self._store.read(lambda reader: reader.log(query))
        if found.next_after is not None:
            return found
        there = {entry.ordinal for entry in found.entries}
        entries = [*found.entries, *(entry for entry in waiting if entry.ordinal not in there)]
        more = len(entries) > query.limit
        return LogPage(entries=entries[: query.limit], next_after=entries[query.limit - 1].ordinal if more else None)

    async def keep(self, standing: Callable[[], RestartPoint], clock: Callable[[], int]) -> None:
        """Store a batch a second while there is something to store; `clock` is host UTC in ns. Never ends by itself."""
        while True:
            await self._changed.wait()
            await asyncio.sleep(BATCH_S)
            try:
                await self.store(standing, clock)
            except Exception:  # a fault of ours with one device must not end the others' recording
                logger.exception("storing what %s told", self.key)

    async def close(
        self, standing: Callable[[], RestartPoint], clock: Callable[[], int], *, ended: bool = False
    ) -> None:
        """Store what there is, with a snapshot; what the disk does not take now is lost. `ended` ends the session."""
        self._closing = True
        self.mark()
        try:
            async with asyncio.timeout(CLOSE_S):
                await self.store(standing, clock)
                if ended and self._store is not None and self.key is not None:
                    self._unsure = Batch(session=self.key, ended_ns=clock())
                    await self._send()
        except TimeoutError:
            logger.error("the disk does not take the last events and samples of %s", self.key)  # noqa: TRY400

    def successor(self) -> Journal:
        """Return an empty journal of the same store, for the next session."""
        return Journal(self._kept_in, self.last_ordinal)

    def drop(self) -> None:
        """Forget all that waits and store nothing more: the session's data are deleted."""
        self._over, self._store = True, None
        self._entries.clear()
        self._chunks, self._descriptions, self._blocks, self._unsure = [], [], [], None

    async def store(self, standing: Callable[[], RestartPoint], clock: Callable[[], int]) -> None:
        """Store what there is now; while the disk does not take it, wait and try again."""
        await self._send()
        self._changed.clear()
        if self._store is not None and self.key is not None:
            self._unsure = self._take(self.key, standing(), clock())
            await self._send()

    async def _send(self) -> None:
        """Have the store take the batch at hand. Cancelled in the middle, it is sent again: twice changes nothing."""
        while (batch := self._unsure) is not None and self._store is not None:
            try:
                await self._store.append(batch)
            except StoreError as error:
                if error.is_passing and not self._closing:
                    await asyncio.sleep(RETRY_S)
                    continue
                if error.reason is not StoreFault.GONE:
                    self._give_up(batch, error)
            except Exception as error:  # a fault of ours: what is next shall not suffer
                self._give_up(batch, error)
            if self._unsure is batch:
                self._unsure = None

    def _give_up(self, batch: Batch, error: Exception) -> None:
        """Tell that a batch is not stored; what is stored next does not go on from it and needs all that it told."""
        logger.error("events and samples of %s are not stored: %s", batch.session.device, error)
        self._snapshot_ns = self._about = None

    def _gather(self) -> None:
        """Put the samples that wait into chunks: together, since that costs a tenth of one packet at a time."""
        info = self._layout_of
        blocks, self._blocks = self._blocks, []
        if info.rate_hz is None or info.lsb_per_g is None:
            return
        layout = Layout(
            rate_hz=info.rate_hz,
            lsb_per_g=info.lsb_per_g,
            lsb_per_rad_s=info.lsb_per_rad_s,
            lsb_per_ut=info.lsb_per_ut,
        )
        for told, at_ns in joined(blocks):
            self._chunks += self._chunker.add(told.block, run=told.run, layout=layout, at_ns=at_ns)
        if len(self._chunks) > HELD_CHUNKS:
            del self._chunks[: len(self._chunks) - HELD_CHUNKS]
            self._snapshot_ns = None

    def _take(self, key: SessionKey, standing: RestartPoint, now_ns: int) -> Batch:
        """Return all that waits as one batch, of this very moment."""
        self._gather()
        cursor = standing.cursor
        snapshot = None
        due = self._snapshot_ns is None or not 0 <= now_ns - self._snapshot_ns < SNAPSHOT_NS
        if cursor is not None and due:
            snapshot = Snapshot(cursor=cursor, at_ns=now_ns, state=standing.state())
            self._snapshot_ns = now_ns
        about = None if standing.about == self._about else standing.about
        self._about = standing.about
        batch = Batch(
            session=key,
            chunks=[*self._chunks, *self._chunker.begun()],
            descriptions=self._descriptions,
            entries=tuple(self._entries),
            cursor=cursor,
            snapshot=snapshot,
            about=about,
        )
        self._entries.clear()
        self._chunks, self._descriptions = [], []
        return batch


def _asked(entry: LogEntry, query: LogQuery) -> bool:
    """Whether an event is one that a store would find by this query."""
    told = entry.told
    kind, counter = getattr(told, "kind", "step"), getattr(told, "counter", None)
    return (
        entry.ordinal > query.after
        and (query.from_ns is None or entry.at_ns >= query.from_ns)
        and (query.to_ns is None or entry.at_ns < query.to_ns)
        and (query.kinds is None or kind in query.kinds)
        and (query.counter is None or counter == query.counter)
    )
