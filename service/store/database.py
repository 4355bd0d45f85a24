"""The database file: made, checked, migrated and connected to.

Written ahead (WAL), so that readers and the one writer never wait for each other; every commit is on the disk when it
returns (synchronous FULL). Deleted content is overwritten. Only its owner may read a new file.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path

from service.errors import StoreError, StoreFault
from service.store.faults import store_error, told
from service.store.schema import APPLICATION_ID, MIGRATIONS

SQLITE_NEEDED = (3, 37)
"""The first with STRICT tables, which refuse a value of the wrong type (numpy's integers would be kept as bytes)."""
CHECKED_BYTES = 256 << 20
"""A file up to this size is checked whole when it is opened (a second); `check` does it for any size."""
BUSY_MS = 2000
"""Wait for another program's lock."""
_CHECKPOINT_PAGES = 4000
"""Pages (4 KiB) in the journal before they are copied to the database: four seconds of a thousand devices."""
_JOURNAL_BYTES = 64 << 20
"""The journal is cut back to this after a checkpoint."""
_CACHE_KIB = 32 << 10
"""The writer's cache: the page of each of a thousand sessions that its next chunk goes to, and the way there."""

Migrations = Sequence[Sequence[str]]


def prepare(path: Path, migrations: Migrations = MIGRATIONS) -> None:
    """Make the database at `path`, or check it and bring it to the newest version; StoreError says what is wrong."""
    if sqlite3.sqlite_version_info < SQLITE_NEEDED:
        needed = ".".join(map(str, SQLITE_NEEDED))
        why = f"this Python has SQLite {sqlite3.sqlite_version}: use one with {needed} or later"
        raise StoreError(StoreFault.REFUSED, why)
    with told(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
        with contextlib.closing(_connect(path)) as connection:
            _check_kind(connection, path, len(migrations))
            _migrate(connection, migrations)


def connect_writer(path: Path) -> sqlite3.Connection:
    """Return the connection that writes; whoever holds it is the only one."""
    connection = _connect(path)
    connection.execute(f"PRAGMA wal_autocheckpoint = {_CHECKPOINT_PAGES}")
    connection.execute(f"PRAGMA journal_size_limit = {_JOURNAL_BYTES}")
    connection.execute(f"PRAGMA cache_size = -{_CACHE_KIB}")
    return connection


def connect_reader(path: Path) -> sqlite3.Connection:
    """Return a connection that cannot write, for one thread at a time."""
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=ro",
        uri=True,
        isolation_level=None,
        check_same_thread=False,
        timeout=BUSY_MS / 1000,
    )
    connection.execute("PRAGMA query_only = ON")
    return connection


def check(connection: sqlite3.Connection, path: Path) -> None:
    """Read the whole database; StoreError where anything in it contradicts itself."""
    with told(path):
        (found,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise _damaged(path, found)


@contextlib.contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """All or nothing of what is written inside."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        roll_back(connection)
        raise


def roll_back(connection: sqlite3.Connection) -> None:
    """Undo an unfinished transaction, if there is one."""
    with contextlib.suppress(sqlite3.Error):
        if connection.in_transaction:
            connection.execute("ROLLBACK")


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=BUSY_MS / 1000)
    try:
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")  # before the first table is made; later without effect
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA secure_delete = ON")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _check_kind(connection: sqlite3.Connection, path: Path, newest: int) -> None:
    """See that the file is ours, whole, and no newer than this program."""
    kind = _number(connection, "application_id")
    version = _number(connection, "user_version")
    empty = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone() == (0,)
    if not (empty and version == 0) and kind != APPLICATION_ID:
        raise StoreError(StoreFault.FOREIGN, f"{path} is another program's database: name another file")
    if version > newest:
        why = f"{path} has version {version}, this steplink knows {newest}: use the steplink that wrote it or a later"
        raise StoreError(StoreFault.NEWER, why)
    if path.stat().st_size <= CHECKED_BYTES:
        (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise _damaged(path, found)


def _migrate(connection: sqlite3.Connection, migrations: Migrations) -> None:
    """Take every step that the file lacks, each a transaction."""
    for version in range(_number(connection, "user_version") + 1, len(migrations) + 1):
        with transaction(connection):
            for statement in migrations[version - 1]:
                connection.execute(statement)
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.execute(f"PRAGMA user_version = {version}")


def _number(connection: sqlite3.Connection, pragma: str) -> int:
    (value,) = connection.execute(f"PRAGMA {pragma}").fetchone()
    return int(value)


def _damaged(path: Path, found: str) -> StoreError:
    error = sqlite3.DatabaseError(found)
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return store_error(error, path)
