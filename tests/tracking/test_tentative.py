"""Tentative steps: told before they are confirmed, taken back if they are not, and the same whatever the packets."""

import json

import numpy as np
import pytest
from fakes import described
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters.registry import BESIDE, DEFAULT, make
from service.events import StepCounted, Tentative
from service.samples import DeviceInfo, Packet, RawBlock, Step
from service.tracking.tentative import TentativeSteps
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

MTU = 517


def step(at_s):
    return Step(at_s=at_s, strength=0.4)


def told(events):
    return [(event.at_s, event.retracted) for event in events]


def test_told_once_then_confirmed():
    steps = TentativeSteps()
    assert told(steps.follow("counter", 1, [(0.5, 0.3, True)], [])) == [(0.5, False)]
    assert steps.follow("counter", 1, [(0.5, 0.3, True)], []) == []
    assert steps.follow("counter", 1, [], [step(0.5)]) == []


def test_what_is_named_no_more_is_taken_back():
    steps = TentativeSteps()
    steps.follow("counter", 1, [(0.5, 0.3, True), (0.9, 0.2, False)], [])
    (back,) = steps.follow("counter", 1, [(0.9, 0.2, False)], [])
    assert (back.at_s, back.strength, back.passes, back.retracted) == (0.5, 0.3, True, True)
    assert steps.follow("counter", 1, [(0.9, 0.2, False)], []) == []


def test_a_step_confirmed_at_first_sight_is_told_just_before():
    (event,) = TentativeSteps().follow("counter", 1, [], [step(0.5)])
    assert (event.at_s, event.passes, event.retracted) == (0.5, True, False)


def test_the_interval_is_from_the_last_sure_step():
    steps = TentativeSteps()
    steps.follow("counter", 1, [], [step(0.5)])
    events = steps.follow("counter", 1, [(0.8, 0.1, False), (1.0, 0.3, True), (1.2, 0.1, False), (1.6, 0.3, True)], [])
    assert [event.interval_s for event in events] == pytest.approx([0.3, 0.5, 0.2, 0.6])
    (late,) = steps.follow(
        "counter", 1, [(0.8, 0.1, False), (1.0, 0.3, True), (1.2, 0.1, False), (1.6, 0.3, True), (3.7, 1, True)], []
    )
    assert late.interval_s is None


@given(cut=st.integers(0, 3))
def test_resumes_from_a_snapshot(cut):
    turns = [([(0.5, 0.3, True)], []), ([(0.5, 0.3, True), (1.0, 0.2, False)], []), ([], [step(0.5)])]
    whole, first, second = TentativeSteps(), TentativeSteps(), TentativeSteps()
    expected = [whole.follow("counter", 1, *turn) for turn in turns]
    before = [first.follow("counter", 1, *turn) for turn in turns[:cut]]
    second.restore(json.loads(json.dumps(first.snapshot())))
    assert before + [second.follow("counter", 1, *turn) for turn in turns[cut:]] == expected


def walked(samples_a_packet, counter="double_threshold", *, seconds=20):
    """Events of a bracelet's walk, and the device time of the newest sample when each was told."""
    bracelet = Bracelet(Walker(f"rest:2,normal:{seconds}", seed=4), packet_samples=samples_a_packet)
    tracker = Tracker(wire.Bracelet(), {counter: lambda: make(counter)}, primary=counter)
    for packet in described():
        tracker.apply(packet)
    heard = []
    while not bracelet.ended:
        bracelet.measure(10)
        while (data := bracelet.next_packet(MTU)) is not None:
            events = tracker.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
            heard += [(event, tracker.now_s) for event in events]
    return heard + [(event, tracker.now_s) for event in tracker.finish()]


@pytest.mark.parametrize("counter", [DEFAULT, BESIDE])
@settings(max_examples=4, deadline=None)
@given(size=st.integers(1, 84))
def test_each_step_is_told_before_it_is_confirmed_and_each_likely_one_decided(size, counter):
    open_s, confirmed = set(), []
    for event, _ in walked(size, counter):
        if isinstance(event, Tentative):
            assert event.retracted == (event.at_s in open_s)
            (open_s.discard if event.retracted else open_s.add)(event.at_s)
        if isinstance(event, StepCounted):
            open_s.remove(event.step.at_s)
            confirmed.append(event.step.at_s)
    assert open_s == set()
    assert len(confirmed) > 25


@pytest.mark.parametrize(("size", "most_s"), [(8, 0.2), (10, 0.24)])
def test_each_step_is_told_within_a_quarter_of_a_second(size, most_s):
    heard = walked(size)
    first = {}
    for event, now_s in heard:
        if isinstance(event, Tentative) and not event.retracted:
            first.setdefault(event.at_s, (now_s, event.passes))
    steps = [event.step.at_s for event, _ in heard if isinstance(event, StepCounted)]
    assert max(first[at_s][0] - at_s for at_s in steps) <= most_s + 1e-9
    assert np.mean([first[at_s][1] for at_s in steps]) > 0.8
    sure = {at_s for at_s, (_, passes) in first.items() if passes}
    assert len(sure - set(steps)) <= 0.1 * len(steps)


@pytest.mark.parametrize("size", [8, 10])
def test_steplink_tells_a_walk_s_steps_within_half_a_second_once_it_is_certain(size):
    first, certain_s, late_s = {}, None, []
    for event, now_s in walked(size, "steplink"):
        if isinstance(event, Tentative) and not event.retracted:
            first.setdefault(event.at_s, now_s)
        if isinstance(event, StepCounted):
            certain_s = certain_s or now_s
            if event.step.at_s > certain_s:
                late_s.append(first[event.step.at_s] - event.step.at_s)
    assert len(late_s) >= 20
    assert np.quantile(late_s, 0.9) <= 0.5


def test_times_say_how_well_they_are_known():
    heard = walked(8)
    known = [event.uncertainty_s for event, _ in heard if isinstance(event, Tentative | StepCounted)]
    assert min(known) >= 0.01
    assert max(known) < 0.013  # half a sample, half a tick, and at most one that the grid has not followed yet


class NineAxes:
    """A device that says its rate, then sends blocks of a walk with angular rate and field; the bytes are the index."""

    def __init__(self, sensed):
        self.sensed = sensed

    def handshake(self):
        return ()

    def history(self, _):
        return ()

    def feed(self, characteristic, data):
        if characteristic == "rate":
            return DeviceInfo(rate_hz=50.0)
        first = int(data)
        cut = [tuple(c.tolist() for c in part[first : first + 10].T) for part in self.sensed]
        return RawBlock(boot=1, index=first, tick=None, acc_g=cut[0], gyro_rad_s=cut[1], mag_ut=cut[2])


def nine_axes(seconds=20, seed=2):
    sensed = Walker(f"normal:{seconds}", seed=seed).sensed()
    parts = (sensed.acc_g, sensed.gyro_rad_s, sensed.mag_ut)
    packets = [Packet(characteristic="data", data=str(k).encode(), at_ns=0) for k in range(0, len(parts[0]), 10)]

    def fresh():
        return Tracker(NineAxes(parts), {DEFAULT: lambda: make(DEFAULT)}, primary=DEFAULT)

    return fresh, [Packet(characteristic="rate", data=b"", at_ns=0), *packets]


def test_steps_of_any_counter_have_a_heading_where_the_sensors_give_one():
    """The synthetic arm swings along the walker's way, to magnetic north: a line at 0°."""
    fresh, packets = nine_axes()
    tracker = fresh()
    events = [event for packet in packets for event in tracker.apply(packet)]
    found = {event.step.at_s: event.heading for event in events if isinstance(event, StepCounted)}
    told = {event.at_s: event.heading for event in events if isinstance(event, Tentative)}
    late = {at_s: heading for at_s, heading in found.items() if at_s > 3}
    assert len(late) > 20
    for heading in late.values():
        assert heading.is_line
        assert abs((heading.deg + 90) % 180 - 90) < 8
        assert 20 < heading.uncertainty_deg < 40
    assert found.items() <= told.items()


def test_the_heading_goes_on_from_a_snapshot():
    fresh, packets = nine_axes(8)
    whole, first, second = fresh(), fresh(), fresh()
    expected = [event for packet in packets for event in whole.apply(packet)]
    before = [event for packet in packets[:25] for event in first.apply(packet)]
    second.restore(json.loads(json.dumps(first.snapshot())))
    after = [event for packet in packets[25:] for event in second.apply(packet)]
    assert before + after == expected
    assert any(event.heading for event in after if isinstance(event, Tentative))
