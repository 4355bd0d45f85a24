"""A disk that is full, read-only or slow: nothing acknowledged is lost, and recording goes on by itself."""

import asyncio
import functools
import os
import sqlite3
import subprocess
import time

import pytest
from store import made
from store.disk import Disk, small_disk

from service.errors import StoreError, StoreFault
from service.store.store import open_store
from service.store.values import LogQuery

KEY = made.session()
MIB = 1 << 20


@pytest.fixture
def disk():
    return Disk()


@pytest.fixture
def opened(tmp_path, disk):
    return functools.partial(
        open_store, tmp_path / "steplink.db", queue_batches=20, patience_s=0.1, retry_s=0.05, connect=disk.connect
    )


async def count_of(store):
    page = await store.read(lambda reader: reader.log(LogQuery(device="sim-1", limit=10_000)))
    raw = await store.read(lambda reader: reader.raw(KEY))
    assert len(raw.values) == 25 * len(page.entries)
    return len(page.entries)


async def until(condition):
    for _ in range(1000):
        if condition():
            return
        await asyncio.sleep(0.01)
    pytest.fail("it never came to that")


async def fill_until_refused(store):
    """Append without end; return the error that ended it, the tasks still waiting, and how many were stored."""
    tasks, stored = [], 0
    for k in range(10_000):
        task = asyncio.create_task(store.append(made.second(KEY, k)))
        await asyncio.wait({task}, timeout=0.3 if tasks else 5)
        if not task.done():
            tasks.append(task)
        elif task.exception() is None:
            stored += 1
        else:
            return task.exception(), tasks, stored
    pytest.fail("nothing was ever refused")


async def check_room_brings_it_back(store, make_room, reason):
    error, waiting, stored = await fill_until_refused(store)
    assert (error.reason, error.is_passing) == (reason, True)
    assert store.statistics().trouble.reason is reason
    assert len(waiting) == 20, "the queue holds what it promises"
    assert await count_of(store) == 2 * stored, "reading goes on, and shows what was acknowledged"
    make_room()
    await asyncio.gather(*waiting)
    assert store.statistics().trouble is None
    assert await count_of(store) == 2 * (stored + 20)


@pytest.mark.full
async def test_a_database_that_may_not_grow(opened, disk):
    async with opened() as store:
        disk.pages = 45
        await check_room_brings_it_back(store, lambda: setattr(disk, "pages", 1 << 30), StoreFault.FULL)


@pytest.mark.full
async def test_a_full_disk(tmp_path):
    with small_disk(tmp_path, 2 * MIB):
        ballast = tmp_path / "ballast"
        ballast.write_bytes(bytes(MIB))
        async with open_store(tmp_path / "s.db", queue_batches=20, patience_s=0.1, retry_s=0.05) as store:
            await check_room_brings_it_back(store, ballast.unlink, StoreFault.FULL)
        assert (tmp_path / "s.db").exists()


async def test_a_disk_that_is_read_only(tmp_path):
    with small_disk(tmp_path, 2 * MIB):
        await asyncio.to_thread(subprocess.run, ["mount", "-o", "remount,ro", tmp_path], check=True)
        with pytest.raises(StoreError) as error:
            async with open_store(tmp_path / "s.db", queue_batches=20):
                pass
    assert error.value.reason is StoreFault.READ_ONLY
    assert "writable" in error.value.why


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
async def test_a_folder_that_is_read_only(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(StoreError) as error:
        async with open_store(tmp_path / "s.db", queue_batches=20):
            pass
    assert error.value.reason is StoreFault.READ_ONLY


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (sqlite3.SQLITE_FULL, StoreFault.FULL),
        pytest.param(sqlite3.SQLITE_READONLY, StoreFault.READ_ONLY, marks=pytest.mark.full),
        (sqlite3.SQLITE_IOERR_FSYNC, StoreFault.IO),
        pytest.param(sqlite3.SQLITE_BUSY, StoreFault.LOCKED, marks=pytest.mark.full),
    ],
)
async def test_a_passing_fault_is_waited_out(opened, disk, code, reason):
    async with opened() as store:
        await store.append(made.second(KEY, 0))
        disk.fault = code
        waiting = [asyncio.create_task(store.append(made.second(KEY, k))) for k in range(1, 21)]
        await until(lambda: store.statistics().trouble)
        with pytest.raises(StoreError) as error:
            await store.append(made.second(KEY, 21))
        assert error.value.reason is reason
        assert not any(task.done() for task in waiting)
        disk.fault = None
        await asyncio.gather(*waiting)
        assert await count_of(store) == 42
        assert store.statistics().retries > 0
        await store.append(made.second(KEY, 21))
    assert (disk.opened > 1) == (reason is not StoreFault.FULL), "a connection that failed is opened anew"


async def test_damage_is_told_and_not_waited_out(opened, disk):
    async with opened() as store:
        disk.fault = sqlite3.SQLITE_CORRUPT
        with pytest.raises(StoreError) as error:
            await store.append(made.second(KEY, 0))
        assert (error.value.reason, error.value.is_passing) == (StoreFault.CORRUPT, False)
        assert store.statistics().trouble is error.value


async def test_a_job_that_fails_ends_alone(opened, disk):
    def stumbling(scribe):
        yield
        raise KeyError(scribe)

    async with opened() as store:
        with pytest.raises(StoreError) as error:
            await store._run(stumbling)
        assert error.value.reason is StoreFault.REFUSED
        disk.fault = sqlite3.SQLITE_IOERR
        with pytest.raises(StoreError) as error:
            await store.assign("sim-1", "ann")
        assert error.value.reason is StoreFault.IO
        disk.fault = None
        await store.append(made.second(KEY, 0))
        assert await store.assign("sim-1", "ann") == 1


async def test_a_writer_that_dies_leaves_nobody_waiting(opened, monkeypatch):
    died = []
    monkeypatch.setattr("threading.excepthook", died.append)
    async with opened() as store:
        monkeypatch.setattr(store._writer, "_record", None)
        for _ in range(2):
            with pytest.raises(StoreError) as error:
                await store.append(made.second(KEY, 0))
            assert error.value.reason is StoreFault.CLOSED
    assert len(died) == 1


async def test_closing_while_nothing_can_be_written_does_not_wait(opened, disk):
    async with opened() as store:
        disk.fault = sqlite3.SQLITE_FULL
        waiting = [asyncio.create_task(store.append(made.second(KEY, k))) for k in range(5)]
        await until(lambda: store.statistics().trouble)
        began_s = time.monotonic()
    assert time.monotonic() - began_s < 1
    outcomes = await asyncio.gather(*waiting, return_exceptions=True)
    assert {outcome.reason for outcome in outcomes} == {StoreFault.FULL}


async def test_what_was_queued_before_closing_is_written(opened):
    async with opened() as store:
        waiting = [asyncio.create_task(store.append(made.second(KEY, k))) for k in range(20)]
        await asyncio.sleep(0)
    await asyncio.gather(*waiting)
    async with opened() as store:
        assert await count_of(store) == 40


async def test_who_no_longer_waits_takes_no_room(opened):
    async with opened() as store:
        for k in range(40):
            task = asyncio.create_task(store.append(made.second(KEY, k)))
            await asyncio.sleep(0)
            task.cancel()
        await until(lambda: store.statistics().queued == 0)
        await store.append(made.second(KEY, 40))


async def watch_loop(lags):
    while True:
        began_s = time.perf_counter()
        await asyncio.sleep(0.002)
        lags.append(time.perf_counter() - began_s - 0.002)


async def check_slow_commits(opened, disk, commit_s):
    """The loop stays free; appending slows down; what was taken is stored; then there is an error that says why."""
    lags = []
    async with opened(patience_s=3 * commit_s) as store:
        watch = asyncio.create_task(watch_loop(lags))
        disk.commit_s = commit_s
        began_s = time.monotonic()
        tasks = [asyncio.create_task(store.append(made.second(KEY, k))) for k in range(20 * 6)]
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
        took_s = time.monotonic() - began_s
        watch.cancel()
        refused = [outcome for outcome in outcomes if outcome is not None]
        stored = len(outcomes) - len(refused)
        assert {outcome.reason for outcome in refused} == {StoreFault.BUSY}
        assert 20 <= stored < len(outcomes)
        assert await count_of(store) == 2 * stored
        assert took_s >= 2 * commit_s
        disk.commit_s = 0
    assert sorted(lags)[int(0.99 * len(lags))] < 0.05


async def test_slow_commits(opened, disk):
    await check_slow_commits(opened, disk, 0.1)


@pytest.mark.full
async def test_commits_of_two_seconds(opened, disk):
    await check_slow_commits(opened, disk, 2.0)
