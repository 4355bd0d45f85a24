"""A thousand devices at once, nine bytes a sample, a day read in a second."""

import asyncio
import contextlib
import time

import numpy as np
import pytest
from store import made

from service.store import database
from service.store.reader import Reader
from service.store.scribe import Scribe
from service.store.store import open_store
from service.store.values import Batch, Chunk, stretches

DEVICES = 1000
SECONDS = 15
DAY_S = 86_400
WALKED = 0.1
"""Share of the day that is walked: 17,000 steps, more than most people's."""


async def record(store, key, seed, took_s):
    """Append a second's chunk and steps each second, as a session does."""
    await asyncio.sleep(seed / DEVICES)
    due_s = time.monotonic()
    for k in range(SECONDS):
        began_s = time.monotonic()
        await store.append(made.second(key, k, seed=seed))
        took_s.append(time.monotonic() - began_s)
        due_s += 1
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))


@pytest.mark.full
async def test_a_thousand_devices_at_once(tmp_path):
    keys = [made.session(f"bracelet-{n}") for n in range(DEVICES)]
    took_s = []
    async with open_store(tmp_path / "s.db", queue_batches=2 * DEVICES) as store:
        began_s, cpu_s = time.monotonic(), time.process_time()
        await asyncio.gather(*(record(store, key, seed, took_s) for seed, key in enumerate(keys)))
        elapsed_s, cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
        told = store.statistics()
        assert (await store.read(lambda reader: reader.statistics()))["log"] == 2 * DEVICES * SECONDS
        for seed in (0, 1, DEVICES - 1):
            raw = await store.read(lambda reader, key=keys[seed]: reader.raw(key))
            expected = np.frombuffer(made.column(0, SECONDS * 50, seed), "<i2").reshape(-1, 3)
            assert np.array_equal(raw.values * 4096, expected)
    took_s.sort()
    print(
        f"{cpu_s / elapsed_s:.0%} of a core, append p50 {took_s[len(took_s) // 2] * 1000:.0f} ms, "
        f"p99 {took_s[int(0.99 * len(took_s))] * 1000:.0f} ms, {told.commits} commits, "
        f"the longest {told.longest_commit_s * 1000:.0f} ms"
    )
    assert elapsed_s < SECONDS + 2, "it fell behind"
    assert took_s[int(0.99 * len(took_s))] < 1


def write_day(path, key):
    """A day of one bracelet, a tenth of it walked; return its samples."""
    database.prepare(path)
    samples = made.walk_counts(DAY_S * made.RATE_HZ)
    ordinal = 0
    with contextlib.closing(database.connect_writer(path)) as connection:
        scribe = Scribe(connection, set())
        for minute in range(DAY_S // 60):
            with database.transaction(connection):
                for k in range(60 * minute, 60 * minute + 60):
                    entries = ()
                    if k % 600 < 600 * WALKED:
                        entries = (made.step(ordinal + 1, at_s=k + 0.25), made.step(ordinal + 2, at_s=k + 0.75))
                        ordinal += 2
                    scribe.write(Batch(session=key, chunks=(second_of(samples, k),), entries=entries))
    return np.frombuffer(samples, "<i2").reshape(-1, 3)


def second_of(samples, k):
    first, end = 50 * k, 50 * k + 50
    return Chunk(
        run=0,
        boot=7,
        index=first,
        at_ns=made.SINCE_NS + k * made.SECOND_NS,
        layout=made.LAYOUT,
        ticks=tuple(made.tick(first // 128 + n) for n in range(stretches(first, end))),
        acc=samples[6 * first : 6 * end],
    )


@pytest.mark.full
async def test_a_day_of_one_device(tmp_path):
    path, key = tmp_path / "s.db", made.session()
    samples = write_day(path, key)
    bytes_a_sample = path.stat().st_size / len(samples)
    lags = []
    async with open_store(path, queue_batches=10) as store:

        async def watch():
            while True:
                began_s = time.perf_counter()
                await asyncio.sleep(0.001)
                lags.append(time.perf_counter() - began_s - 0.001)

        watching = asyncio.create_task(watch())
        began_s = time.perf_counter()
        raw = await store.read(lambda reader: reader.raw(key))
        took_s = time.perf_counter() - began_s
        watching.cancel()
    print(f"{bytes_a_sample:.2f} bytes a sample, read in {took_s:.2f} s, the loop held up to {max(lags) * 1000:.1f} ms")
    assert np.array_equal(raw.values * 4096, samples)
    assert bytes_a_sample <= 9
    assert took_s <= 1
    assert sorted(lags)[int(0.99 * len(lags))] < 0.02


@pytest.mark.full
def test_bytes_a_sample_of_many_devices_recorded_in_turns(tmp_path):
    """Pages are less full where sessions grow side by side."""
    database.prepare(tmp_path / "s.db")
    with contextlib.closing(database.connect_writer(tmp_path / "s.db")) as connection:
        scribe = Scribe(connection, set())
        for k in range(600):
            with database.transaction(connection):
                for seed in range(100):
                    scribe.write(Batch(session=made.session(f"b{seed}"), chunks=made.second(None, k, seed=seed).chunks))
        with contextlib.closing(database.connect_reader(tmp_path / "s.db")) as reading:
            assert len(Reader(reading, tmp_path / "s.db").raw(made.session("b7")).values) == 30_000
    bytes_a_sample = (tmp_path / "s.db").stat().st_size / (100 * 600 * 50)
    print(f"{bytes_a_sample:.2f} bytes a sample")
    assert bytes_a_sample <= 9
