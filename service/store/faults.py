"""What SQLite and the operating system say, as a StoreError that says what to do.

Told apart by error codes, never by text. SQLite calls a disk "full" only where a write says so; where the index of its
journal cannot grow it reports an input/output error, and the disk is asked.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from service.errors import StoreError, StoreFault

ROOM_BYTES = 1 << 20
"""An input/output error on a disk with less room than this is a full disk."""

_FAULTS = {
    sqlite3.SQLITE_FULL: StoreFault.FULL,
    sqlite3.SQLITE_READONLY: StoreFault.READ_ONLY,
    sqlite3.SQLITE_CANTOPEN: StoreFault.IO,
    sqlite3.SQLITE_PERM: StoreFault.READ_ONLY,
    sqlite3.SQLITE_IOERR: StoreFault.IO,
    sqlite3.SQLITE_BUSY: StoreFault.LOCKED,
    sqlite3.SQLITE_LOCKED: StoreFault.LOCKED,
    sqlite3.SQLITE_CORRUPT: StoreFault.CORRUPT,
    sqlite3.SQLITE_NOTADB: StoreFault.FOREIGN,
}
_ERRNO_FAULTS = {
    errno.ENOSPC: StoreFault.FULL,
    errno.EDQUOT: StoreFault.FULL,
    errno.EROFS: StoreFault.READ_ONLY,
    errno.EACCES: StoreFault.READ_ONLY,
    errno.EPERM: StoreFault.READ_ONLY,
}
_REMEDIES = {
    StoreFault.FULL: "the disk of {path} is full: free some room; a running service then goes on by itself",
    StoreFault.READ_ONLY: "{path} cannot be written: make its folder writable; a running service then goes on itself",
    StoreFault.IO: (
        "{path} could not be read or written ({error}): is it a file, and are its folder and disk there? "
        "A running service goes on trying"
    ),
    StoreFault.LOCKED: "another program holds {path}: end it; a running service then goes on by itself",
    StoreFault.CORRUPT: (
        "{path} is damaged ({error}): move it away and start with a new file, or put a backup in its place; "
        "`sqlite3 {path} .recover` saves what can be read"
    ),
    StoreFault.FOREIGN: "{path} is no database of steplink, or its beginning is damaged: name another file",
    StoreFault.REFUSED: "this cannot be stored: {error}",
}


def store_error(error: sqlite3.Error | OSError, path: Path) -> StoreError:
    """Return what an error of SQLite or the system means for the database at `path`."""
    reason = _reason(error, path)
    return StoreError(reason, _REMEDIES[reason].format(path=path, error=error))


@contextlib.contextmanager
def told(path: Path) -> Iterator[None]:
    """Raise what SQLite and the system raise as a StoreError."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise store_error(error, path) from error


def _reason(error: sqlite3.Error | OSError, path: Path) -> StoreFault:
    if isinstance(error, OSError):
        return _ERRNO_FAULTS.get(error.errno or 0, StoreFault.IO)
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
    reason = _FAULTS.get(code, StoreFault.REFUSED)
    if reason is StoreFault.IO:
        return _reason_of_io(path)
    return reason


def _reason_of_io(path: Path) -> StoreFault:
    with contextlib.suppress(OSError):
        if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
            return StoreFault.READ_ONLY
        if shutil.disk_usage(path.parent).free < ROOM_BYTES:
            return StoreFault.FULL
    return StoreFault.IO
