"""Writes Batches into the tables, so that writing one again changes nothing.

A chunk at a place replaces a shorter one there; an event number that is there already must tell the same; a step is one
by its session, counter, run and device time (a counter that was taken away and came back counts from one again, so its
count does not name a step); cursors and snapshots never go back. What contradicts the store is a StoreError.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Mapping
from typing import Any

from service.errors import StoreError, StoreFault
from service.events import StepCounted
from service.store import codec
from service.store.values import Batch, Chunk, Cursor, Description, LogEntry, SessionKey, Snapshot

_RAW = """
    INSERT INTO raw VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT DO UPDATE SET
        samples = excluded.samples, layout = excluded.layout, at_ns = excluded.at_ns,
        ticks = excluded.ticks, counts = excluded.counts
    WHERE excluded.samples > samples
"""
_DESCRIPTION = "INSERT OR REPLACE INTO descriptions VALUES (?, ?, ?, ?, ?, ?, ?)"
_LOG_COLUMNS = 22
_STEP_COLUMNS = 14
_LOG = f"INSERT INTO log VALUES ({', '.join('?' * _LOG_COLUMNS)}) ON CONFLICT DO NOTHING"  # noqa: S608
_LOGGED = "SELECT session, run, kind, body, counter, steps, at_s FROM log WHERE device = ? AND ordinal = ?"
_TALLY = "INSERT INTO tallies VALUES (?, ?, 1) ON CONFLICT DO UPDATE SET steps = steps + 1"
_CURSOR = """
    UPDATE sessions SET cursor_run = ?1, cursor_boot = ?2, cursor_index = ?3
    WHERE id = ?4 AND (cursor_run IS NULL OR (cursor_run, cursor_index) < (?1, ?3))
"""
_SNAPSHOT = """
    INSERT INTO snapshots VALUES (?, ?, ?, ?, ?, ?)
    ON CONFLICT DO UPDATE SET
        run = excluded.run, boot = excluded.boot, first = excluded.first, at_ns = excluded.at_ns, state = excluded.state
    WHERE (excluded.run, excluded.first, excluded.at_ns) > (run, first, at_ns)
"""


class Scribe:
    """Writes into the tables over one connection; the caller begins and ends transactions.

    `gone` holds sessions deleted since the start: what is still on its way to them is refused.
    """

    def __init__(self, connection: sqlite3.Connection, gone: set[SessionKey]) -> None:
        self.connection = connection
        self.gone = gone
        self._devices: dict[Any, int] = {}
        self._sessions: dict[SessionKey, int] = {}
        self._counters: dict[Any, int] = {}
        self._layouts: dict[Any, int] = {}

    def forget_numbers(self) -> None:
        """Look rows up again: a transaction was undone, or rows were deleted."""
        self._sessions.clear()
        for known in (self._devices, self._counters, self._layouts):
            known.clear()

    def write(self, batch: Batch) -> None:
        """Write a batch, within a transaction."""
        device = self.device(batch.session.device)
        session = self._session(batch.session, device)
        self._describe(session, batch)
        for chunk in batch.chunks:
            self._write_chunk(session, chunk)
        for said in batch.descriptions:
            self._write_description(session, said)
        for told in batch.entries:
            self._write_entry(device, session, told)
        if batch.entries:
            newest = max(told.ordinal for told in batch.entries)
            self.connection.execute(
                "UPDATE devices SET last_ordinal = max(last_ordinal, ?) WHERE id = ?", (newest, device)
            )
        if batch.cursor is not None:
            self._move_cursor(session, batch.cursor)
        if batch.snapshot is not None:
            self._write_snapshot(session, batch.snapshot)

    def device(self, name: str) -> int:
        """Return the number of a device, new or known."""
        return self._number(self._devices, "devices", {"name": name})

    def person(self, name: str) -> int:
        """Return the number of a person, new or known."""
        return self._number({}, "persons", {"name": name})

    def _session(self, key: SessionKey, device: int) -> int:
        if key in self.gone:
            raise StoreError(StoreFault.GONE, f"the session of {key.device!r} has been deleted: begin a new one")
        if key not in self._sessions:
            found = self._row("SELECT id FROM sessions WHERE device = ? AND since_ns = ?", (device, key.since_ns))
            if found is None:
                sql = "INSERT INTO sessions (device, since_ns, person) SELECT id, ?, person FROM devices WHERE id = ?"
                found = (self.connection.execute(sql, (key.since_ns, device)).lastrowid,)
            self._sessions[key] = found[0]
        return self._sessions[key]

    def _describe(self, session: int, batch: Batch) -> None:
        """Note owner, description and end, where the batch says them."""
        changes = {
            "person": batch.person and self.person(batch.person),
            "about": None if batch.about is None else codec.to_json(batch.about),
            "ended_ns": batch.ended_ns,
        }
        for column, value in changes.items():
            if value is not None:
                self.connection.execute(f"UPDATE sessions SET {column} = ? WHERE id = ?", (value, session))  # noqa: S608

    def _write_chunk(self, session: int, chunk: Chunk) -> None:
        layout = self._layout(chunk)
        for sensor, counts in enumerate(codec.columns(chunk)):
            if counts is not None:
                ticks = codec.pack_ticks(chunk.ticks) if sensor == 0 else None
                place = (session, sensor, chunk.run, chunk.index)
                self.connection.execute(_RAW, (*place, len(chunk), layout, chunk.at_ns, ticks, counts))

    def _write_description(self, session: int, said: Description) -> None:
        values = (session, said.run, said.index, said.characteristic, said.boot, said.at_ns, said.value)
        self.connection.execute(_DESCRIPTION, values)

    def _write_entry(self, device: int, session: int, told: LogEntry) -> None:
        counter, row = self._log_row(device, session, told)
        if self.connection.execute(_LOG, row).rowcount == 1:
            if counter is not None:
                self.connection.execute(_TALLY, (session, counter))
            return
        there = self._row(_LOGGED, (device, told.ordinal))
        same = tuple(
            row[k] for k in (2, 5, 6, 7, 8, 10, 11)
        )  # host time and uncertainties may be others: the first stay
        if there is not None and there != same:
            why = f"event {told.ordinal} of the device is another one already: numbers go on from `last_ordinal`"
            raise StoreError(StoreFault.REFUSED, why)

    def _log_row(self, device: int, session: int, told: LogEntry) -> tuple[int | None, tuple[Any, ...]]:
        """Return the counter's number, if it is a step, and the row of an event."""
        head = (device, told.ordinal, session, told.at_ns, float(told.uncertainty_s), told.run)
        event = told.told
        if not isinstance(event, StepCounted):
            return None, (*head, event.kind, codec.to_json(event.body), *(None,) * _STEP_COLUMNS)
        counter = self._number(self._counters, "counters", {"name": event.counter})
        step, heading = event.step, event.heading
        values = (step.strength, step.interval_s, step.peak, step.valley, step.upper, step.lower, event.uncertainty_s)
        numbers = [None if value is None or math.isnan(value) else float(value) for value in values]
        way = (heading.deg, heading.uncertainty_deg, int(heading.is_line)) if heading else (None,) * 3
        return counter, (*head, codec.STEP, None, counter, event.boot, event.steps, float(step.at_s), *numbers, *way)

    def _move_cursor(self, session: int, cursor: Cursor) -> None:
        self.connection.execute(_CURSOR, (cursor.run, cursor.boot, cursor.index, session))

    def _write_snapshot(self, session: int, snapshot: Snapshot) -> None:
        cursor = snapshot.cursor
        place = (session, cursor.run, cursor.boot, cursor.index)
        self.connection.execute(_SNAPSHOT, (*place, snapshot.at_ns, codec.pack_state(snapshot.state)))

    def _layout(self, chunk: Chunk) -> int:
        layout = chunk.layout
        row = {
            "boot": chunk.boot,
            "rate_hz": layout.rate_hz,
            "lsb_per_g": layout.lsb_per_g,
            "lsb_per_rad_s": layout.lsb_per_rad_s,
            "lsb_per_ut": layout.lsb_per_ut,
        }
        return self._number(self._layouts, "layouts", row)

    def _number(self, known: dict[Any, int], table: str, row: Mapping[str, Any]) -> int:
        """Return the number of `row` of `table`, new or known."""
        key = tuple(row.values())
        if key not in known:
            same = " AND ".join(f"{name} IS ?" for name in row)
            found = self._row(f"SELECT id FROM {table} WHERE {same}", key)  # noqa: S608
            if found is None:
                marks = ", ".join("?" * len(key))
                sql = f"INSERT INTO {table} ({', '.join(row)}) VALUES ({marks})"  # noqa: S608
                found = (self.connection.execute(sql, key).lastrowid,)
            known[key] = found[0]
        return known[key]

    def _row(self, sql: str, values: tuple[Any, ...]) -> Any:  # noqa: ANN401
        return self.connection.execute(sql, values).fetchone()
