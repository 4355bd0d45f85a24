"""A session taken up again tells what it had not told, and that only."""

import pytest
import waiting

from service.events import StepCounted
from service.pipeline.journal import Journal
from service.pipeline.session import Session
from service.store.store import open_store
from service.store.values import LogQuery
from service.tracking.requests import Missing

NOW_NS = 1_800_000_000_000_000_000


def session(store):
    return Session(lambda: "dev-1", waiting.waiting(), lambda _: None, Journal(store))


async def logged(store):
    """What the log has, but of corrections: what was likely is forgotten in a crash."""
    page = await store.read(lambda reader: reader.log(LogQuery(device="dev-1", limit=1000)))
    return [what for entry in page.entries if (what := plain(entry))[1] != "correction"]


def plain(entry):
    """An event without how well times are known, which depends on how many samples came at once."""
    told = entry.told
    if isinstance(told, StepCounted):
        return entry.run, told.counter, told.boot, told.steps, told.step
    return entry.run, told.kind, told.body


async def crash(store, before):
    """Leave a session as it was stored last; return the one that goes on."""
    (found,) = await store.read(lambda reader: reader.resume())
    after = session(store)
    after.resume(found)
    page = await store.read(lambda reader: reader.replay(found.key, found.snapshot.cursor))
    for item in page.items:
        after.replay(item, found.cursor)
    assert after.since_ns == before.since_ns
    return after


async def keep(one):
    """Store a batch; the first has a snapshot, those of the next 30 s have none."""
    await one.journal.store(one._standing, lambda: NOW_NS)


def take(one, packets):
    """Apply packets and count at once what can be."""
    for packet in packets:
        one.apply(packet)
        while one.tracker.has_work:
            one.catch_up()


async def whole(path, packets):
    async with open_store(path, queue_batches=10) as store:
        one = session(store)
        take(one, packets)
        await one.close()
        return await logged(store)


async def test_what_waited_to_be_counted_when_it_was_stored_is_told_after_the_restart(tmp_path):
    """A hole has closed, and the service ended before it had counted again what was behind it."""
    device = waiting.Device(60)
    live = device.live()
    late = device.history(Missing(boot=1, first=1000, samples=1000))[:-1]
    counted = await whole(tmp_path / "counted.db", [*device.said, *live[:100]])
    truth = await whole(tmp_path / "truth.db", [*device.said, *live])
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        before = session(store)
        for packet in [*device.said, *live[:100], *live[200:], *late]:
            before.apply(packet)
        assert before.tracker.has_work
        await before.close()
        assert await logged(store) == counted
        after = await crash(store, before)
        await after.close()
        assert await logged(store) == truth


def rebooted():
    """A device that starts again while samples are awaited, and is heard of when the new boot's first are over."""
    first, then = waiting.Device(30), waiting.Device(30, seed=4, boot=2)
    lost, late = slice(0, 80), slice(100, 150)
    live, more = first.live(), then.live()
    return [
        *first.said,
        *live[lost],
        *live[late],
        *then.said,
        *more[40:60],
        *then.history(Missing(boot=2, first=0, samples=400))[:-1],
        *more[60:],
    ]


@pytest.mark.full
@pytest.mark.parametrize("lag", [0, 3])
@pytest.mark.parametrize("saved", [20, 81, 120, 160])
async def test_a_crash_at_any_packet_tells_nothing_twice_and_leaves_nothing_out(tmp_path, saved, lag):
    """Stored at `saved` with a snapshot and `after` packets later without one, the last `lag` not counted yet."""
    packets = rebooted()
    truth = await whole(tmp_path / "truth.db", packets)
    assert {"gap", "reboot", "double_threshold"} == {told[1] for told in truth}
    for after in (1, 5, 21, 39, 55, 77, 91):
        end = saved + after
        async with open_store(tmp_path / f"{after}.db", queue_batches=10) as store:
            before = session(store)
            take(before, packets[:saved])
            await keep(before)
            take(before, packets[saved : end - lag])
            for packet in packets[max(saved, end - lag) : end]:
                before.apply(packet)
            await keep(before)
            resumed = await crash(store, before)
            take(resumed, packets[end:])
            await resumed.close()
            assert await logged(store) == truth, after
