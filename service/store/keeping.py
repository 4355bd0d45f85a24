"""What goes out of the store again: raw samples by age and by size, and everything of one person.

Each is a job of the writer's: small transactions between which recording goes on. Raw samples that an open session
still needs for a restart (those after its snapshot) stay. Deleted content is overwritten, the file shrinks by the room
that became free. A person's deletion ends with writing the whole file anew (VACUUM) and emptying the journal, so that
nothing of theirs is in any file: that alone holds up recording, about half a second for each 100 MB.
"""

from __future__ import annotations

import heapq
import sqlite3
from collections.abc import Generator, Iterator
from dataclasses import dataclass

from service.errors import StoreError, StoreFault
from service.store.database import transaction
from service.store.scribe import Scribe
from service.store.values import SessionKey

SLICE_ROWS = 256
"""Rows deleted in one transaction: four minutes of a sensor, 5 ms."""
SLICE_PAGES = 256
"""Pages given back in one transaction: 1 MiB."""
_CHECKPOINT_TRIES = 5
"""A reader in the middle of a query holds the journal for a moment; each try waits for two seconds."""
_DELETE_RAW = "DELETE FROM raw WHERE session = ? AND sensor = ? AND run = ? AND first = ?"

Steps = Generator[None, None, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Retention:
    """What may stay: raw samples that arrived since `raw_since_ns`, as many as fit into `raw_bytes` of database.

    `log_since_ns` deletes events and steps too; without it they stay, as tallies always do. None: no limit.
    """

    raw_since_ns: int | None = None
    raw_bytes: int | None = None
    log_since_ns: int | None = None


def used_bytes(connection: sqlite3.Connection) -> int:
    """Return the size of what the database holds, free pages left out."""
    pages, free, size = (
        connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("page_count", "freelist_count", "page_size")
    )
    return int((pages - free) * size)


def retain(scribe: Scribe, policy: Retention) -> Steps:
    """Delete what may not stay, oldest first; return the rows deleted."""
    rows = yield from _retain_raw(scribe.connection, policy)
    if policy.log_since_ns is not None:
        rows += yield from _retain_log(scribe.connection, policy.log_since_ns)
    yield from _shrink(scribe.connection)
    return rows


def assign(scribe: Scribe, device: str, person: str) -> Steps:
    """Make `person` the owner of a device, and of its sessions that have none; return the number of sessions."""
    with transaction(scribe.connection):
        owner, number = scribe.person(person), scribe.device(device)
        scribe.connection.execute("UPDATE devices SET person = ? WHERE id = ?", (owner, number))
        sql = "UPDATE sessions SET person = ? WHERE device = ? AND person IS NULL"
        sessions = scribe.connection.execute(sql, (owner, number)).rowcount
    yield
    return sessions


def forget(scribe: Scribe, person: str) -> Steps:
    """Delete all data of a person for good; return the number of sessions deleted.

    Begun, it is finished even if the process is killed in between: `go_on_forgetting` does that at the next start.
    """
    found = scribe.connection.execute("SELECT id FROM persons WHERE name = ?", (person,)).fetchone()
    if found is None:
        return 0
    with transaction(scribe.connection):
        scribe.connection.execute("UPDATE persons SET name = 'forgotten ' || id, forgotten = 1 WHERE id = ?", found)
        scribe.connection.execute("UPDATE devices SET person = NULL WHERE person = ?", found)
    return (yield from go_on_forgetting(scribe))


def go_on_forgetting(scribe: Scribe) -> Steps:
    """Finish every deletion that was begun; return the number of sessions deleted."""
    connection = scribe.connection
    sessions = connection.execute(
        "SELECT sessions.id, devices.name, since_ns FROM sessions JOIN devices ON devices.id = sessions.device "
        "JOIN persons ON persons.id = sessions.person WHERE forgotten = 1"
    ).fetchall()
    scribe.gone.update(SessionKey(device=device, since_ns=since_ns) for _, device, since_ns in sessions)
    scribe.forget_numbers()
    for session, _, _ in sessions:
        yield from _delete_session(connection, session)
    if connection.execute("SELECT count(*) FROM persons WHERE forgotten = 1").fetchone() == (0,):
        return 0
    with transaction(connection):
        connection.execute(
            "DELETE FROM devices WHERE person IS NULL AND id NOT IN (SELECT device FROM sessions) "
            "AND id NOT IN (SELECT device FROM log)"
        )
    scribe.forget_numbers()
    yield
    _rewrite(connection)
    yield from _empty_journal(connection)
    with transaction(connection):
        connection.execute("DELETE FROM persons WHERE forgotten = 1")
    return len(sessions)


# Raw samples


def _retain_raw(connection: sqlite3.Connection, policy: Retention) -> Steps:
    """Delete slices of the column (a session's sensor) whose oldest chunk is the oldest of all, while it must go."""
    heap = list(_heads(connection))
    heapq.heapify(heap)
    deleted = 0
    while heap:
        at_ns, session, sensor = heapq.heappop(heap)
        too_old = policy.raw_since_ns is not None and at_ns < policy.raw_since_ns
        too_large = policy.raw_bytes is not None and used_bytes(connection) > policy.raw_bytes
        if not (too_old or too_large):
            break
        before_ns = None if too_large else policy.raw_since_ns
        with transaction(connection):
            rows = _delete_slice(connection, session, sensor, before_ns)
        deleted += rows
        # A column that gave less has no more to give, or only what arrived meanwhile: that is not chased.
        if rows == SLICE_ROWS and (head := _head(connection, session, sensor)) is not None:
            heapq.heappush(heap, (head, session, sensor))
        yield
    return deleted


def _heads(connection: sqlite3.Connection) -> Iterator[tuple[int, int, int]]:
    """Yield when the oldest chunk of each session and sensor arrived."""
    for (session,) in connection.execute("SELECT id FROM sessions").fetchall():
        for sensor in range(3):
            if (at_ns := _head(connection, session, sensor)) is not None:
                yield at_ns, session, sensor


def _head(connection: sqlite3.Connection, session: int, sensor: int) -> int | None:
    sql = "SELECT at_ns FROM raw WHERE session = ? AND sensor = ? ORDER BY run, first LIMIT 1"
    found = connection.execute(sql, (session, sensor)).fetchone()
    return None if found is None else int(found[0])


def _delete_slice(connection: sqlite3.Connection, session: int, sensor: int, before_ns: int | None) -> int:
    """Delete a column's first chunks, up to what is young enough and what a restart needs; return their number."""
    sql = """
        SELECT raw.run, raw.first, raw.at_ns FROM raw JOIN sessions ON sessions.id = raw.session
        LEFT JOIN snapshots ON snapshots.session = raw.session
        WHERE raw.session = ? AND sensor = ? AND (
            ended_ns IS NOT NULL OR snapshots.run IS NULL
            OR (raw.run, raw.first + samples) <= (snapshots.run, snapshots.first)
        )
        ORDER BY raw.run, raw.first LIMIT ?
    """
    places = []
    for run, first, at_ns in connection.execute(sql, (session, sensor, SLICE_ROWS)).fetchall():
        if before_ns is not None and at_ns >= before_ns:
            break
        places.append((session, sensor, run, first))
    connection.executemany(_DELETE_RAW, places)
    return len(places)


# Events and sessions


def _retain_log(connection: sqlite3.Connection, since_ns: int) -> Steps:
    deleted = 0
    for (device,) in connection.execute("SELECT id FROM devices").fetchall():
        sql = f"""
            DELETE FROM log WHERE device = ?1 AND ordinal IN (
                SELECT ordinal FROM log WHERE device = ?1 AND at_ns < ?2 ORDER BY at_ns LIMIT {SLICE_ROWS}
            )
        """  # noqa: S608
        rows = SLICE_ROWS
        while rows == SLICE_ROWS:
            with transaction(connection):
                rows = connection.execute(sql, (device, since_ns)).rowcount
            deleted += rows
            yield
    return deleted


def _delete_session(connection: sqlite3.Connection, session: int) -> Steps:
    """Delete a session, its row last, so that whoever goes on with it after a crash finds it."""
    rows = SLICE_ROWS
    while rows == SLICE_ROWS:
        sql = f"SELECT session, sensor, run, first FROM raw WHERE session = ? LIMIT {SLICE_ROWS}"  # noqa: S608
        places = connection.execute(sql, (session,)).fetchall()
        with transaction(connection):
            connection.executemany(_DELETE_RAW, places)
        rows = len(places)
        yield
    yield from _delete_events(connection, session)
    with transaction(connection):
        for table in ("descriptions", "snapshots", "tallies"):
            connection.execute(f"DELETE FROM {table} WHERE session = ?", (session,))  # noqa: S608
        connection.execute("DELETE FROM sessions WHERE id = ?", (session,))
    yield
    return 1


def _delete_events(connection: sqlite3.Connection, session: int) -> Generator[None, None, None]:
    """Delete a session's events, looking at so many of its device's at a time."""
    sql = """
        SELECT device, (SELECT min(ordinal) FROM log WHERE log.device = sessions.device), last_ordinal
        FROM sessions JOIN devices ON devices.id = device WHERE sessions.id = ?
    """
    device, first, last = connection.execute(sql, (session,)).fetchone()
    for low in range(first or last + 1, last + 1, SLICE_ROWS):
        with transaction(connection):
            sql = "DELETE FROM log WHERE device = ? AND ordinal >= ? AND ordinal < ? AND session = ?"
            connection.execute(sql, (device, low, low + SLICE_ROWS, session))
        yield


# Room


def _shrink(connection: sqlite3.Connection) -> Generator[None, None, None]:
    """Give free pages back to the file system."""
    while connection.execute("PRAGMA freelist_count").fetchone()[0]:
        # As a script: executed as a statement without columns, it stops after its first page.
        connection.executescript(f"PRAGMA incremental_vacuum({SLICE_PAGES})")
        yield


def _rewrite(connection: sqlite3.Connection) -> None:
    """Write the file anew: pages among which rows were moved keep copies of them, which secure_delete does not know."""
    connection.execute("VACUUM")


def _empty_journal(connection: sqlite3.Connection) -> Generator[None, None, None]:
    """Copy the journal to the database and cut it to nothing, once no reader looks at it."""
    for _ in range(_CHECKPOINT_TRIES):
        (busy, _, _) = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        if not busy:
            return
        yield
    raise StoreError(StoreFault.LOCKED, "a program reads the database all the time: end it and delete again")
