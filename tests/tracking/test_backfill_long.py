"""What comes late is counted where it belongs, for long: every counter, real recordings, reboots and restarts."""

import json
import time
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waiting import Device, check_order, fold_state, heal, plain, run, steps_of, storm, waiting

from service.counters import registry
from service.events import Awaited, Corrected, Gap, Heard, Rebooted, Received, StepCounted
from service.samples import Sensor

pytestmark = pytest.mark.full

PRIMARY = "double_threshold"
EVERY = [PRIMARY, *(name for name in registry.COUNTERS if name != PRIMARY)]
SEEDS = st.integers(0, 2**32 - 1)
DURABLE = (StepCounted, Gap, Rebooted)
REAL = ["banglejs_walk/walk_100", "dcaiti/record20180113_134518"]


def only(events, kind):
    return [event for event in events if isinstance(event, kind)]


@settings(max_examples=3)
@given(seed=SEEDS, loss=st.sampled_from([0.05, 0.2]))
def test_with_history_every_counter_is_as_without_loss(seed, loss):
    device = Device(60, sensors=tuple(Sensor))
    reference = plain(EVERY)
    expected = run(reference, [*device.said, *device.live()])
    rng, tracker = Random(seed), waiting(EVERY)
    run(tracker, device.said)
    packets = [packet for _, packet in storm(device, rng, loss=loss, burst=3, late=5, repeat=0.1)]
    events = heal(tracker, device, packets, rng)
    for name in EVERY:
        assert [s for s in steps_of(events) if s[0] == name] == [s for s in steps_of(expected) if s[0] == name]
    assert fold_state(tracker) == fold_state(reference)
    check_order(events, PRIMARY)


@pytest.mark.parametrize("burst", [1, 3])
@pytest.mark.parametrize("loss", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("name", REAL)
def test_real_walks_through_a_bad_link(recordings, name, loss, burst):
    device = Device.of(recordings / f"{name}.npz")
    reference, tracker, rng = plain(), waiting(), Random(5)
    expected = run(reference, [*device.said, *device.live()])
    run(tracker, device.said)
    packets = [packet for _, packet in storm(device, rng, loss=loss, burst=burst, late=3, repeat=0.05)]
    events = heal(tracker, device, packets, rng)
    assert steps_of(expected)
    assert steps_of(events) == steps_of(expected)
    assert fold_state(tracker) == fold_state(reference)
    check_order(events, PRIMARY)


@pytest.mark.parametrize("names", [[PRIMARY], ["steplink", PRIMARY], EVERY])
def test_ten_minutes_are_counted_again_in_small_slices(names):
    """Half of the slices stay below the 5 ms a session takes at a time, whatever else runs on the machine.

    The low tick wraps nine times meanwhile.
    """
    device = Device(640, sensors=tuple(Sensor), keeps=60_000)
    live, tracker = device.live(), waiting(names)
    run(tracker, [*device.said, *live[:60]])
    for packet in [*live[61:3061], *live[3062:3080]]:
        tracker.apply(packet)
    assert not tracker.has_work
    for packet in device.history(tracker.wanted()):
        tracker.apply(packet)
    slices_s, events = [], []
    while tracker.has_work:
        began_s = time.perf_counter()
        events += tracker.catch_up()
        slices_s.append(time.perf_counter() - began_s)
    assert tracker.cursor[2] == 30_610
    reference = plain(names)
    expected = run(reference, [*device.said, *live[:3061]])
    assert fold_state(tracker) == fold_state(reference)
    for name in names:
        again = [step for step in steps_of(events) if step[0] == name]
        assert again == [step for step in steps_of(expected) if step[0] == name][-len(again) :]
    assert len(slices_s) >= 200
    assert sorted(slices_s)[len(slices_s) // 2] < 0.005


def lived(seed, keeps):
    """Three boots through a bad link: the Tracker, all it told, and snapshots (state, cursor) on the way."""
    rng, tracker, events, saved = Random(seed), waiting(), [], []
    size = rng.choice([2, 10, 28, 84])
    for boot in (1, 2, 3):
        device = Device(30, seed=boot, boot=boot, keeps=keeps)
        events += run(tracker, device.said)
        loss, burst, late = rng.choice([0, 0.05, 0.2]), rng.choice([1, 3]), rng.choice([0, 5])
        start = rng.choice([0, 200]) if boot > 1 else 0
        packets = [p for _, p in storm(device, rng, n=size, loss=loss, burst=burst, late=late, repeat=0.1, start=start)]
        del packets[rng.randrange(len(packets) // 2, len(packets)) :]
        while packets:
            some = packets[: rng.randrange(1, 60)]
            del packets[: len(some)]
            if rng.random() < 0.3:
                events += [event for packet in some for event in tracker.apply(packet)]
            elif rng.random() < 0.6:
                events += heal(tracker, device, some, rng, lose=rng.choice([0, 0.3]))
            else:
                events += run(tracker, some)
            saved.append((json.loads(json.dumps(tracker.snapshot())), tracker.cursor))
    while tracker.has_work:
        events += tracker.catch_up()
    return tracker, events, rng.choice(saved)


@settings(max_examples=60)
@given(seed=SEEDS, keeps=st.sampled_from([0, 30_000]))
def test_whatever_happens_the_accounts_are_right(seed, keeps):
    tracker, events, _ = lived(seed, keeps)
    gaps, tally = only(events, Gap), tracker.tally
    assert (tally.gaps, tally.samples_lost) == (len(gaps), sum(gap.samples for gap in gaps))
    assert tally.samples == sum(len(event.block) for event in only(events, Received))
    assert tally.reboots == len(only(events, Rebooted)) == 2
    assert [event.steps for event in only(events, StepCounted)] == list(range(1, tracker.total + 1))
    awaited = []
    for event in events:
        if isinstance(event, Awaited):
            awaited.append(event.from_s)
        elif isinstance(event, Corrected):
            awaited = [from_s for from_s in awaited if not event.from_s <= from_s < event.to_s]
        elif isinstance(event, Rebooted):
            assert awaited == []
    events += tracker.finish()
    assert check_order(events, PRIMARY) == set()


@settings(max_examples=60)
@given(seed=SEEDS)
def test_a_store_brings_back_any_moment(seed):
    tracker, events, (state, cursor) = lived(seed, 30_000)
    again, told = waiting(), []
    again.restore(state)
    stored = [(event.run, event.block.index, 1, event) for event in only(events, Received)]
    stored += [(event.run, event.index, 0, event) for event in only(events, Heard)]
    for run_, index, _, event in sorted(stored, key=lambda one: one[:3]):
        if isinstance(event, Heard):
            if (run_, index) >= (cursor[0], cursor[2]):
                told += again.replay_heard(event.characteristic, event.data)
        elif (run_, index + len(event.block)) > (cursor[0], cursor[2]):
            told += again.replay_block(run_, event.block, (tracker.cursor[0], tracker.cursor[2]))
    while again.has_work:
        told += again.catch_up()
    assert again.cursor == tracker.cursor
    assert fold_state(again) == fold_state(tracker)
    durable = [key(event) for event in events if isinstance(event, DURABLE)]
    replayed = [key(event) for event in told if isinstance(event, DURABLE)]
    assert replayed == durable[len(durable) - len(replayed) :]
    same = ("samples", "samples_lost", "samples_awaited", "gaps", "reboots")
    assert [getattr(again.tally, name) for name in same] == [getattr(tracker.tally, name) for name in same]


def key(event):
    """What of an event no packet's size may change."""
    return (event.boot, event.steps, event.step) if isinstance(event, StepCounted) else event
