"""A calibration over the packets of a live device: what is learnt, how it ends, and what makes it fail."""

from __future__ import annotations

from dataclasses import replace

import pytest
from counters.test_learning import SLOW_THIGH, pieces
from hypothesis import given, settings
from hypothesis import strategies as st
from pipeline.stand import Stand

from service.counters import gyro_zero_crossing
from service.counters.double_threshold import TUNED, middle_window, sampled_window
from service.errors import CounterError, NotNowError, ParameterError, UnknownNumberError
from service.events import Gap, Gridded, Rebooted, Segmented
from service.pipeline import calibrations
from service.pipeline.calibration import LONGEST_S, Calibration, Plan, State
from service.pipeline.lifecycle import State as LinkState
from service.pipeline.lineup import CounterChoice, lineup
from service.pipeline.notices import Notice, StateChanged
from service.samples import Packet, SampleBlock, Sensor
from service.wearables import bracelet as wire

DOUBLE = CounterChoice(name="double_threshold")
STEPS_20 = Plan(choice=DOUBLE, method="walk", steps=20)
SECONDS_15 = Plan(choice=DOUBLE, method="walk", seconds=15)


class Tape:
    """What a session tells its observers of the grid, joined to one block."""

    def __init__(self, session):
        self.blocks = []
        session.observers.append(lambda notice: self.blocks.append(notice.event))

    def joined(self, samples=None):
        """The first `samples` of them, or all."""
        blocks = [event.block for event in self.blocks if isinstance(event, Gridded)]
        axes = tuple([value for block in blocks for value in block.acc_g[axis]][:samples] for axis in range(3))
        return SampleBlock(start=blocks[0].start, acc_g=axes)


def record(stand, plan):
    """Begin, walk to the end of it; return the calibration and its samples."""
    begun, tape = stand.device.calibrate(plan), Tape(stand.device.session)
    stand.until(lambda: begun.state is not State.RECORDING)
    return begun, tape.joined()


def test_a_walk_of_steps_ends_by_itself_and_teaches_what_its_samples_do():
    stand = Stand("rest:4,normal:60")
    stand.walk(3)
    done, samples = record(stand, STEPS_20)
    assert done.state is State.DONE
    assert done.steps >= 20
    assert stand.true_steps == pytest.approx(done.steps, abs=6)  # the last are still being confirmed
    assert done.lesson.params == {"window_mode": "fixed", "first_window": sampled_window(samples, TUNED)}
    assert done.seconds == len(samples) / 50
    assert done.ended_ns == pytest.approx(stand.now_ns, abs=1e9)


@pytest.mark.parametrize(("method", "offline"), [("walk", sampled_window), ("middle", middle_window)])
def test_a_timed_one_ends_by_device_time(method, offline):
    stand = Stand("normal:60")
    done, samples = record(stand, Plan(choice=DOUBLE, method=method, seconds=15))
    assert done.state is State.DONE
    assert 15 <= done.seconds <= 15.2
    assert done.lesson.params["first_window"] == offline(samples, TUNED)


def test_the_slowest_walk_teaches_both_thresholds(monkeypatch):
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)  # compiling takes seconds
    choice = CounterChoice(name="gyro_zero_crossing", preset="paper", overrides={"margin": 0.6})
    begun = Calibration(Plan(choice=choice, method="slowest_walk", steps=12), number=1, began_ns=0)
    taken = []
    for block in pieces(SLOW_THIGH, [10]):
        if begun.state is State.RECORDING:
            begun.take(told(Gridded(block=block)))
            taken.append(len(block))
    assert begun.state is State.DONE
    assert begun.steps >= 12
    assert sum(taken) < len(SLOW_THIGH)
    walked = next(pieces(SLOW_THIGH, [sum(taken)]))
    offline = gyro_zero_crossing.calibrated(walked, replace(gyro_zero_crossing.PAPER, margin=0.6))
    assert begun.lesson.params == {"peak_rad_s": offline.peak_rad_s, "valley_rad_s": offline.valley_rad_s}


def test_progress_is_visible_and_it_can_be_ended_early():
    stand = Stand("normal:60")
    begun = stand.device.calibrate(Plan(choice=DOUBLE, method="walk", steps=500))
    seen = []
    for _ in range(10):
        stand.walk(1)
        seen.append((begun.steps, begun.seconds))
    assert seen == sorted(seen)
    assert seen[-1][0] > 10
    assert seen[-1][1] == pytest.approx(10, abs=0.2)
    assert stand.device.calibrations.finish(begun.number).state is State.DONE
    assert begun.lesson.params["first_window"] == pytest.approx(27, abs=3)
    with pytest.raises(NotNowError, match="is done"):
        stand.device.calibrations.finish(begun.number)


def test_ending_it_before_anybody_walked_fails_with_a_sentence():
    stand = Stand("rest:60")
    begun = stand.device.calibrate(STEPS_20)
    stand.walk(2)
    assert stand.device.calibrations.finish(begun.number).state is State.FAILED
    assert "walk evenly" in begun.reason
    assert begun.lesson is None


@pytest.mark.parametrize(
    ("hurt", "said"),
    [
        (lambda stand: stand.walk(1, heard=False), "samples are missing"),
        (lambda stand: stand.bracelet.reset(), "started again"),
        (lambda stand: stand.lose("out of range"), "out of range"),
        (lambda stand: stand.device.unwant(), "disconnected"),
    ],
)
def test_what_breaks_a_recording_fails_it_and_says_what_to_do(hurt, said):
    stand = Stand("normal:60")
    begun = stand.device.calibrate(STEPS_20)
    stand.walk(4)
    hurt(stand)
    stand.walk(2)  # what this bracelet does not keep is missing once some packets have come on
    assert begun.state is State.FAILED
    assert said in begun.reason
    assert "repeat" in begun.reason
    assert stand.device.session.observers == []


def test_a_short_gap_is_bridged_and_fails_nothing():
    stand = Stand("normal:60")
    begun = stand.device.calibrate(SECONDS_15)
    stand.walk(4)
    stand.walk(0.4, heard=False)
    stand.until(lambda: begun.state is not State.RECORDING)
    assert begun.state is State.DONE


def test_a_gap_before_its_first_sample_is_none_of_it():
    stand = Stand("normal:60")
    stand.walk(2)
    begun = stand.device.calibrate(SECONDS_15)
    stand.walk(2, heard=False)
    stand.until(lambda: begun.state is not State.RECORDING)
    assert begun.state is State.DONE


def grid(n, start=0):
    return Gridded(block=SampleBlock(start=start, acc_g=([0.0] * n, [0.0] * n, [1.0] * n)))


def told(event, at_ns=0):
    return Notice(device="a", at_ns=at_ns, uncertainty_s=0.0, ordinal=None, event=event)


def test_a_walk_of_steps_that_never_come_is_given_up():
    begun = Calibration(STEPS_20, number=1, began_ns=0)
    for start in range(0, int(LONGEST_S) * 50, 500):
        begun.take(told(grid(500, start)))
    assert begun.state is State.FAILED
    assert "only 0 of 20 steps" in begun.reason


@settings(max_examples=50)
@given(
    st.lists(
        st.sampled_from(
            [
                grid(0),
                grid(60),
                Gap(from_s=0, to_s=1, index=0, samples=50, filled=True),
                Gap(from_s=0, to_s=1, index=0, samples=50, filled=False),
                Rebooted(boot=2, previous=1),
                *(StateChanged(state=state, reason=None) for state in LinkState),
            ]
        ),
        max_size=30,
    )
)
def test_whatever_comes_it_ends_once_and_says_why(events):
    begun, ends, start = Calibration(SECONDS_15, number=1, began_ns=0), set(), 0
    for number, event in enumerate(events):
        at_grid = isinstance(event, Gridded)
        begun.take(told(grid(len(event.block), start) if at_grid else event, at_ns=number))
        start += len(event.block) if at_grid else 0
        if begun.state is not State.RECORDING:
            ends.add((begun.state, begun.ended_ns, begun.reason, begun.samples))
    assert len(ends) <= 1
    assert all(state is State.FAILED and reason for state, _, reason, _ in ends)  # nobody walked
    assert (begun.ended_ns is None) == (begun.state is State.RECORDING)


def test_one_records_at_a_time_and_a_cancelled_one_makes_room():
    stand = Stand("normal:60")
    first = stand.device.calibrate(STEPS_20)
    with pytest.raises(NotNowError, match="calibration 1"):
        stand.device.calibrate(STEPS_20)
    stand.device.calibrations.forget(first.number)
    assert stand.device.session.observers == []
    second = stand.device.calibrate(STEPS_20)
    assert second.number == 2
    assert [kept.number for kept in stand.device.calibrations.items] == [2]
    with pytest.raises(UnknownNumberError):
        stand.device.calibrations.get(1)


def test_a_device_that_does_not_stream_cannot_be_calibrated():
    stand = Stand("normal:60")
    stand.lose()
    with pytest.raises(NotNowError, match="lost"):
        stand.device.calibrate(STEPS_20)


SLOWEST_20 = Plan(choice=CounterChoice(name="gyro_zero_crossing"), method="slowest_walk", steps=20)


def test_a_missing_sensor_is_refused_at_once():
    with pytest.raises(CounterError, match="needs gyroscope; the device has accelerometer"):
        Stand("slow:60").device.calibrate(SLOWEST_20)


def test_a_sensor_that_is_not_sent_fails_with_the_first_samples_and_is_refused_from_then_on():
    stand = Stand("slow:60")
    sensors = wire.encode_sensors(tuple(Sensor), lsb_per_rad_s=900, lsb_per_100_ut=6400)
    stand.device.session.apply(Packet(characteristic=wire.SENSORS, data=sensors, at_ns=0))
    begun = stand.device.calibrate(SLOWEST_20)
    stand.walk(1)
    assert begun.state is State.FAILED
    assert "gyroscope" in begun.reason
    with pytest.raises(CounterError, match="does not send"):
        stand.device.calibrate(SLOWEST_20)


def test_the_slowest_walk_is_learnt_on_a_device_with_a_gyroscope(monkeypatch):
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)  # compiling takes seconds
    stand = Stand("slow:60", sensors=tuple(Sensor))
    begun = stand.device.calibrate(SLOWEST_20)
    stand.until(lambda: begun.state is not State.RECORDING)
    assert begun.state is State.DONE
    assert begun.steps >= 20


def test_a_device_too_slow_to_count_on_cannot_be_calibrated():
    stand = Stand("normal:60")
    stand.device.session.apply(Packet(characteristic=wire.RATE, data=wire.encode_rate(5.0), at_ns=0))
    with pytest.raises(CounterError, match="10 samples a second or more; the device takes 5"):
        stand.device.calibrate(STEPS_20)


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({}, "exactly one"),
        ({"steps": 20, "seconds": 10}, "exactly one"),
        ({"steps": 9}, "from 10 to 1000"),
        ({"steps": 1001}, "from 10 to 1000"),
        ({"seconds": 4.9}, "from 5 to 600"),
        ({"seconds": 601}, "from 5 to 600"),
        ({"method": "middle", "steps": 20}, "takes seconds"),
        ({"method": "middle", "seconds": 9}, "from 10 to 600"),
    ],
)
def test_a_wrong_plan_is_refused(wanted, said):
    with pytest.raises(ParameterError, match=said):
        Plan(**{"choice": DOUBLE, "method": "walk", **wanted})


def test_a_method_of_another_counter_is_refused_by_name():
    with pytest.raises(CounterError, match="walk, middle"):
        Plan(choice=DOUBLE, method="slowest_walk", steps=20)
    with pytest.raises(CounterError, match="none"):
        Plan(choice=CounterChoice(name="plus_minus"), method="walk", steps=20)


def test_applied_paces_are_pooled_and_a_segment_begins():
    stand = Stand("slow:20,fast:40")
    slow, _ = record(stand, SECONDS_15)
    stand.walk(6)
    fast, _ = record(stand, SECONDS_15)
    device, before = stand.device, stand.device.session.tracker.total
    taught = device.calibrations.taught(device.lineup, [slow.number, fast.number])
    pooled = [*slow.evidence, *fast.evidence]
    (choice,) = taught.choices
    assert choice.overrides == {"window_mode": "fixed", "first_window": int(sum(pooled) / len(pooled) + 0.5)}
    windows = [one.lesson.params["first_window"] for one in (fast, slow)]
    assert windows == sorted(windows)
    device.count_with(taught)
    stand.walk(10)
    assert device.session.tracker.total > before
    segments = [notice.event for notice in stand.told if isinstance(notice.event, Segmented)]
    assert [segment.primary for segment in segments] == ["double_threshold"]
    assert not [notice for notice in stand.told if isinstance(notice.event, Gridded)]


def test_what_was_learnt_keeps_other_overrides_and_runs_beside_where_the_counter_did_not_run():
    alone = lineup("autocorrelation", preset="paper")
    beside = alone.taught("double_threshold", {"first_window": 27})
    assert [(c.name, c.preset, c.overrides) for c in beside.choices] == [
        ("autocorrelation", "paper", {}),
        ("double_threshold", "paper", {"first_window": 27}),
    ]
    again = lineup("double_threshold", params=["double_threshold.bout=3"]).taught("double_threshold", {"valleys": 1})
    assert again.choices[0].overrides == {"bout": 3, "valleys": 1}


def test_only_done_ones_of_one_kind_are_applied():
    stand = Stand("normal:90")
    walk, _ = record(stand, SECONDS_15)
    middle, _ = record(stand, Plan(choice=DOUBLE, method="middle", seconds=10))
    running = stand.device.calibrate(STEPS_20)
    taught = stand.device.calibrations.taught
    with pytest.raises(ParameterError, match="one method"):
        taught(stand.device.lineup, [walk.number, middle.number])
    with pytest.raises(NotNowError, match="recording"):
        taught(stand.device.lineup, [walk.number, running.number])
    with pytest.raises(UnknownNumberError):
        taught(stand.device.lineup, [77])
    assert taught(stand.device.lineup, [walk.number, walk.number]) == taught(stand.device.lineup, [walk.number])


def test_a_device_keeps_so_many_and_no_more(monkeypatch):
    monkeypatch.setattr(calibrations, "KEPT", 1)
    stand = Stand("normal:60")
    record(stand, SECONDS_15)
    with pytest.raises(NotNowError, match="delete"):
        stand.device.calibrate(STEPS_20)
