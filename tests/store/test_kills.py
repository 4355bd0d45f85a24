"""Killed with -9 at random moments of recording: the database is whole, and holds all that was acknowledged."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from store import made
from store.recording import DEVICES

from service.store import database
from service.store.reader import Reader
from service.store.values import LogQuery

LONG = 1_000_000
"""Seconds that no process lives to record."""
TESTS = Path(__file__).parents[1]


def recorder(path, seconds):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    command = [sys.executable, "-m", "store.recording", str(path), str(seconds)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


def killed_while_recording(path, after_s):
    """Record, kill `after_s` after the first second is on the disk; return the last acknowledged one of each device."""
    process = recorder(path, LONG)
    first = process.stdout.readline()
    assert first, "the recorder ended by itself"
    threading.Timer(after_s, process.send_signal, [signal.SIGKILL]).start()
    lines = [first, *process.stdout]
    assert process.wait() == -signal.SIGKILL
    process.stdout.close()
    whole = [line.split() for line in lines if line.endswith("\n")]
    return {device: int(k) for device, k in whole}


def check_holds(path, acknowledged):
    """Everything acknowledged is there; what else is there is whole seconds, each with its steps and cursor."""
    seconds = {}
    with contextlib.closing(database.connect_reader(path)) as connection:
        database.check(connection, path)
        reader = Reader(connection, path)
        resumed = {one.key.device: one for one in reader.resume()}
        for seed, device in enumerate(DEVICES):
            if device not in resumed:
                assert device not in acknowledged
                continue
            n = resumed[device].cursor.index
            k = seconds[device] = n // made.RATE_HZ
            assert k > acknowledged.get(device, -1)
            raw = reader.raw(made.session(device))
            assert np.array_equal(raw.values * 4096, np.frombuffer(made.column(0, n, seed), "<i2").reshape(-1, 3))
            page = reader.log(LogQuery(device=device, limit=LONG))
            assert [told.ordinal for told in page.entries] == list(range(1, 2 * k + 1))
            snapshot = resumed[device].snapshot
            assert snapshot is None or snapshot.cursor.index <= n
    return seconds


def check_kills(path, kills, seed):
    rng = random.Random(seed)
    before = {}
    for _ in range(kills):
        acknowledged = killed_while_recording(path, rng.uniform(0, 0.4))
        seconds = check_holds(path, acknowledged)
        assert all(seconds[device] >= k for device, k in before.items())
        before = seconds
    last = max(before.values()) + 3
    with recorder(path, last) as process:
        process.stdout.read()
    assert process.returncode == 0
    assert check_holds(path, {}) == dict.fromkeys(DEVICES, last), "as a run that nobody disturbed"
    return before


def test_killed_once(tmp_path):
    check_kills(tmp_path / "s.db", 1, seed=1)


@pytest.mark.full
def test_killed_25_times(tmp_path):
    check_kills(tmp_path / "s.db", 25, seed=2)


@pytest.mark.soak
def test_killed_200_times(tmp_path):
    began_s = time.monotonic()
    reached = check_kills(tmp_path / "s.db", 200, seed=time.time_ns())
    print(f"200 kills in {time.monotonic() - began_s:.0f} s, seconds recorded: {reached}")
