"""A disk that is full, read-only or slow under the whole service.

Counting and the feed go on, and in the end all of it is on the disk, once.
"""

import asyncio
import contextlib
import json
import sqlite3
import time

import pytest
from stage import default_tracker, serving
from store.disk import Disk, small_disk

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet, quantise
from device_sim.gait import Walker
from service.counters.registry import DEFAULT
from service.errors import StoreError, StoreFault
from service.pipeline import journal
from service.samples import Packet
from service.store import database
from service.store.reader import Reader
from service.store.values import LogQuery
from service.wearables import bracelet as wire

pytestmark = pytest.mark.full

SCRIPT = "normal:600"
SPEED = 8.0
STEPS = "devices/sim-1/steps?limit=1000"
MIB = 1 << 20


@contextlib.asynccontextmanager
async def walking():
    bracelet = Bracelet(Walker(SCRIPT, seed=3))
    async with LocalAir() as air, air.bracelet(bracelet, speed=SPEED):
        yield air


def stored(path):
    """What the database holds of the session: first sample, raw integers, steps of the log, the cursor's index."""
    with contextlib.closing(database.connect_reader(path)) as connection:
        reader = Reader(connection, path)
        reader.check()
        (session,) = reader.sessions()
        raw = reader.raw(session.key)
        log = reader.log(LogQuery(device="sim-1", kinds=frozenset({"step"}), limit=10_000))
    return session, raw, [entry.told.steps for entry in log.entries]


def check_nothing_is_lost_or_twice(path):
    """The disk has every sample from the first to the cursor as the bracelet measured it, and each step once."""
    session, raw, steps = stored(path)
    (span,) = raw.spans
    assert span.index + len(raw.values) == session.cursor.index
    measured = quantise(Walker(SCRIPT, seed=3).read(session.cursor.index), 4096)[span.index :]
    assert (raw.values * 4096 == measured).all()
    assert steps == list(range(1, session.steps[DEFAULT] + 1))
    assert session.steps == undisturbed(span.index, session.cursor.index)
    return session


def undisturbed(first, end):
    """What a Tracker counts that was given the samples [first, end) as the bracelet measured them, and nothing else."""
    bracelet = Bracelet(Walker(SCRIPT, seed=3), packet_samples=10)
    bracelet.measure(first)
    bracelet.discard()
    tracker = default_tracker(wire.Bracelet())
    said = {wire.BOOT: bracelet.boot_value(), wire.SCALE: bracelet.scale_value(), wire.RATE: bracelet.rate_value()}
    said |= {wire.SENSORS: bracelet.sensors_value(), wire.CLOCK: bracelet.clock_value()}
    for uuid, data in said.items():
        tracker.apply(Packet(characteristic=uuid, data=data, at_ns=0))
    while (index := first + tracker.tally.samples) < end:
        bracelet.measure(min(10, end - index))
        bracelet.packet_samples = min(10, end - index)
        tracker.apply(Packet(characteristic=wire.DATA, data=bracelet.next_packet(185), at_ns=0))
    return tracker.steps


def crash(path, left):
    """Leave what a killed service would have left on the disk at this moment."""
    with contextlib.closing(sqlite3.connect(path)) as there, contextlib.closing(sqlite3.connect(left)) as copy:
        there.backup(copy)


def counted_at_the_end(path):
    """Each counter's steps in the last snapshot, and the sample before which it was taken."""
    with contextlib.closing(database.connect_reader(path)) as connection:
        (found,) = Reader(connection, path).resume()
    return found.snapshot.state["tracker"]["steps"], found.snapshot.cursor.index


async def until_told(stage, ready):
    """Wait until the service says that it is ready, or not; return why not."""
    async with asyncio.timeout(15):
        while True:
            answer = await stage.http.get("readyz")
            if (answer.status_code == 200) == ready:
                return " ".join(answer.json()["reasons"])
            await asyncio.sleep(0.05)


async def goes_on(stage, more=40):
    """See that counting and the live feed go on, and that all steps are given, stored or not."""
    before = await stage.device()
    async with stage.live() as feed:
        fed = 0
        async with asyncio.timeout(20):
            while fed < more:
                fed += json.loads(await feed.recv())["type"] == "step"
    device = await stage.device()
    assert device["steps"] >= before["steps"] + more
    page = await stage.poll(STEPS, lambda page: len(page["items"]) >= device["steps"])
    assert [item["steps"] for item in page["items"]] == list(range(1, len(page["items"]) + 1))


@pytest.mark.parametrize(
    ("code", "why"), [(sqlite3.SQLITE_FULL, "full"), (sqlite3.SQLITE_READONLY, "writable"), (sqlite3.SQLITE_IOERR, "")]
)
async def test_a_disk_that_refuses_for_a_while(tmp_path, code, why):
    disk, path = Disk(), tmp_path / "s.db"
    async with walking() as air, serving(air, path=path, disk=disk) as stage:
        await stage.until(lambda device: device["steps"] > 20)
        await until_told(stage, True)
        disk.fault = code
        assert why in await until_told(stage, False)
        await goes_on(stage)
        disk.fault = None
        await until_told(stage, True)
        await goes_on(stage, more=20)
    assert check_nothing_is_lost_or_twice(path).steps[DEFAULT] > 80


async def test_a_disk_that_is_full(tmp_path):
    """A real one, of two megabytes."""
    with small_disk(tmp_path, 2 * MIB):
        path, ballast = tmp_path / "s.db", tmp_path / "ballast"
        async with walking() as air, serving(air, path=path) as stage:
            await stage.until(lambda device: device["steps"] > 20)
            with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
                while file.write(bytes(4096)):
                    pass
            assert "full" in await until_told(stage, False)
            await goes_on(stage)
            ballast.unlink()
            await until_told(stage, True)
            await goes_on(stage, more=20)
        check_nothing_is_lost_or_twice(path)


async def test_commits_that_take_two_seconds(tmp_path):
    disk, path, lags = Disk(), tmp_path / "s.db", []

    async def watch():
        while True:
            began_s = time.perf_counter()
            await asyncio.sleep(0.002)
            lags.append(time.perf_counter() - began_s - 0.002)

    async with walking() as air, serving(air, path=path, disk=disk) as stage:
        await stage.until(lambda device: device["steps"] > 20)
        disk.commit_s = 2.0
        watching = asyncio.create_task(watch())
        await goes_on(stage, more=100)
        watching.cancel()
        disk.commit_s = 0.0
    p99_s = sorted(lags)[int(0.99 * len(lags))]
    print(f"loop lag p99 {p99_s * 1000:.1f} ms")
    assert p99_s < 0.05
    check_nothing_is_lost_or_twice(path)


@pytest.mark.parametrize("held", ["HELD_CHUNKS", "HELD_ENTRIES"])
async def test_more_waits_than_there_is_room_for_and_the_count_is_right_after_a_crash(tmp_path, monkeypatch, held):
    monkeypatch.setattr(journal, held, 20)
    disk, path = Disk(), tmp_path / "s.db"
    async with walking() as air:
        async with serving(air, path=path, disk=disk) as stage:
            await stage.until(lambda device: device["steps"] > 20)
            disk.fault = sqlite3.SQLITE_FULL
            before = await stage.device()
            await stage.until(lambda device: device["samples"] > before["samples"] + 50 * 40)
            disk.fault = None
            await until_told(stage, True)
            await stage.until(lambda device: device["samples"] > before["samples"] + 50 * 80)
            before = await stage.device()
            await asyncio.to_thread(crash, path, tmp_path / "crashed.db")
        path = tmp_path / "crashed.db"
        async with serving(air, path=path) as stage:
            assert (await stage.device())["steps"] >= before["steps"] - 2 * SPEED, "more than a batch is gone"
            await stage.until(lambda device: device["samples"] > before["samples"] and not device["samples_awaited"])
            after = await stage.until(lambda device: device["steps"] > before["steps"] + 20)
            assert after["samples_lost"] == 0
        session, raw, _ = stored(path)
    first = raw.spans[0].index
    steps, end = counted_at_the_end(path)
    assert steps == undisturbed(first, end)
    assert end == session.cursor.index
    assert (len(raw.values) < session.cursor.index - first) == (held == "HELD_CHUNKS")


async def test_a_database_that_cannot_be_read_is_a_503_for_now(tmp_path, monkeypatch):
    async with walking() as air, serving(air, path=tmp_path / "s.db") as stage:
        await stage.until(lambda device: device["steps"] > 5)

        def unreadable(_reader, _query):
            raise StoreError(StoreFault.LOCKED, "another program holds s.db: end it")

        monkeypatch.setattr(Reader, "log", unreadable)
        answer = await stage.http.get(f"api/v1/{STEPS}")
        assert (answer.status_code, answer.json()) == (503, {"detail": "another program holds s.db: end it"})
        monkeypatch.undo()
        assert (await stage.http.get(f"api/v1/{STEPS}")).status_code == 200
