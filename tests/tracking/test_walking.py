"""Whether somebody walks, through the fold: the newest verdict, walks in the log, and what was refused and why."""

import json
from itertools import cycle
from random import Random

import pytest
from fakes import GateCounter, MetronomeCounter, data_packets, described
from hypothesis import example, given, settings
from hypothesis import strategies as st
from waiting import HISTORY, Device, Keeping, fold_state, heal, heard, makers, plain, run, storm, waiting

from service.errors import CounterError
from service.events import Counting, Rebooted, Segmented, StepCounted, Walked
from service.samples import Gait, Verdict
from service.tracking.backfill import BackfillTracker
from service.tracking.tracker import Tracker
from service.tracking.walking import Walking
from service.wearables import bracelet as wire

COUNTERS = {"gate": GateCounter, "metronome": MetronomeCounter}
REST, OTHER, PERHAPS, WALKING = Verdict
REFUSED = {REST: 4, OTHER: 8, PERHAPS: 2}
"""Of the metronome's steps in the first turn of the ramp."""


def ready(counters=COUNTERS, *, primary="gate"):
    tracker = Tracker(wire.Bracelet(), counters, primary=primary)
    for packet in described():
        tracker.apply(packet)
    return tracker


def walks(events):
    return [(event.boot, event.at_s, event.begins) for event in events if isinstance(event, Walked)]


def own(events):
    return [event.step.at_s for event in events if isinstance(event, StepCounted) and event.counter == "gate"]


def only(events, kind):
    return [event for event in events if isinstance(event, kind)]


def test_the_newest_verdict_and_its_cadence_come_with_every_packet():
    tracker = ready()
    events = run(tracker, data_packets([8] * 125))
    said = {counting.gait.verdict: counting for counting in only(events, Counting)}
    assert set(said) == set(Verdict)
    assert [said[verdict].cadence_spm for verdict in Verdict] == [None, None, None, 120.0]
    assert said[WALKING].gait == tracker.gait == Gait(983 / 50, WALKING, 0.95, 2.0)
    assert tracker.cadence_spm == 120.0


def test_a_counter_without_a_verdict_tells_none_and_no_walk():
    tracker = ready({"metronome": MetronomeCounter, "gate": GateCounter}, primary="metronome")
    events = run(tracker, data_packets([8] * 200))
    assert {counting.gait for counting in only(events, Counting)} == {None}
    assert tracker.cadence_spm == pytest.approx(120.0)
    assert walks(events) == []
    assert tracker.refused == {}
    state = tracker.snapshot()["refused"]
    assert not any(state.values())  # nothing is kept that nobody will ask for


def test_a_walk_begins_where_it_was_first_possible_and_ends_where_it_was_last_one():
    events = run(ready(), data_packets([10] * 150))
    began, ended = walks(events)
    assert began == (1, 383 / 50, True)  # the end of the last frame before those called perhaps; certain at 503 / 50
    assert ended == (1, 983 / 50, False)
    assert (own(events)[0], own(events)[-1]) == (400 / 50, 975 / 50)


@pytest.mark.parametrize(("latency_s", "from_s"), [(30.0, 1.0), (4.0, 7.0)])
def test_a_walk_begins_no_earlier_than_its_steps_are_credited(latency_s, from_s):
    walking = Walking("gate", latency_s)
    for at_s in range(1, 11):
        assert walking.follow(Gait(float(at_s), PERHAPS, 0.6, None), 1) == []
    begun = walking.follow(Gait(11.0, WALKING, 0.95, 1.8), 1)
    assert begun == [Walked(counter="gate", boot=1, at_s=from_s, begins=True)]
    (ended,) = walking.follow(Gait(12.0, PERHAPS, 0.6, None), 1)
    (again,) = walking.follow(Gait(13.0, WALKING, 0.95, 1.8), 1)
    assert (ended.at_s, ended.begins, again.at_s, again.begins) == (11.0, False, 11.0, True)


def test_a_gap_parts_what_may_be_walking_and_ends_a_walk_before_it():
    walking = Walking("gate", latency_s=30.0)
    walking.follow(Gait(1.0, PERHAPS, 0.6, None), 1)
    (begun,) = walking.follow(Gait(9.0, WALKING, 0.95, 1.8), 1)
    (ended,) = walking.follow(Gait(20.0, REST, 0.0, None), 1)
    assert (begun.at_s, ended.at_s) == (9.0, 9.0)


def test_each_verdict_refuses_its_own():
    """The metronome counts each 25th sample of the ramp, the gate those of the frames that it calls walking."""
    tracker = ready()
    run(tracker, data_packets([10] * 110))
    assert tracker.steps["gate"] == len(range(400, 1000, 25))
    # 0 to 75 lie in frames at rest, 100 and 125 in such that may be walking, 150 to 325 in other motion; 350 and 375
    # are within a second of the gate's first step.
    assert tracker.refused == {"metronome": REFUSED}


@settings(max_examples=12, deadline=None)
@given(sizes=st.lists(st.integers(1, 84), min_size=30, max_size=60), at=st.integers(0, 60))
@example(sizes=[24] * 30, at=0)
def test_neither_packet_sizes_nor_a_restart_change_walks_or_what_was_refused(sizes, at):
    whole, cut = ready(), ready()
    expected = run(whole, data_packets([8] * (sum(sizes) // 8) + [sum(sizes) % 8] * (sum(sizes) % 8 > 0)))
    events, sent = [], list(data_packets(sizes))
    events += run(cut, sent[:at])
    state = json.loads(json.dumps(cut.snapshot()))
    cut = Tracker(wire.Bracelet(), COUNTERS, primary="gate")
    cut.restore(state)
    events += run(cut, sent[at:])
    assert (walks(events), own(events)) == (walks(expected), own(expected))
    ours, theirs = (json.loads(json.dumps(tracker.snapshot())) for tracker in (cut, whole))
    for key in ("walking", "refused", "counters", "steps"):
        assert ours[key] == theirs[key]
    assert (cut.gait, cut.refused, cut.cadence_spm) == (whole.gait, whole.refused, whole.cadence_spm)


@pytest.mark.full
@settings(max_examples=8, deadline=None)
@given(sizes=st.lists(st.integers(1, 84), min_size=1, max_size=8), at=st.integers(0, 60))
def test_so_it_is_with_our_own_counter(sizes, at):
    device, counters = Device(60, script="rest:4,normal:25,rest:6"), makers(("steplink", "double_threshold"))

    def begun(state=None):
        tracker = Tracker(Keeping(), counters, primary="steplink")
        if state is None:
            run(tracker, device.said)
        else:
            tracker.restore(state)
        return tracker

    whole, cut, place, sent = begun(), begun(), 0, []
    expected = run(whole, device.live(8))
    for size in cycle(sizes):
        sent.append(device.packet(place, size))
        place += size
        if place >= device.samples:
            break
    events = run(cut, sent[:at])
    cut = begun(json.loads(json.dumps(cut.snapshot())))
    events += run(cut, sent[at:])
    assert walks(events) == walks(expected) != []
    ours, theirs = (json.loads(json.dumps(tracker.snapshot())) for tracker in (cut, whole))
    assert [ours[key] for key in ("walking", "refused", "steps")] == [
        theirs[key] for key in ("walking", "refused", "steps")
    ]


@pytest.mark.full
@pytest.mark.parametrize(("loss", "burst"), [(0.05, 3), (0.2, 1)])
def test_what_comes_late_leaves_no_trace_in_walks_or_refusals(loss, burst):
    """Row 4, with history, for our own counter."""
    names = ("steplink", "double_threshold")
    device, rng = Device(60, script="rest:3,normal:12,rest:5"), Random(5)
    whole, tracker = plain(names), waiting(names)
    expected = run(whole, [*device.said, *device.live()])
    run(tracker, device.said)
    arriving = [packet for _, packet in storm(device, rng, loss=loss, burst=burst)]
    assert len(arriving) < len(device.live())
    events = heal(tracker, device, arriving, rng)
    assert walks(events) == walks(expected)
    assert len(walks(events)) >= 6
    assert fold_state(tracker) == fold_state(whole)
    assert (tracker.gait, tracker.refused) == (whole.gait, whole.refused)


def test_a_device_that_starts_again_ends_the_walk_and_settles_what_was_refused():
    tracker = ready()
    before = run(tracker, data_packets([10] * 95))
    settled = dict(tracker.refused["metronome"])
    events = run(tracker, data_packets([10] * 20, boot=2))
    place = events.index(only(events, Rebooted)[0])
    assert walks(before) == [(1, 383 / 50, True)]
    assert walks(events) == [(1, 935 / 50, False)]
    assert events.index(only(events, Walked)[0]) < place
    assert tracker.refused["metronome"] == settled  # all of boot 1 was walking at its end; boot 2's wait
    assert (tracker.gait.verdict, tracker.gait.at_s) == (OTHER, 191 / 50)
    assert tracker.finish()[-1].gait is None
    assert sum(tracker.refused["metronome"].values()) == sum(settled.values()) + 8


def test_another_primary_begins_anew():
    tracker = ready()
    run(tracker, data_packets([10] * 95))
    events = tracker.change_counters(COUNTERS, primary="metronome")
    walked, segmented = only(events, Walked) + only(events, Segmented)
    assert (walked.begins, segmented.primary) == (False, "metronome")
    assert events.index(walked) < events.index(segmented)
    assert (tracker.gait, tracker.refused) == (None, {})
    run(tracker, data_packets([10] * 5, start=950))
    assert tracker.cadence_spm is not None
    tracker.change_counters(COUNTERS, primary="gate")
    events = run(tracker, data_packets([10] * 5, start=1000))
    assert tracker.gait.verdict is REST


def test_a_counter_that_leaves_takes_what_it_was_refused_with_it():
    tracker = ready()
    run(tracker, data_packets([10] * 95))
    assert tracker.refused
    tracker.change_counters({"gate": GateCounter}, primary="gate")
    assert tracker.refused == {}
    tracker.change_counters(COUNTERS, primary="gate")
    run(tracker, data_packets([10] * 5, start=950))
    assert tracker.refused == {}


class Failing(GateCounter):
    """A gate that cannot count from some place on."""

    def update(self, block):
        if block.start >= 700:
            raise CounterError("gate needs a gyroscope")
        return super().update(block)


def test_a_primary_that_cannot_count_any_more_says_nothing_of_walking():
    tracker = ready({"gate": Failing, "metronome": MetronomeCounter})
    events = run(tracker, data_packets([10] * 200))
    assert [begins for _, _, begins in walks(events)] == [True, False]
    assert tracker.gait is None
    assert only(events, Counting)[-1].gait is None
    assert tracker.refused["metronome"] == REFUSED
    assert not tracker.snapshot()["refused"]["waiting"]


def test_behind_a_hole_the_front_says_what_is_live_and_the_log_waits():
    tracker = BackfillTracker(Keeping(), COUNTERS, primary="gate")
    run(tracker, [*described(), heard(HISTORY, 30_000)])
    packets = list(data_packets([10] * 75))
    events = run(tracker, packets[:30] + packets[31:])
    assert only(events, Counting)[-1].gait == tracker.gait
    assert tracker.gait.verdict is WALKING
    assert walks(events) == []
    assert tracker.refused == {"metronome": {REST: 2, OTHER: 0, PERHAPS: 0}}  # what is certain before the hole
    healed = tracker.apply(packets[30])
    while tracker.has_work:
        healed += tracker.catch_up()
    assert walks(healed) == [(1, 383 / 50, True)]
    assert tracker.refused["metronome"] == REFUSED
