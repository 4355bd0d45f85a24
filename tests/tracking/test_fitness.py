"""Which counters can count: said before the first sample, again when samples hold something else, never in silence."""

import itertools
import json

import pytest
from fakes import EVERY, MetronomeCounter, data_packet, data_packets, described
from hypothesis import given, settings
from hypothesis import strategies as st

from service.events import StepCounted
from service.samples import Sensor
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

A, G, M = Sensor


def run(tracker, packets):
    return [event for packet in packets for event in tracker.apply(packet)]


def steps(events, counter="metronome"):
    return [event.step.at_s for event in events if isinstance(event, StepCounted) and event.counter == counter]


def ready(**said):
    tracker = Tracker(wire.Bracelet(), {"metronome": MetronomeCounter}, primary="metronome")
    run(tracker, described(**said))
    return tracker


class Turning(MetronomeCounter):
    """A metronome that needs a gyroscope, and keeps what it was given."""

    sensors = (A, G)

    def update(self, block):
        assert block.gyro_rad_s is not None
        assert len(block.gyro_rad_s[0]) == len(block)
        return super().update(block)


class Pointing(Turning):
    """One that needs all three."""

    sensors = (A, G, M)


def undescribed(primary="metronome"):
    """A tracker with counters of every need."""
    counters = {"metronome": MetronomeCounter, "turning": Turning, "pointing": Pointing}
    return Tracker(wire.Bracelet(), counters, primary=primary)


def beside(primary="metronome", **said):
    """The same of a described device."""
    tracker = undescribed(primary)
    run(tracker, described(**said))
    return tracker


@pytest.mark.parametrize(
    ("has", "faults"),
    [
        ((A,), {"turning": "gyroscope", "pointing": "gyroscope, magnetometer"}),
        ((A, G), {"pointing": "magnetometer"}),
        ((A, M), {"turning": "gyroscope", "pointing": "gyroscope"}),
        ((A, G, M), {}),
    ],
)
def test_a_counter_that_the_device_cannot_serve_says_so_before_the_first_sample(has, faults):
    tracker = beside(sensors=has)
    assert tracker.info.sensors == has
    expected = {name: f"{name} needs {missing}; the device has {', '.join(has)}" for name, missing in faults.items()}
    assert tracker.counter_faults == expected
    run(tracker, data_packets([10] * 10, sensors=has))
    assert tracker.counter_faults == expected
    assert tracker.steps == {name: 0 if name in faults else 4 for name in tracker.steps}


def test_a_counter_put_beside_later_says_so_at_once():
    tracker = ready()
    run(tracker, data_packets([10] * 5))
    tracker.change_counters({"metronome": MetronomeCounter, "turning": Turning}, primary="metronome")
    assert tracker.counter_faults == {"turning": "turning needs gyroscope; the device has accelerometer"}
    tracker.change_counters({"metronome": MetronomeCounter}, primary="metronome")
    assert tracker.counter_faults == {}


def test_what_the_device_has_but_does_not_send_is_a_fault_and_the_stream_goes_on():
    tracker = beside(sensors=(A, G, M))
    run(tracker, data_packets([10] * 5, sensors=(A, G)))
    assert list(tracker.counter_faults) == ["pointing"]
    assert "does not send: is the link's MTU too small?" in tracker.counter_faults["pointing"]
    run(tracker, data_packets([10] * 5, start=50))
    assert list(tracker.counter_faults) == ["turning", "pointing"]
    assert tracker.steps == {"metronome": 4, "turning": 2, "pointing": 0}
    assert (tracker.tally.packets_bad, tracker.tally.gaps) == (0, 0)


def test_a_counter_goes_on_as_after_a_gap_when_its_sensor_comes_back():
    tracker = beside("turning", sensors=(A, G))
    made = tracker._committed._counters["turning"]
    run(tracker, data_packets([10] * 4, sensors=(A, G)))
    assert (tracker.total, tracker.steps_now) == (2, 3)
    events = run(tracker, data_packets([10] * 6, start=40))
    assert steps(events, "turning") == []
    assert (tracker.total, tracker.steps_now) == (2, 3)  # what was likely stays so, as behind a gap
    run(tracker, data_packets([10] * 5, start=100, sensors=(A, G)))
    assert "turning" not in tracker.counter_faults
    assert made.seen == [(10 * i, 10) for i in (0, 1, 2, 3, 10, 11, 12, 13, 14)]
    assert tracker.steps == {"metronome": 6, "turning": 4, "pointing": 0}


def test_an_overlap_is_cut_from_every_sensor():
    tracker, plain = (beside(sensors=(A, G, M)) for _ in range(2))
    packets = [data_packet(0, sensors=(A, G, M)), data_packet(5, 20, sensors=(A, G, M)), data_packet(20, 5)]
    run(tracker, packets)
    run(plain, data_packets([10, 15], sensors=(A, G, M)))
    assert tracker.snapshot()["timebase"] == plain.snapshot()["timebase"]
    assert tracker.steps == plain.steps


@settings(max_examples=30)
@given(
    sizes=st.lists(st.tuples(st.integers(1, 28), st.sampled_from([(A,), (A, G), (A, M), (A, G, M)])), max_size=20),
    cut=st.integers(0, 20),
)
def test_packets_of_mixed_content_survive_a_snapshot_anywhere(sizes, cut):
    starts = itertools.accumulate((n for n, _ in sizes), initial=0)
    packets = [data_packet(i, n, sensors=held) for i, (n, held) in zip(starts, sizes, strict=False)]
    whole, first = beside(sensors=(A, G, M)), beside(sensors=(A, G, M))
    expected = run(whole, packets)
    before = run(first, packets[:cut])
    second = undescribed()
    second.restore(json.loads(json.dumps(first.snapshot())))
    assert second.info == first.info
    after = run(second, packets[cut:])
    for counter in whole.steps:
        assert steps(before + after, counter) == steps(expected, counter)
    assert json.dumps(second.snapshot()) == json.dumps(whole.snapshot())
    assert whole.steps["metronome"] == sum(1 for k in range(sum(n for n, _ in sizes)) if k % EVERY == 0)


def test_a_held_packet_keeps_its_sensors():
    tracker = beside(sensors=(A, G, M))
    run(tracker, data_packets([10] * 5, sensors=(A, G, M)))
    run(tracker, [data_packet(1000, sensors=(A, G, M))])
    resumed = beside(sensors=(A, G, M))
    resumed.restore(json.loads(json.dumps(tracker.snapshot())))
    for one in (tracker, resumed):
        run(one, data_packets([10] * 5, start=1010, sensors=(A, G, M)))
        assert one.tally.samples == 110
    assert resumed.steps == tracker.steps == dict.fromkeys(tracker.steps, 2 + 3)


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 9.8])
def test_under_ten_samples_a_second_nothing_is_counted_and_the_device_says_why(rate_hz):
    tracker = ready(rate_hz=rate_hz)
    why = f"metronome needs 10 samples a second or more; the device takes {rate_hz:g}"
    assert tracker.counter_faults == {"metronome": why}
    events = run(tracker, data_packets([10] * 10, rate_hz=rate_hz))
    assert steps(events) == []
    assert (tracker.total, tracker.steps_now, tracker.tally.samples) == (0, 0, 100)


@pytest.mark.parametrize("rate_hz", [9.95, 10.0, 12.5])
def test_ten_samples_a_second_are_enough(rate_hz):
    tracker = ready(rate_hz=rate_hz)
    run(tracker, data_packets([10] * 10, rate_hz=rate_hz))
    assert tracker.counter_faults == {}
    assert tracker.total > 10


def test_a_device_that_is_slower_than_it_says_is_found_by_its_clock():
    tracker = ready(rate_hz=12.0)
    run(tracker, data_packets([10] * 100, rate_hz=6.0))
    assert "the device takes 6" in tracker.counter_faults["metronome"]
