"""Half an hour of one device, with holes that are filled in, leaves nothing behind: memory, descriptors, tasks stay."""

import asyncio
import gc
import tracemalloc
from pathlib import Path

import pytest
from waiting import Device as Walk
from waiting import waiting

from service.pipeline import journal
from service.pipeline.session import Session
from service.store.store import open_store

FDS = Path("/proc/self/fd")
LASTS_S = 1800
PART_S = 300
"""What comes between two looks; in each some samples are missed, and sent again a minute later."""
MISSED = range(100, 300)


def standing():
    """Bytes that Python has handed out, open descriptors, and tasks."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0], len(list(FDS.iterdir())), len(asyncio.all_tasks())


async def hear(session, packets):
    for packet in packets:
        session.apply(packet)
        await asyncio.sleep(0)


async def part(session, worn, first):
    """Five minutes from sample `first` on."""
    live = worn.live(start=first)[: PART_S * 5]
    await hear(session, [one for k, one in enumerate(live[:600]) if k not in MISSED])
    while (missing := session.tracker.wanted()) is not None:
        session.tracker.ask(missing)
        await hear(session, worn.history(missing))
    await hear(session, live[600:])
    async with asyncio.timeout(10):
        while session.tracker.has_work:  # noqa: ASYNC110  # what is waited for has no event
            await asyncio.sleep(0.01)
    await asyncio.sleep(0.3)


@pytest.mark.full
@pytest.mark.skipif(not FDS.exists(), reason="descriptors are counted where Linux lists them")
async def test_half_an_hour_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "BATCH_S", 0.05)
    worn = Walk(seconds=LASTS_S)
    async with open_store(tmp_path / "s.db", queue_batches=100) as store:
        session = Session(lambda: "sim-1", waiting(), lambda _notice: None, journal.Journal(store))
        keeping = asyncio.create_task(session.keep())
        tracemalloc.start()
        try:
            await hear(session, worn.said)
            looks = []
            for first in range(0, LASTS_S * 50, PART_S * 50):
                await part(session, worn, first)
                looks.append(standing())
        finally:
            tracemalloc.stop()
        keeping.cancel()
        await asyncio.wait({keeping})
        await session.close()
        (one,) = await store.read(lambda reader: reader.sessions())
        assert one.cursor.index == LASTS_S * 50
        assert one.steps["double_threshold"] == session.tracker.total > 2000
        assert len((await store.read(lambda reader: reader.raw(one.key))).values) == LASTS_S * 50
    print(looks)
    memory, descriptors, tasks = zip(*looks[1:], strict=True)
    assert max(memory) - memory[0] < 50_000, "a float kept of each sample would be ten times that"
    assert len({*descriptors}) == len({*tasks}) == 1
