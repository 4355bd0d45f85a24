"""What goes out goes for good, oldest first, and recording hardly notices."""

import asyncio
import contextlib
import dataclasses
import random
import time

import pytest
from store import made

from service.store import database, keeping
from service.store.keeping import Retention
from service.store.reader import Reader
from service.store.scribe import Scribe
from service.store.store import open_store
from service.store.values import Batch

FORGOTTEN = "ann-7d1f"


@contextlib.contextmanager
def scribe_of(path):
    database.prepare(path)
    with contextlib.closing(database.connect_writer(path)) as connection:
        connection.execute("PRAGMA synchronous = OFF")  # nobody pulls the plug here
        yield Scribe(connection, set())


def write(scribe, batches):
    with database.transaction(scribe.connection):
        for batch in batches:
            scribe.write(batch)


def run(job):
    """Do a whole job; return how many pauses it made, and its result."""
    pauses = 0
    while True:
        try:
            next(job)
        except StopIteration as end:
            return pauses, end.value
        pauses += 1


def history(scribe, rng, rounds):
    """Record devices of several people in turns, short chunks before long ones, with retention now and then.

    Return pieces of everything that is FORGOTTEN's: ids, text, random samples. The first device is theirs.
    """
    keys = [made.session(f"bracelet-{rng.randbytes(4).hex()}") for _ in range(rng.randint(2, 5))]
    places, marks = dict.fromkeys(keys, 0), [FORGOTTEN.encode(), keys[0].device.encode()]
    for _ in range(rounds):
        batches = []
        for key in rng.choices(keys, k=rng.randint(1, 8)):
            k, samples, text = places[key], rng.randbytes(300), rng.randbytes(8).hex() * rng.randint(1, 60)
            places[key] = k + rng.randint(1, 2)
            whole = dataclasses.replace(made.chunk(50 * k, 50 * k + 50), acc=samples)
            part = dataclasses.replace(made.chunk(50 * k, 50 * k + 20), acc=samples[:120])
            entries = (made.step(2 * k + 1), made.note(2 * k + 2, "marker", text=text))
            person = FORGOTTEN if key is keys[0] else f"somebody-{keys.index(key)}"
            batches.append(Batch(session=key, chunks=(part,)))
            batches.append(
                Batch(
                    session=key,
                    person=person,
                    chunks=(whole,),
                    entries=entries,
                    about={"text": text},
                    snapshot=made.snapshot(50 * k, text=text),
                )
            )
            if key is keys[0]:
                marks += [samples[12:28], text[:16].encode()]
        write(scribe, batches)
        if rng.random() < 0.02:
            run(keeping.retain(scribe, Retention(raw_bytes=rng.randint(100_000, 600_000))))
    return marks


def found_in_files(folder, marks):
    contents = {file.name: file.read_bytes() for file in folder.iterdir()}
    return [(name, mark) for name, content in contents.items() for mark in marks if mark in content]


def check_nothing_is_left(folder, seed):
    rng = random.Random(seed)
    with scribe_of(folder / "s.db") as scribe:
        marks = history(scribe, rng, rng.randint(20, 200))
        assert {mark for _, mark in found_in_files(folder, marks)} > {FORGOTTEN.encode()}, "this search finds nothing"
        assert run(keeping.forget(scribe, FORGOTTEN))[1] == 1
        assert found_in_files(folder, marks) == []
        database.check(scribe.connection, folder / "s.db")
        left = Reader(scribe.connection, folder / "s.db").sessions()
        assert left
        assert FORGOTTEN not in {one.person for one in left}


def test_nothing_of_a_forgotten_person_is_in_any_file(tmp_path):
    check_nothing_is_left(tmp_path, 0)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(1, 31))
def test_nothing_of_a_forgotten_person_is_in_any_file_whatever_came_before(tmp_path, seed):
    check_nothing_is_left(tmp_path, seed)


@pytest.mark.full
async def test_a_deletion_that_was_interrupted_is_finished_at_the_next_start(tmp_path):
    """Left alone after each of its transactions, as a kill leaves it."""
    pauses = 1
    for begun in range(1, 9):
        folder = tmp_path / str(begun)
        folder.mkdir()
        with scribe_of(folder / "s.db") as scribe:
            marks = history(scribe, random.Random(5), 20)
            job = keeping.forget(scribe, FORGOTTEN)
            pauses = sum(1 for _ in zip(range(begun), job, strict=False))
        async with open_store(folder / "s.db", queue_batches=10) as store:
            assert len(await store.read(lambda reader: reader.sessions())) > 0
        assert found_in_files(folder, marks) == []
    assert pauses < begun, "it was interrupted after its last transaction too"


def test_the_oldest_samples_of_all_sessions_go_first(tmp_path):
    old, new = made.session("old"), made.session("new")
    with scribe_of(tmp_path / "s.db") as scribe:
        write(scribe, [Batch(session=old, chunks=(made.chunk(50 * k, 50 * k + 50, at_ns=k),)) for k in range(2000)])
        write(scribe, [Batch(session=new, chunks=(made.chunk(50 * k, 50 * k + 50, at_ns=9000),)) for k in range(2000)])
        before = keeping.used_bytes(scribe.connection)
        pauses, rows = run(keeping.retain(scribe, Retention(raw_bytes=before * 3 // 4)))
        scribe.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        assert keeping.used_bytes(scribe.connection) <= before * 3 // 4
        assert (tmp_path / "s.db").stat().st_size <= before * 3 // 4, "the file shrinks"
        assert pauses >= rows // keeping.SLICE_ROWS
        reader = Reader(scribe.connection, tmp_path / "s.db")
        assert len(reader.raw(new).values) == 100_000
        (span,) = reader.raw(old).spans
        assert span.index == 50 * rows
        assert 0 < rows < 2000


def test_no_limit_deletes_nothing(tmp_path):
    with scribe_of(tmp_path / "s.db") as scribe:
        write(scribe, [made.second(made.session(), k) for k in range(10)])
        assert run(keeping.retain(scribe, Retention())) == (0, 0)
        assert run(keeping.forget(scribe, "nobody"))[1] == 0


@pytest.mark.full
async def test_recording_goes_on_while_much_is_deleted(tmp_path):
    """And the end does not run away: what arrives meanwhile is left for the next time."""
    key, live = made.session("old"), made.session("live")
    with scribe_of(tmp_path / "s.db") as scribe:
        for k in range(0, 20_000, 1000):
            write(scribe, [made.second(key, second) for second in range(k, k + 1000)])
    async with open_store(tmp_path / "s.db", queue_batches=100) as store:
        deleting = asyncio.create_task(store.retain(Retention(raw_bytes=0, log_since_ns=1 << 62)))
        took_s, k = [], 0
        while not deleting.done():
            began_s = time.monotonic()
            await store.append(made.second(live, k))
            took_s.append(time.monotonic() - began_s)
            k += 1
        assert 60_000 <= await deleting < 60_000 + 3 * k
    slices = 60_000 // keeping.SLICE_ROWS
    took_s.sort()
    print(f"{k} batches meanwhile, p99 {took_s[int(0.99 * k)] * 1000:.0f} ms, the slowest {took_s[-1] * 1000:.0f} ms")
    assert slices <= k < 3 * slices
    assert took_s[int(0.9 * k)] < 0.2
