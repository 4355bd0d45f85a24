"""A journal: what waits for the disk, what is stored together, and what becomes of it when the disk does not answer."""

import asyncio
import time

import pytest

from service.errors import StoreError, StoreFault
from service.events import Received
from service.pipeline.journal import HELD_CHUNKS, Journal, RestartPoint
from service.samples import DeviceInfo, RawBlock
from service.store.values import Cursor, LogEntry, LogPage, LogQuery, Note, SessionKey

INFO = DeviceInfo(device="dev-1", boot=1, rate_hz=50.0, lsb_per_g=4096.0)
KEY = SessionKey(device="dev-1", since_ns=1)


class Disk:
    """A store that keeps batches in a list, refuses with `fault` or, while `stuck`, never answers."""

    def __init__(self):
        self.batches = []
        self.fault = None
        self.stuck = False

    async def append(self, batch):
        if self.stuck:
            await asyncio.Event().wait()
        if self.fault is not None:
            raise StoreError(self.fault, "the disk says no")
        self.batches.append(batch)

    async def read(self, _query):
        entries = [entry for batch in self.batches for entry in batch.entries]
        return LogPage(entries=entries, next_after=None)


def journal(disk):
    made = Journal(disk)
    made.begin(KEY)
    return made


def entry(ordinal):
    return LogEntry(ordinal=ordinal, at_ns=ordinal, uncertainty_s=0.0, run=0, told=Note(kind="state", body={}))


def second(made, k):
    flat = [1.0] * 50
    block = RawBlock(boot=1, index=50 * k, tick=None, acc_g=(flat, flat, flat))
    made.received(Received(run=0, block=block), INFO, k)


def standing(index=50):
    return RestartPoint(cursor=Cursor(run=0, boot=1, index=index), state=lambda: {"index": index}, about={"name": "b"})


async def test_samples_events_and_their_place_are_one_batch():
    disk = Disk()
    made = journal(disk)
    second(made, 0)
    made.log(entry(1))
    await made.store(standing, lambda: 0)
    (batch,) = disk.batches
    assert [len(chunk) for chunk in batch.chunks] == [50]
    assert [one.ordinal for one in batch.entries] == [1]
    assert batch.cursor.index == 50
    assert batch.snapshot.state == {"index": 50}
    await made.store(lambda: standing(100), lambda: 1)
    assert disk.batches[1].snapshot is None
    assert disk.batches[1].about is None


async def test_nothing_is_stored_before_the_device_has_a_name():
    disk = Disk()
    made = Journal(disk)
    made.log(entry(1))
    await made.store(standing, lambda: 0)
    assert disk.batches == []
    made.begin(KEY)
    await made.store(standing, lambda: 0)
    assert [one.ordinal for one in disk.batches[0].entries] == [1]


async def test_what_was_cancelled_on_its_way_is_sent_again():
    disk = Disk()
    made = journal(disk)
    made.log(entry(1))
    disk.stuck = True
    task = asyncio.create_task(made.store(standing, lambda: 0))
    await asyncio.sleep(0.01)
    made.log(entry(2))
    page = await made.page(LogQuery(device="dev-1"))
    assert [one.ordinal for one in page.entries] == [1, 2]
    task.cancel()
    await asyncio.wait({task})
    disk.stuck = False
    await made.close(standing, lambda: 1)
    assert [one.ordinal for batch in disk.batches for one in batch.entries] == [1, 2]
    assert disk.batches[-1].snapshot is not None


async def test_a_disk_that_never_answers_does_not_hold_up_the_end(monkeypatch):
    monkeypatch.setattr("service.pipeline.journal.CLOSE_S", 0.1)
    disk = Disk()
    disk.stuck = True
    made = journal(disk)
    made.log(entry(1))
    began_s = time.monotonic()
    await made.close(standing, lambda: 1)
    assert time.monotonic() - began_s < 0.5


@pytest.mark.parametrize("more", [0, 5])
async def test_samples_that_find_no_room_are_made_up_for_by_a_snapshot(more):
    disk = Disk()
    made = journal(disk)
    await made.store(lambda: standing(0), lambda: 0)
    for k in range(HELD_CHUNKS + more):
        second(made, k)
    await made.store(lambda: standing(50 * (HELD_CHUNKS + more)), lambda: 1)
    assert len(disk.batches[-1].chunks) == HELD_CHUNKS
    assert disk.batches[-1].chunks[0].index == 50 * more
    assert (disk.batches[-1].snapshot is not None) == (more > 0)


async def test_what_is_refused_for_good_is_made_up_for_by_a_snapshot(caplog):
    disk = Disk()
    made = journal(disk)
    await made.store(lambda: standing(0), lambda: 0)
    disk.fault = StoreFault.REFUSED
    second(made, 0)
    await made.store(lambda: standing(50), lambda: 1)
    assert "not stored" in caplog.text
    disk.fault = None
    await made.store(lambda: standing(100), lambda: 2)
    assert disk.batches[-1].snapshot.cursor.index == 100


async def test_a_dropped_session_stores_nothing_more():
    disk = Disk()
    made = journal(disk)
    made.log(entry(1))
    made.drop()
    made.log(entry(2))
    second(made, 0)
    await made.store(standing, lambda: 0)
    assert disk.batches == []
    assert (await made.page(LogQuery(device="dev-1"))).entries == []


async def test_a_batch_that_cannot_be_stored_holds_up_nothing_and_is_made_up_for(caplog):
    disk = Disk()
    made = journal(disk)
    disk.append, real = None, disk.append  # whatever is called on it is a TypeError
    second(made, 0)
    await made.store(standing, lambda: 0)
    assert "not stored" in caplog.text
    disk.append = real
    await made.store(lambda: standing(100), lambda: 1)
    assert disk.batches[-1].snapshot.cursor.index == 100
    assert disk.batches[-1].about == {"name": "b"}


async def test_events_of_a_device_with_earlier_sessions_are_numbered_on():
    disk = Disk()
    made = Journal(disk)
    made.log(entry(1))
    made.log(entry(2))
    made.number_on(40)
    made.begin(KEY)
    await made.store(standing, lambda: 0)
    assert [one.ordinal for one in disk.batches[0].entries] == [41, 42]
