"""What every store is held to. A kind of store gives `reopen`: a context that opens the same one, again and again."""

import asyncio
import dataclasses

import numpy as np
import pytest
from store import made

from service.errors import StoreError, StoreFault
from service.samples import Sensor
from service.store.keeping import Retention
from service.store.values import Batch, Description, LogQuery

KEY = made.session()
OTHER = made.session("sim-2")


async def steps(store, device="sim-1", **query):
    page = await store.read(lambda reader: reader.log(LogQuery(device=device, limit=1000, **query)))
    return list(page.entries)


async def signal(store, key=KEY, **where):
    return await store.read(lambda reader: reader.raw(key, **where))


async def replayed(store, key=KEY, after=None, limit=1000):
    items = []
    while True:
        page = await store.read(lambda reader, after=after: reader.replay(key, after, limit=limit))
        items += page.items
        if page.after is None:
            return items
        after = page.after


async def session_of(store, key=KEY):
    (found,) = [one for one in await store.read(lambda reader: reader.sessions(key.device)) if one.key == key]
    return found


async def everything(store):
    """All that a store tells of two devices, for comparison."""
    told = []
    for key in (KEY, OTHER):
        raw = await signal(store, key)
        told += [await steps(store, key.device), raw.values.tolist(), list(raw.spans), await replayed(store, key)]
    return told, await store.read(lambda reader: (reader.devices(), reader.sessions(), reader.resume()))


def bytes_of(first, end, seed=0):
    return np.frombuffer(made.column(first, end, seed), dtype="<i2").reshape(-1, 3) / 4096.0


async def check_what_was_appended_is_there_after_a_restart(reopen):
    batches = [made.second(KEY, k) for k in range(5)]
    async with reopen() as store:
        await asyncio.gather(*(store.append(batch) for batch in batches))
        before = await everything(store)
    async with reopen() as store:
        assert await everything(store) == before
        assert await steps(store) == [told for batch in batches for told in batch.entries]
        assert np.array_equal((await signal(store)).values, bytes_of(0, 250))
        found = await session_of(store)
    assert (found.cursor, found.steps, found.ended_ns) == (made.cursor(250), {"double_threshold": 10}, None)


async def check_appending_again_in_any_order_changes_nothing(reopen):
    batches = [made.second(key, k, seed=len(key.device)) for key in (KEY, OTHER) for k in range(6)]
    async with reopen() as store:
        await asyncio.gather(*(store.append(batch) for batch in made.shuffled(batches, 1)))
        before = await everything(store)
        await asyncio.gather(*(store.append(batch) for batch in made.shuffled(batches, 2)))
        assert await everything(store) == before
    async with reopen() as store:
        await asyncio.gather(*(store.append(batch) for batch in made.shuffled(batches, 3)))
        assert await everything(store) == before


async def check_a_step_is_one_whatever_its_number(reopen):
    """Counted again after a crash, it may get another number; a counter that came back counts from one again."""
    async with reopen() as store:
        await store.append(Batch(session=KEY, entries=(made.step(1, at_s=1.0), made.step(2, at_s=1.5))))
        await store.append(Batch(session=KEY, entries=(made.step(7, at_s=1.5), made.step(8, at_s=2.0))))
        await store.append(Batch(session=KEY, entries=(made.step(9, at_s=9.0, count=1),)))
        assert [told.ordinal for told in await steps(store)] == [1, 2, 8, 9]
        relabelled = dataclasses.replace(made.step(8, at_s=2.0), at_ns=5, uncertainty_s=9.0)
        await store.append(Batch(session=KEY, entries=(relabelled,)))
        assert (await steps(store, after=2))[0] == made.step(8, at_s=2.0), "what was told first stays"
        assert (await session_of(store)).steps == {"double_threshold": 4}
        (device,) = await store.read(lambda reader: reader.devices())
    assert (device.first_ordinal, device.last_ordinal) == (1, 9)


async def check_a_number_tells_one_event_only(reopen):
    async with reopen() as store:
        await store.append(Batch(session=KEY, entries=(made.step(1),)))
        other = Batch(session=KEY, chunks=(made.chunk(0, 50),), entries=(made.note(1),))
        sound = made.second(OTHER, 0)
        outcomes = await asyncio.gather(store.append(other), store.append(sound), return_exceptions=True)
        assert [type(outcome) for outcome in outcomes] == [StoreError, type(None)]
        assert outcomes[0].reason is StoreFault.REFUSED
        assert await steps(store) == [made.step(1)]
        assert len((await signal(store)).values) == 0, "part of a refused batch was stored"
        assert len(await steps(store, "sim-2")) == 2


async def check_events_page_by_page(reopen):
    entries = [made.step(n) if n % 3 else made.note(n, at_ns=made.step(n).at_ns, samples=n) for n in range(1, 31)]
    async with reopen() as store:
        await store.append(Batch(session=KEY, entries=entries))
    async with reopen() as store:
        seen, after = [], 0
        while after is not None:
            query = LogQuery(device="sim-1", after=after, limit=7)
            page = await store.read(lambda reader, query=query: reader.log(query))
            seen += page.entries
            after = page.next_after
        assert seen == entries
        assert await steps(store, kinds=frozenset({"gap"})) == [told for told in entries if told.ordinal % 3 == 0]
        assert await steps(store, "nobody") == []


async def check_events_by_time_and_counter(reopen):
    entries = [made.step(n, counter=("double_threshold", "adaptive_peak")[n % 2]) for n in range(1, 21)]
    low, high = entries[4].at_ns, entries[12].at_ns
    async with reopen() as store:
        await store.append(Batch(session=KEY, entries=entries))
        assert await steps(store, from_ns=low, to_ns=high) == entries[4:12]
        assert await steps(store, from_ns=low, after=10, counter="adaptive_peak") == entries[10::2]
        assert await steps(store, to_ns=low) == entries[:4]
        assert await steps(store, counter="unknown") == []


async def check_open_sessions_are_resumed(reopen):
    state = {"steps": {"double_threshold": 4}, "place": 0.1 + 0.2, "held": None, "deep": [[1.5e-300]]}
    async with reopen() as store:
        await store.append(made.second(OTHER, 0))
        await store.append(Batch(session=OTHER, ended_ns=made.SINCE_NS + 1))
        await store.append(dataclasses.replace(made.second(KEY, 0), about={"counters": ["double_threshold"]}))
        await store.append(Batch(session=KEY, snapshot=made.snapshot(50, **state)))
        await store.append(made.second(KEY, 1))
    async with reopen() as store:
        (found,) = await store.read(lambda reader: reader.resume())
        assert (found.key, found.cursor, found.last_ordinal) == (KEY, made.cursor(100), 4)
        assert found.about == {"counters": ["double_threshold"]}
        assert found.snapshot.state == state
        assert await replayed(store, after=found.snapshot.cursor) == [made.second(KEY, 1).chunks[0]]


async def check_cursors_and_snapshots_never_go_back(reopen):
    async with reopen() as store:
        await store.append(Batch(session=KEY, cursor=made.cursor(100), snapshot=made.snapshot(100)))
        await store.append(Batch(session=KEY, cursor=made.cursor(50), snapshot=made.snapshot(50)))
        (found,) = await store.read(lambda reader: reader.resume())
        assert (found.cursor, found.snapshot) == (made.cursor(100), made.snapshot(100))
        await store.append(Batch(session=KEY, cursor=made.cursor(3, run=1), snapshot=made.snapshot(3, run=1)))
        (found,) = await store.read(lambda reader: reader.resume())
        assert (found.cursor, found.snapshot) == (made.cursor(3, run=1), made.snapshot(3, run=1))


async def check_raw_samples_each_once_and_in_order(reopen):
    """Chunks that came late, that lie over each other, and a device that started again."""
    late = [made.chunk(200, 250), made.chunk(0, 30), made.chunk(0, 50), made.chunk(40, 90), made.chunk(60, 80)]
    async with reopen() as store:
        chunks = [*late, made.chunk(0, 50, run=1)]
        await asyncio.gather(*(store.append(Batch(session=KEY, chunks=(chunk,))) for chunk in chunks))
    async with reopen() as store:
        raw = await signal(store)
        spans = [(span.run, span.index, span.samples, span.row) for span in raw.spans]
        assert spans == [(0, 0, 90, 0), (0, 200, 50, 90), (1, 0, 50, 140)]
        assert np.array_equal(raw.values, np.concatenate([bytes_of(0, 90), bytes_of(200, 250), bytes_of(0, 50, 31)]))
        part = await signal(store, start=made.cursor(45), stop=made.cursor(210))
        assert np.array_equal(part.values, np.concatenate([bytes_of(45, 90), bytes_of(200, 210)]))
        for limit in (1, 2, 1000):
            items = await replayed(store, after=made.cursor(45), limit=limit)
            assert [(item.run, item.index, item.end) for item in items] == [
                (0, 45, 50), (0, 50, 90), (0, 200, 250), (1, 0, 50),
            ]  # fmt: skip
            assert b"".join(item.acc for item in items[:2]) == made.column(45, 90)
            assert items[2].ticks == (made.tick(1),)


async def check_other_sensors(reopen):
    layout = dataclasses.replace(made.LAYOUT, lsb_per_rad_s=1000.0)
    chunk = made.chunk(0, 50, gyro=True, layout=layout)
    async with reopen() as store:
        await store.append(Batch(session=KEY, chunks=(chunk,)))
        assert await replayed(store) == [chunk]
        gyro = await signal(store, sensor=Sensor.GYROSCOPE)
        assert np.array_equal(gyro.values, bytes_of(0, 50, 7) * 4096 / 1000)
        assert len((await signal(store, sensor=Sensor.MAGNETOMETER)).values) == 0


async def check_what_a_device_said_is_replayed_in_its_place(reopen):
    said = [
        Description(run=run, boot=7, index=index, at_ns=made.SINCE_NS, characteristic="clock", value=bytes([index]))
        for run, index in ((0, 0), (0, 20), (0, 50), (1, 0))
    ]
    async with reopen() as store:
        await store.append(Batch(session=KEY, descriptions=said))
        await store.append(Batch(session=KEY, descriptions=said, chunks=(made.chunk(0, 50), made.chunk(50, 100))))
        for limit in (1, 2, 1000):
            items = await replayed(store, limit=limit)
            assert items == [
                said[0], made.chunk(0, 20), said[1], made.chunk(20, 50), said[2], made.chunk(50, 100), said[3],
            ]  # fmt: skip


async def check_a_persons_data_go_for_good(reopen):
    async with reopen() as store:
        for key, person in ((KEY, "ann"), (OTHER, None), (made.session(since_ns=made.SINCE_NS + 9), "bob")):
            first = 101 if person == "bob" else None
            await store.append(dataclasses.replace(made.second(key, 0, first_ordinal=first), person=person))
        assert await store.assign("sim-2", "ann") == 1
        assert await store.forget("ann") == 2
        assert await store.forget("ann") == 0
        with pytest.raises(StoreError) as refused:
            await store.append(made.second(KEY, 1))
        assert refused.value.reason is StoreFault.GONE
    async with reopen() as store:
        sessions, devices = await store.read(lambda reader: (reader.sessions(), reader.devices()))
        assert [(one.key.since_ns, one.person) for one in sessions] == [(made.SINCE_NS + 9, "bob")]
        assert [(one.device, one.person) for one in devices] == [("sim-1", None)]
        assert [told.ordinal for told in await steps(store)] == [101, 102]
        assert len((await signal(store, KEY)).values) == len(await steps(store, "sim-2")) == 0


async def check_old_raw_samples_go_and_steps_stay(reopen):
    """Oldest first; not those that a restart needs, those after the snapshot."""
    async with reopen() as store:
        await asyncio.gather(*(store.append(made.second(KEY, k)) for k in range(20)))
        await store.append(Batch(session=KEY, snapshot=made.snapshot(500)))
        since_ns = made.SINCE_NS + 15 * made.SECOND_NS
        await store.retain(Retention(raw_since_ns=since_ns))
        assert [span.index for span in (await signal(store)).spans] == [500], "what comes after the snapshot stays"
        await store.append(Batch(session=KEY, ended_ns=made.SINCE_NS + 99 * made.SECOND_NS))
        assert await store.retain(Retention(raw_since_ns=since_ns)) == 5
        assert len(await steps(store)) == 40
        assert await store.retain(Retention(log_since_ns=since_ns)) == 30
        assert [told.ordinal for told in await steps(store)] == list(range(31, 41))
        assert (await session_of(store)).steps == {"double_threshold": 40}
        await store.retain(Retention(raw_bytes=0))
        assert len((await signal(store)).values) == 0


async def check_closed_is_closed(reopen):
    async with reopen() as store:
        await store.append(made.second(KEY, 0))
    with pytest.raises(StoreError) as refused:
        await store.append(made.second(KEY, 1))
    assert refused.value.reason is StoreFault.CLOSED


CHECKS = [check for name, check in sorted(globals().items()) if name.startswith("check_")]
