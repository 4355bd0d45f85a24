"""Disks that fail: connections to a database that a test may fill, break or slow down, and a small real disk."""

import contextlib
import sqlite3
import subprocess
import time

import pytest

from service.store import database


class Disk:
    """Connections to a database whose size, errors and speed a test decides."""

    def __init__(self):
        self.pages = 1 << 30
        self.fault = None
        self.commit_s = 0.0
        self.opened = 0

    def connect(self, path):
        self.opened += 1
        return Connection(self, database.connect_writer(path))


class Connection:
    """A connection of `disk`."""

    def __init__(self, disk, real):
        self._disk, self._real = disk, real

    def execute(self, sql, *values):
        if sql == "BEGIN IMMEDIATE":
            self._real.execute(f"PRAGMA max_page_count = {self._disk.pages}")
        if sql == "COMMIT":
            time.sleep(self._disk.commit_s)
            if self._disk.fault is not None:
                error = sqlite3.OperationalError("made")
                error.sqlite_errorcode = self._disk.fault
                raise error
        return self._real.execute(sql, *values)

    def __getattr__(self, name):
        return getattr(self._real, name)


@contextlib.contextmanager
def small_disk(path, size):
    made_it = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", path], check=False)
    if made_it.returncode:
        pytest.skip("this account may not mount a small disk")
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", path], check=True)
