"""A session taken up again tells what it had not told, and that only."""

import waiting

from service.pipeline.journal import Journal
from service.pipeline.session import Session
from service.samples import StepCounted
from service.store.store import open_store
from service.store.values import LogQuery
from service.tracking.requests import Missing


def session(store):
    return Session(lambda: "dev-1", waiting.waiting(), lambda _: None, Journal(store))


async def steps_in(store):
    page = await store.read(lambda reader: reader.log(LogQuery(device="dev-1", kinds=frozenset({"step"}), limit=1000)))
    return [(entry.told.steps, entry.told.step) for entry in page.entries]


def truth(device, end):
    told = waiting.run(waiting.plain(), [*device.said, *device.live()[:end]])
    return [(event.steps, event.step) for event in told if isinstance(event, StepCounted)]


async def test_what_waited_to_be_counted_when_it_was_stored_is_told_after_the_restart(tmp_path):
    """A hole has closed, and the service ended before it had counted again what was behind it."""
    device = waiting.Device(60)
    live = device.live()
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        before = session(store)
        late = device.history(Missing(boot=1, first=1000, samples=1000))[:-1]
        for packet in [*device.said, *live[:100], *live[200:], *late]:
            before.apply(packet)
        assert before.tracker.has_work
        await before.close()
        assert await steps_in(store) == truth(device, 100)
        (found,) = await store.read(lambda reader: reader.resume())
        after = session(store)
        after.resume(found)
        page = await store.read(lambda reader: reader.replay(found.key, found.snapshot.cursor))
        for item in page.items:
            after.replay(item, found.cursor)
        await after.close()
        assert await steps_in(store) == truth(device, 300)
