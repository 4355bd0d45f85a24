"""What comes late is counted where it belongs: rows 3 to 6 of what must not break it, for the Tracker that waits."""

import json
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waiting import (
    HISTORY,
    REPLY,
    Device,
    ask,
    check_order,
    fold_state,
    heal,
    heard,
    makers,
    plain,
    run,
    steps_of,
    storm,
    waiting,
)

from service.events import (
    Awaited,
    Corrected,
    Counting,
    Gap,
    Gridded,
    Heard,
    Rebooted,
    Received,
    Segmented,
    Signal,
    StepCounted,
    Tentative,
)
from service.tracking.requests import Missing

SEEDS = st.integers(0, 2**32 - 1)
PRIMARY = "double_threshold"


def only(events, kind):
    return [event for event in events if isinstance(event, kind)]


@pytest.fixture(scope="module")
def device():
    return Device(40)


@pytest.fixture(scope="module")
def forgetful():
    """The same walk from a device that keeps no history."""
    return Device(40, keeps=0)


@pytest.fixture(scope="module")
def whole(device):
    """The run without losses: Tracker and events."""
    tracker = plain()
    return tracker, run(tracker, [*device.said, *device.live()])


def begun(device, **how):
    tracker = waiting(**how)
    run(tracker, device.said)
    return tracker


def check_awaited(events):
    """Each Awaited is over with a Corrected."""
    open_ = []
    for event in events:
        if isinstance(event, Awaited):
            open_.append(event.from_s)
        elif isinstance(event, Corrected):
            open_ = [from_s for from_s in open_ if not event.from_s <= from_s < event.to_s]
    return open_


def test_without_loss_it_tells_what_a_tracker_tells(device, whole):
    tracker, events = waiting(), []
    events = run(tracker, [*device.said, *device.live()])
    assert [event for event in events if not isinstance(event, (Received, Heard))] == whole[1]
    assert fold_state(tracker) == fold_state(whole[0])
    assert sum(len(event.block) for event in only(events, Received)) == device.samples
    assert [event.characteristic for event in only(events, Heard)] == [packet.characteristic for packet in device.said]
    assert not tracker.has_work
    assert (tracker.tally, tracker.cadence_spm, tracker.now_s, tracker.steps_now) == (
        whole[0].tally,
        whole[0].cadence_spm,
        whole[0].now_s,
        whole[0].steps_now,
    )


@settings(max_examples=3)
@given(seed=SEEDS, loss=st.sampled_from([0.01, 0.05, 0.2]), burst=st.sampled_from([1, 3]))
def test_with_history_nothing_is_lost(device, whole, seed, loss, burst):
    rng, tracker = Random(seed), begun(device)
    packets = [packet for _, packet in storm(device, rng, loss=loss, burst=burst, late=5, repeat=0.1)]
    events = heal(tracker, device, packets, rng, lose=0.2, sizes=(3, 10, 28, 84))
    assert not tracker.has_work
    lost = only(events, Gap)
    if not lost:  # three times in vain is lost, and that may happen
        assert fold_state(tracker) == fold_state(whole[0])
        assert steps_of(events) == steps_of(whole[1])
    assert tracker.tally.samples_lost == sum(gap.samples for gap in lost)
    assert tracker.tally.samples + tracker.tally.samples_lost == device.samples
    assert tracker.tally.samples_awaited == 0
    told = check_order(events, PRIMARY)
    assert {at_s for _, _, at_s in told} == set(tracker._committed.tentative.open)
    assert check_awaited(events) == []


@pytest.mark.parametrize(("loss", "burst"), [(0.01, 1), (0.05, 3), (0.2, 1), (0.2, 3)])
def test_row_4_with_history(device, whole, loss, burst):
    rng, tracker = Random(7), begun(device)
    arriving = storm(device, rng, loss=loss, burst=burst)
    assert len(arriving) < len(device.live())
    events = heal(tracker, device, [packet for _, packet in arriving], rng)
    assert only(events, Gap) == []
    assert fold_state(tracker) == fold_state(whole[0])
    assert steps_of(events) == steps_of(whole[1])


@pytest.mark.parametrize(("loss", "burst"), [(0.01, 1), (0.05, 3), (0.2, 1), (0.2, 3)])
def test_row_4_without_history(forgetful, whole, loss, burst):
    """The walk has up to 3 steps a second; each lost second costs at most so many, and two of a hundred beside."""
    tracker = begun(forgetful)
    run(tracker, [packet for _, packet in storm(forgetful, Random(7), loss=loss, burst=burst)])
    lost_s = tracker.tally.samples_lost / 50
    assert lost_s > 0
    assert abs(tracker.total - whole[0].total) <= 3 * lost_s + 0.02 * whole[0].total


@settings(max_examples=3)
@given(seed=SEEDS, loss=st.sampled_from([0.01, 0.05, 0.2]), burst=st.sampled_from([1, 3]))
def test_without_history_gaps_are_exact(forgetful, seed, loss, burst):
    arriving = storm(forgetful, Random(seed), loss=loss, burst=burst)
    tracker = begun(forgetful)
    events = run(tracker, [packet for _, packet in arriving])
    there = {index for index, _ in arriving}
    expected = []
    for index in range(0, forgetful.samples, 10):
        if index in there:
            continue
        if expected and sum(expected[-1]) == index:
            expected[-1] = (expected[-1][0], expected[-1][1] + 10)
        else:
            expected.append((index, 10))
    gaps = [(gap.index, gap.samples) for gap in only(events, Gap)]
    assert gaps == expected
    assert tracker.tally.gaps == len(expected)
    assert tracker.tally.samples_lost == sum(samples for _, samples in expected)
    assert only(events, Awaited) == only(events, Corrected) == []
    check_order(events, PRIMARY)
    same = plain()
    assert steps_of(run(same, [*forgetful.said, *(packet for _, packet in arriving)])) == steps_of(events)


@settings(max_examples=3)
@given(seed=SEEDS, keeps=st.booleans(), n=st.sampled_from([2, 10, 84]))
def test_reordering_and_duplicates_change_nothing(device, forgetful, whole, seed, keeps, n):
    source = device if keeps else forgetful
    arriving = storm(source, Random(seed), n=n, late=5, repeat=0.2)
    tracker = begun(source)
    events = run(tracker, [packet for _, packet in arriving])
    seen, newest, duplicate, reordered = set(), -1, 0, 0
    for index, _ in arriving:
        duplicate += index in seen
        reordered += index not in seen and index < newest
        seen.add(index)
        newest = max(newest, index)
    assert steps_of(events) == steps_of(whole[1])
    assert tracker.tally.packets_duplicate == duplicate
    assert tracker.tally.packets_reordered == reordered
    assert tracker.tally.packets_bad == 0
    assert only(events, Gap) == []
    check_order(events, PRIMARY)


@settings(max_examples=2)
@given(seed=SEEDS, slices=st.sampled_from([1, 50, 10**6]))
def test_the_size_of_a_slice_changes_nothing(device, seed, slices):
    one, other = begun(device), begun(device)
    for tracker, size in ((one, 256), (other, slices)):
        rng = Random(seed)
        packets = [packet for _, packet in storm(device, rng, loss=0.1, burst=3, late=3)]
        tracker.events = heal(tracker, device, packets, rng, lose=0.1, slices=size)
    assert steps_of(one.events) == steps_of(other.events)
    assert only(one.events, Gap) == only(other.events, Gap)
    assert one.snapshot() == other.snapshot()


@settings(max_examples=3)
@given(seed=SEEDS, at=st.floats(0.1, 0.9), saved=st.floats(0.0, 1.0))
def test_what_a_store_gives_back_goes_on_as_if_nothing_had_happened(device, seed, at, saved):
    rng = Random(seed)
    packets = [packet for _, packet in storm(device, rng, loss=0.1, burst=3, late=3)]
    end = max(1, int(at * len(packets)))
    one = begun(device)
    events, state, cursor = [], json.loads(json.dumps(one.snapshot())), one.cursor
    for number, packet in enumerate(packets[:end]):
        events += heal(one, device, [packet], rng) if number % 40 == 39 else run(one, [packet])
        if number == int(saved * end):
            state, cursor = json.loads(json.dumps(one.snapshot())), one.cursor
    other = waiting()
    other.restore(state)
    stored = sorted(only(events, Received), key=lambda event: (event.run, event.block.index))
    until = one.cursor[0], one.cursor[2]
    again = []
    for event in stored:
        if event.block.index + len(event.block) > cursor[2]:
            again += other.replay_block(event.run, event.block, until)
            while other.has_work:
                again += other.catch_up()
    assert other.cursor == one.cursor
    assert fold_state(other) == fold_state(one)
    durable = [e for e in events if isinstance(e, (StepCounted, Gap))]
    replayed = [e for e in again if isinstance(e, (StepCounted, Gap))]
    assert replayed == durable[len(durable) - len(replayed) :]
    for tracker in (one, other):
        tracker.events = heal(tracker, device, packets[end:], Random(1))
    assert fold_state(other) == fold_state(one)
    assert steps_of(one.events) == steps_of(other.events)


def hole(device, *, first=1000, end=1500, until=1700):
    """A tracker with an open hole, and what it told."""
    tracker = begun(device)
    events = run(tracker, device.live()[: first // 10])
    events += run(tracker, device.live()[end // 10 : until // 10])
    return tracker, events


def test_behind_a_hole_all_is_tentative_and_then_confirmed(device, whole):
    tracker, events = hole(device)
    assert [(e.index, e.samples) for e in only(events, Awaited)] == [(1000, 500)]
    assert only(events, Gap) == []
    assert max(e.step.at_s for e in only(events, StepCounted)) < 20
    behind = [e.at_s for e in only(events, Tentative) if e.at_s >= 30]
    assert len(behind) >= 4
    counting = only(events, Counting)[-1]
    assert counting.steps == tracker.total < counting.steps_now
    assert counting.now_s == pytest.approx(1699 / 50)
    assert only(events, Signal)[-1].from_s > 33
    assert tracker.tally.samples_awaited == 500
    assert tracker.cursor == (0, 1, 1000)
    assert tracker.wanted() == Missing(boot=1, first=1000, samples=500)
    events += ask(tracker, device)
    (corrected,) = only(events, Corrected)
    assert corrected.from_s == pytest.approx(999 / 50)
    assert corrected.to_s == pytest.approx(1699 / 50)
    assert corrected.added > 0
    assert tracker.cursor == (0, 1, 1700)
    events += run(tracker, device.live()[170:])
    assert steps_of(events) == steps_of(whole[1])
    check_order(events, PRIMARY)


def test_one_request_at_a_time_and_in_pieces():
    tracker, _ = hole(Device(200), first=1000, end=8000, until=8100)
    first = tracker.wanted()
    assert first == Missing(boot=1, first=1000, samples=3000)
    tracker.ask(first)
    assert (tracker.wanted(), tracker.asked) == (None, first)
    tracker.unanswered()
    assert tracker.wanted() == first


def test_what_the_device_does_not_have_is_lost(device):
    tracker, _ = hole(device)
    tracker.ask(tracker.wanted())
    events = run(tracker, [heard(REPLY, "1 1 1200 300")])
    assert tracker.tally.samples_awaited == 500
    assert tracker.wanted() == Missing(boot=1, first=1200, samples=300)
    events += ask(tracker, device)
    assert [(gap.index, gap.samples) for gap in only(events, Gap)] == [(1000, 200)]
    assert check_awaited(events) == []
    assert tracker.tally.samples_lost == 200


@pytest.mark.parametrize("reply", ["1 1 1000 500", "0 1 0 0"])
def test_what_does_not_come_is_asked_for_three_times(device, reply):
    tracker, _ = hole(device)
    for _ in range(3):
        tracker.ask(tracker.wanted())
        events = run(tracker, [heard(REPLY, reply)])
    assert tracker.wanted() is None
    assert [(gap.index, gap.samples) for gap in only(events, Gap)] == [(1000, 500)]
    assert len(only(events, Corrected)) == 1


def test_nothing_is_asked_of_a_device_that_keeps_nothing(forgetful):
    tracker, events = hole(forgetful)
    assert tracker.wanted() is None
    assert [gap.samples for gap in only(events, Gap)] == [500]


def test_what_is_older_than_the_devices_memory_is_lost():
    device = Device(40, keeps=300)
    tracker, events = hole(device, until=1600)
    assert tracker.wanted() == Missing(boot=1, first=1300, samples=200)
    events += run(tracker, device.live()[160:])
    assert [(gap.index, gap.samples) for gap in only(events, Gap)] == [(1000, 500)]


def test_samples_are_awaited_for_fifteen_minutes_and_memory_is_bounded():
    device = Device(20, keeps=10**6)
    tracker = begun(device)
    run(tracker, device.live()[:10])
    most, gaps = 0, []
    for index in range(1000, 1000 + 50 * 1000, 1000):
        tracker.apply(heard(HISTORY, 10**6))
        for at in range(index, index + 1000, 50):
            packet = device.packet(at % 900, 50, base=at - at % 900)
            gaps += only(run(tracker, [packet]), Gap)
        most = max(most, sum(kept.samples for kept in tracker._behind.kept))
        if gaps:
            break
    assert [(gap.index, gap.samples) for gap in gaps] == [(100, 900)]
    assert most <= 46_000
    assert 45_000 <= index <= 47_000


def test_the_index_wraps_inside_a_hole(device):
    base = 2**32 - 1280
    tracker, reference = begun(device), plain()
    live = device.live(base=base)
    events = run(tracker, [*live[:100], *live[150:160]])
    assert tracker.wanted() == Missing(boot=1, first=(base + 1000) % 2**32, samples=500)
    tracker.ask(tracker.wanted())
    again = [device.packet(i, 20, history=True, base=base) for i in range(1000, 1500, 20)]
    events += run(tracker, [*again, heard(REPLY, f"1 1 {base + 1000} 500"), *live[160:]])
    assert only(events, Gap) == []
    assert steps_of(events) == steps_of(run(reference, [*device.said, *live]))
    assert fold_state(tracker) == fold_state(reference)


@pytest.mark.parametrize("keeps", [0, 30_000])
def test_a_reboot_in_an_open_hole(keeps):
    before, after = Device(40, keeps=keeps), Device(30, keeps=keeps, boot=2, seed=4)
    tracker, reference = begun(before), plain()
    live = [*before.live()[:100], *before.live()[130:133]]
    events = run(tracker, live)
    events += run(tracker, [*after.said, *after.live()])
    expected = run(reference, [*before.said, *live, *after.said, *after.live()])
    assert only(events, Rebooted) == only(expected, Rebooted) == [Rebooted(boot=2, previous=1)]
    assert steps_of(events) == steps_of(expected)
    assert only(events, Gap) == only(expected, Gap)
    assert fold_state(tracker) == fold_state(reference)
    assert tracker.tally.samples_lost == 300
    assert check_awaited(events) == []
    check_order(events, PRIMARY)


def test_what_was_measured_between_a_reboot_and_the_connection_is_asked_for():
    before, after = Device(20), Device(30, boot=2, seed=4)
    tracker, reference = begun(before), plain()
    events = run(tracker, [*before.live()[:50], *after.said, *after.live(start=300)[:20]])
    assert tracker.wanted() == Missing(boot=2, first=0, samples=300)
    events += ask(tracker, after)
    events += run(tracker, after.live(start=500))
    expected = run(reference, [*before.said, *before.live()[:50], *after.said, *after.live()])
    assert steps_of(events) == steps_of(expected)
    assert fold_state(tracker) == fold_state(reference)
    check_order(events, PRIMARY)


def test_other_counters_begin_at_the_hole(device):
    tracker, events = hole(device)
    before = tracker.total
    events += tracker.change_counters(makers(["adaptive_peak"]), primary="adaptive_peak")
    assert only(events, Segmented) == [Segmented(primary="adaptive_peak", steps=tracker.total)]
    assert tracker.total >= before
    events += run(tracker, [])
    events += ask(tracker, device)
    events += run(tracker, device.live()[170:])
    reference = plain()
    expected = run(reference, [*device.said, *device.live()[:100]])
    expected += reference.change_counters(makers(["adaptive_peak"]), primary="adaptive_peak")
    expected += run(reference, device.live()[100:])
    assert steps_of(events) == steps_of(expected)
    assert tracker.total == reference.total
    for primary in ("double_threshold", "adaptive_peak"):
        check_order([e for e in events if getattr(e, "counter", primary) == primary], primary)


def test_finish_counts_what_is_left(device):
    tracker, events = hole(device)
    events += tracker.finish()
    assert [gap.samples for gap in only(events, Gap)] == [500]
    assert len(only(events, StepCounted)) == tracker.total
    assert check_order(events, PRIMARY) == set()


def test_a_live_packet_far_behind_fills_no_hole(device):
    """Only what was asked for comes so late; a broken index may point anywhere."""
    tracker, _ = hole(device, until=2000)
    run(tracker, [device.packet(1200, 10)])
    assert tracker.tally.samples_awaited == 500
    assert tracker.tally.packets_duplicate == 1


def test_grid_samples_come_in_order_and_once(device):
    tracker, events = hole(device)
    events += ask(tracker, device)
    blocks = [event.block for event in only(events, Gridded)]
    for one, next_ in pairwise(blocks):
        assert next_.start == one.start + len(one)
