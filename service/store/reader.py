"""Reads the store over a connection of its own: events by number, raw samples as arrays or to be counted again.

Synchronous, one thread at a time, each method one consistent view. Nothing here waits for the writer.
"""

from __future__ import annotations

import json
import sqlite3
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from service.samples import Sensor
from service.store import codec, database, keeping, signal
from service.store.contract import RawReading, Reading
from service.store.faults import told
from service.store.signal import RawSignal
from service.store.values import (
    CHUNK_SAMPLES,
    Chunk,
    Cursor,
    Description,
    Layout,
    LogPage,
    LogQuery,
    ReplayPage,
    Resumable,
    SessionKey,
    Snapshot,
    StoredDevice,
    StoredSession,
    stretches,
)

REPLAY_CHUNKS = 1000
"""Chunks of one page of `replay`."""
SLICE_ROWS = 500
"""Rows handled in one call while a long signal is read: a millisecond."""
_LAST_RUN = 1 << 62
"""A run that none reaches."""

_CHUNKS = """
    SELECT acc.run, acc.first, acc.samples, acc.layout, acc.at_ns, acc.ticks, acc.counts, gyro.counts, mag.counts
    FROM raw AS acc
    LEFT JOIN raw AS gyro ON (gyro.session, gyro.sensor, gyro.run, gyro.first) = (acc.session, 1, acc.run, acc.first)
    LEFT JOIN raw AS mag ON (mag.session, mag.sensor, mag.run, mag.first) = (acc.session, 2, acc.run, acc.first)
    WHERE acc.session = ? AND acc.sensor = 0
        AND (acc.run, acc.first) > (?, ?) AND (acc.run, acc.first + acc.samples) > (?, ?)
    ORDER BY acc.run, acc.first LIMIT ?
"""

_LOG = "SELECT {columns} FROM log {index} LEFT JOIN counters ON counters.id = log.counter WHERE {where}"
_SESSIONS = """
    SELECT sessions.id, devices.name, since_ns, persons.name, ended_ns, about, cursor_run, cursor_boot, cursor_index,
        devices.last_ordinal
    FROM sessions JOIN devices ON devices.id = sessions.device LEFT JOIN persons ON persons.id = sessions.person
"""


class Reader:
    """Reads over `connection`."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection = connection
        self._path = path

    # What there is

    def devices(self) -> list[StoredDevice]:
        """Return every device, by id."""
        rows = self._rows(
            "SELECT devices.name, persons.name, (SELECT min(ordinal) FROM log WHERE device = devices.id), last_ordinal "
            "FROM devices LEFT JOIN persons ON persons.id = devices.person ORDER BY devices.name"
        )
        return [
            StoredDevice(device=name, person=person, first_ordinal=first or 0, last_ordinal=last)
            for name, person, first, last in rows
        ]

    def sessions(self, device: str | None = None) -> list[StoredSession]:
        """Return the sessions of one device or of all, oldest first."""
        where = "" if device is None else "WHERE devices.name = ?"
        rows = self._rows(
            f"{_SESSIONS} {where} ORDER BY since_ns, devices.name", *(() if device is None else (device,))
        )
        return [
            StoredSession(
                key=SessionKey(device=row[1], since_ns=row[2]),
                person=row[3],
                ended_ns=row[4],
                about=_plain(row[5]),
                cursor=_cursor(row[6:9]),
                steps=self._tallies(row[0]),
            )
            for row in rows
        ]

    def statistics(self) -> dict[str, int]:
        """Return how large everything is."""
        counts = {
            table: int(self._rows(f"SELECT count(*) FROM {table}")[0][0])  # noqa: S608
            for table in ("persons", "devices", "sessions", "raw", "log", "snapshots")
        }
        return {**counts, "used_bytes": keeping.used_bytes(self._connection), "file_bytes": self._path.stat().st_size}

    def check(self) -> None:
        """Read everything; StoreError where the database contradicts itself."""
        database.check(self._connection, self._path)

    # Events

    def log(self, query: LogQuery) -> LogPage:
        """Return a page of a device's events."""
        where, values = (
            ["log.device = (SELECT id FROM devices WHERE name = ?)", "ordinal > ?"],
            [query.device, query.after],
        )
        for condition, value in (
            ("at_ns >= ?", query.from_ns),
            ("at_ns < ?", query.to_ns),
            ("counters.name = ?", query.counter),
        ):
            if value is not None:
                where.append(condition)
                values.append(value)
        if query.kinds is not None:
            where.append(f"kind IN ({', '.join('?' * len(query.kinds))})")
            values += sorted(query.kinds)
        by_time = query.from_ns is not None or query.to_ns is not None
        sql = _LOG.format(
            columns=codec.LOG_COLUMNS, where=" AND ".join(where), index="INDEXED BY log_by_time" if by_time else ""
        )
        rows = self._rows(f"{sql} ORDER BY ordinal LIMIT ?", *values, query.limit + 1)
        entries = [codec.entry(row) for row in rows[: query.limit]]
        return LogPage(entries=entries, next_after=entries[-1].ordinal if len(rows) > query.limit else None)

    # Raw samples

    def raw(
        self,
        key: SessionKey,
        *,
        sensor: Sensor = Sensor.ACCELEROMETER,
        start: Cursor | None = None,
        stop: Cursor | None = None,
    ) -> RawSignal:
        """Return a session's samples of one sensor as one array, each sample once, from `start` to before `stop`."""
        low = start.place if start else (0, 0)
        high = stop.place if stop else (_LAST_RUN, 0)
        sql = """
            SELECT run, first, samples, layout, at_ns, counts FROM raw
            WHERE session = ? AND sensor = ? AND (run, first) > (?, ?) AND (run, first) < (?, ?) ORDER BY run, first
        """
        values = (self._session(key), list(Sensor).index(sensor), low[0], low[1] - CHUNK_SAMPLES, *high)
        return signal.assemble(self._slices(sql, *values), self._layouts(), sensor, low, high)

    def replay(self, key: SessionKey, after: Cursor | None = None, *, limit: int = REPLAY_CHUNKS) -> ReplayPage:
        """Return what a session's device sent from the sample `after` on, in order, each sample once.

        A chunk is cut where the device described itself, so that a Tracker learns everything in time.
        """
        place = after.place if after else (0, 0)
        session = self._session(key)
        rows = self._rows(_CHUNKS, session, place[0], place[1] - CHUNK_SAMPLES, *place, limit + 1)
        layouts = self._layouts()
        chunks = list(_once((_chunk(row, layouts) for row in rows[:limit]), place))
        end = chunks[-1] if chunks and len(rows) > limit else None
        following = Cursor(run=end.run, boot=end.boot, index=end.end) if end else None
        said = self._descriptions(session, place, following.place if following else (_LAST_RUN, 0))
        return ReplayPage(items=_merged(chunks, said), after=following)

    def resume(self) -> list[Resumable]:
        """Return the open sessions, oldest first, with all that is needed to go on."""
        rows = self._rows(f"{_SESSIONS} WHERE ended_ns IS NULL ORDER BY since_ns, devices.name")
        return [
            Resumable(
                key=SessionKey(device=row[1], since_ns=row[2]),
                person=row[3],
                about=_plain(row[5]),
                cursor=_cursor(row[6:9]),
                snapshot=self._snapshot(row[0]),
                last_ordinal=row[9],
            )
            for row in rows
        ]

    def _session(self, key: SessionKey) -> int:
        """Return a session's number; 0, which none has, for an unknown one."""
        sql = "SELECT sessions.id FROM sessions JOIN devices ON devices.id = device WHERE name = ? AND since_ns = ?"
        rows = self._rows(sql, key.device, key.since_ns)
        return int(rows[0][0]) if rows else 0

    def _snapshot(self, session: int) -> Snapshot | None:
        rows = self._rows("SELECT run, boot, first, at_ns, state FROM snapshots WHERE session = ?", session)
        if not rows:
            return None
        run, boot, first, at_ns, state = rows[0]
        return Snapshot(cursor=Cursor(run=run, boot=boot, index=first), at_ns=at_ns, state=codec.unpack_state(state))

    def _descriptions(self, session: int, low: tuple[int, int], high: tuple[int, int]) -> list[Description]:
        sql = """
            SELECT run, boot, first, at_ns, characteristic, value FROM descriptions
            WHERE session = ? AND (run, first) >= (?, ?) AND (run, first) < (?, ?) ORDER BY run, first, at_ns
        """
        return [
            Description(run=run, boot=boot, index=index, at_ns=at_ns, characteristic=characteristic, value=value)
            for run, boot, index, at_ns, characteristic, value in self._rows(sql, session, *low, *high)
        ]

    def _tallies(self, session: int) -> dict[str, int]:
        sql = "SELECT name, steps FROM tallies JOIN counters ON counters.id = counter WHERE session = ? ORDER BY name"
        return dict(self._rows(sql, session))

    def _layouts(self) -> dict[int, tuple[int, Layout]]:
        """Return boot and layout by number."""
        sql = "SELECT id, boot, rate_hz, lsb_per_g, lsb_per_rad_s, lsb_per_ut FROM layouts"
        return {
            number: (boot, Layout(rate_hz=rate, lsb_per_g=acc, lsb_per_rad_s=gyro, lsb_per_ut=mag))
            for number, boot, rate, acc, gyro, mag in self._rows(sql)
        }

    def _slices(self, sql: str, *values: Any) -> Iterator[list[Any]]:  # noqa: ANN401
        with told(self._path):
            cursor = self._connection.execute(sql, values)
            while rows := cursor.fetchmany(SLICE_ROWS):
                yield rows

    def _rows(self, sql: str, *values: Any) -> list[Any]:  # noqa: ANN401
        with told(self._path):
            return self._connection.execute(sql, values).fetchall()


PROMISES: tuple[type[Reading], type[RawReading]] = (Reader, Reader)
"""The contract that the type checker holds a Reader to."""


def _plain(text: str | None) -> dict[str, Any] | None:
    return None if text is None else dict(json.loads(text))


def _cursor(values: Sequence[int | None]) -> Cursor | None:
    run, boot, index = values
    return None if run is None or boot is None or index is None else Cursor(run=run, boot=boot, index=index)


def _chunk(row: Sequence[Any], layouts: Mapping[int, tuple[int, Layout]]) -> Chunk:
    run, first, samples, layout, at_ns, ticks, acc, gyro, mag = row
    boot, units = layouts[layout]
    return Chunk(
        run=run,
        boot=boot,
        index=first,
        at_ns=at_ns,
        layout=units,
        ticks=codec.unpack_ticks(ticks, stretches(first, first + samples)),
        acc=acc,
        gyro=gyro,
        mag=mag,
    )


def _once(chunks: Iterable[Chunk], place: tuple[int, int]) -> Iterator[Chunk]:
    """Yield chunks without what lies before `place` or was in an earlier one."""
    run, index = place
    for chunk in chunks:
        if chunk.run != run:
            run, index = chunk.run, 0
        if chunk.end > index:
            yield codec.cut(chunk, max(index, chunk.index), chunk.end)
            index = chunk.end


def _merged(chunks: Sequence[Chunk], said: Sequence[Description]) -> list[Chunk | Description]:
    """Put each description before the sample it came before."""
    waiting, merged = deque(said), list[Chunk | Description]()
    for whole in chunks:
        chunk = whole
        while waiting and (waiting[0].run, waiting[0].index) < (chunk.run, chunk.end):
            description = waiting.popleft()
            if description.run == chunk.run and description.index > chunk.index:
                merged.append(codec.cut(chunk, chunk.index, description.index))
                chunk = codec.cut(chunk, description.index, chunk.end)
            merged.append(description)
        merged.append(chunk)
    return [*merged, *waiting]
