"""Walks in the log: stored as they were told, with the host time of their own moment, and told once over a restart."""

import pytest
from fakes import GateCounter, MetronomeCounter, data_packets, described

from service.events import StepCounted, Walked
from service.pipeline.journal import Journal
from service.pipeline.notices import notice_of
from service.pipeline.session import Session
from service.store.store import open_store
from service.store.values import LogQuery
from service.tracking.backfill import BackfillTracker
from service.wearables import bracelet as wire

NOW_NS = 1_800_000_000_000_000_000
COUNTERS = {"gate": GateCounter, "metronome": MetronomeCounter}
WALKS = [(7.66, True), (19.66, False)]
"""Of the first turn of the ramp: when they are told, and whether they begin."""


def session(store, told):
    tracker = BackfillTracker(wire.Bracelet(), COUNTERS, primary="gate")
    return Session(lambda: "dev-1", tracker, told.append, Journal(store))


def apply(one, packets):
    for packet in packets:
        one.apply(packet)


async def logged(store):
    query = LogQuery(device="dev-1", kinds=frozenset({"walk"}))
    return (await store.read(lambda reader: reader.log(query))).entries


def only(told, kind):
    return [notice for notice in told if isinstance(notice.event, kind)]


async def test_a_walk_comes_back_from_the_store_as_it_was_told(tmp_path):
    told = []
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        one = session(store, told)
        apply(one, [*described(), *data_packets([10] * 120)])
        await one.close()
        entries = await logged(store)
    walked = only(told, Walked)
    assert [(notice.event.at_s, notice.event.begins) for notice in walked] == WALKS
    assert [notice_of(entry, "dev-1") for entry in entries] == walked
    steps = {notice.event.step.at_s: notice.at_ns for notice in only(told, StepCounted)}
    assert steps[8.0] - walked[0].at_ns == pytest.approx(0.34e9, abs=1e6)  # of then, not of when it was certain


@pytest.mark.parametrize("stored", [60, pytest.param(100, marks=pytest.mark.full)])
async def test_over_a_restart_walks_are_told_once_and_what_was_refused_goes_on(tmp_path, stored):
    """Stored with a snapshot in the middle of what may be a walk, or of a walk; then killed, and begun again."""
    packets, whole = list(data_packets([10] * 150)), session(None, [])
    apply(whole, [*described(), *packets])
    told = []
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        before = session(store, [])
        apply(before, [*described(), *packets[: stored - 15]])
        await before.journal.store(before._standing, lambda: NOW_NS)
        apply(before, packets[stored - 15 : stored])
        await before.journal.store(before._standing, lambda: NOW_NS)
        (found,) = await store.read(lambda reader: reader.resume())
        after = session(store, told)
        after.resume(found)
        page = await store.read(lambda reader: reader.replay(found.key, found.snapshot.cursor))
        for item in page.items:
            after.replay(item, found.cursor)
        apply(after, packets[stored:])
        await after.close()
        entries = await logged(store)
    assert [(entry.told.body["at_s"], entry.told.body["begins"]) for entry in entries] == WALKS
    assert after.tracker.gait == whole.tracker.gait
    assert after.tracker.refused == whole.tracker.refused != {}
