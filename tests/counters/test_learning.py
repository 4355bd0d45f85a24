"""Calibration while a walk goes on: exactly what the counters' own functions learn of the same samples, and no less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.gait import Walker
from device_sim.gait_poses import POSES
from service.counters import double_threshold, gyro_zero_crossing
from service.counters.learning import FEWEST_SPACINGS, MIDDLE, SLOWEST_WALK, WALK
from service.errors import CounterError, LearningError
from service.samples import GRID_HZ, SampleBlock

POCKET = POSES["pocket"]


def columns(rows):
    return tuple([float(value) for value in column] for column in rows.T)


def wrist(schedule, seed=3):
    """A walk of a wrist, as one block."""
    return SampleBlock(start=1234, acc_g=columns(Walker(schedule, seed=seed).read(100_000)))


def thigh(schedule, seed=3):
    """A walk of a phone in a trouser pocket, with its gyroscope."""
    walker = Walker(schedule, seed=seed, arm_m=POCKET.arm_m, gaits=POCKET.gaits, gravity=POCKET.gravity)
    sensed = walker.sensed()
    return SampleBlock(start=70, acc_g=columns(sensed.acc_g), gyro_rad_s=columns(sensed.gyro_rad_s))


def pieces(block, sizes):
    """Cut a block into blocks of these sizes, over and over."""
    done, turn = 0, 0
    while done < len(block):
        n = sizes[turn % len(sizes)]
        part = slice(done, done + n)
        yield SampleBlock(
            start=block.start + done,
            acc_g=tuple(axis[part] for axis in block.acc_g),
            gyro_rad_s=tuple(axis[part] for axis in block.gyro_rad_s) if block.gyro_rad_s else None,
        )
        done, turn = done + n, turn + 1


def learnt(method, params, blocks):
    learner = method.learner(params)
    for block in blocks:
        learner.update(block)
    return method.conclude(learner.finish(), params).params


WALKS = {name: wrist(f"rest:2,{name}:25,rest:1") for name in ("slow", "normal", "fast", "run")}
SLOW_THIGH = thigh("rest:2,slow:20@60,rest:1")


@settings(max_examples=40)
@given(
    pace=st.sampled_from(sorted(WALKS)),
    preset=st.sampled_from([double_threshold.PAPER, double_threshold.TUNED]),
    method=st.sampled_from([(WALK, double_threshold.sampled_window), (MIDDLE, double_threshold.middle_window)]),
    sizes=st.lists(st.integers(1, 200), min_size=1, max_size=5),
)
def test_a_window_is_what_the_whole_recording_gives(pace, preset, method, sizes):
    live, offline = method
    window = offline(WALKS[pace], preset)
    assert learnt(live, preset, pieces(WALKS[pace], sizes)) == {"window_mode": "fixed", "first_window": window}


@pytest.mark.parametrize("sizes", [[1], [10], [7, 200, 1, 64], [10_000]])
@pytest.mark.parametrize("preset", [gyro_zero_crossing.PAPER, gyro_zero_crossing.TUNED])
def test_thresholds_are_what_the_whole_recording_gives(preset, sizes, monkeypatch):
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)  # compiling takes seconds
    params = replace(preset, margin=0.7)
    offline = gyro_zero_crossing.calibrated(SLOW_THIGH, params)
    live = learnt(SLOWEST_WALK, params, pieces(SLOW_THIGH, sizes))
    assert live == {"peak_rad_s": offline.peak_rad_s, "valley_rad_s": offline.valley_rad_s}
    assert live["peak_rad_s"] != params.peak_rad_s


def test_the_learnt_window_is_the_walkers_own_step():
    for pace, steps_per_minute in (("slow", 90), ("normal", 110), ("fast", 130)):
        walk = wrist(f"{pace}:30@{steps_per_minute}")
        window = learnt(WALK, double_threshold.TUNED, [walk])["first_window"]
        assert window == pytest.approx(GRID_HZ * 60 / steps_per_minute, rel=0.1)


def test_steps_can_be_watched_as_they_are_walked():
    learner, seen = WALK.learner(double_threshold.TUNED), []
    for block in pieces(WALKS["normal"], [10]):
        learner.update(block)
        seen.append(learner.steps)
    assert seen == sorted(seen)
    assert len(set(seen)) > 20
    assert seen[-1] == pytest.approx(25 * 110 / 60, abs=6)


def test_steps_of_a_slow_swing_are_its_swings_and_standing_is_none():
    learner = SLOWEST_WALK.learner(gyro_zero_crossing.PAPER)
    for block in pieces(thigh("rest:6"), [10]):
        learner.update(block)
        assert learner.steps == 0
    learner = SLOWEST_WALK.learner(gyro_zero_crossing.PAPER)
    for block in pieces(SLOW_THIGH, [10]):
        learner.update(block)
    assert learner.steps == pytest.approx(20, abs=2)


def test_paces_are_pooled_over_all_their_spacings():
    params, evidence = double_threshold.TUNED, []
    for pace in ("slow", "run"):
        learner = WALK.learner(params)
        learner.update(WALKS[pace])
        evidence.append(learner.finish())
    slow, run = evidence
    lesson = WALK.conclude([*slow, *run], params)
    mean = (sum(slow) + sum(run)) / (len(slow) + len(run))
    assert lesson.params["first_window"] == int(mean + 0.5)
    assert f"{mean:.1f} samples" in lesson.detail
    assert f"{len(slow) + len(run)} intervals" in lesson.detail


def test_a_mean_above_the_limit_is_halved_and_the_sentence_says_so():
    params = replace(double_threshold.TUNED, window_limit=40)
    lesson = WALK.conclude([50.0, 51.0, 50.0, 51.0], params)
    assert lesson.params["first_window"] == 25
    assert "halved to 25" in lesson.detail
    assert "halved" not in WALK.conclude([50.0] * 4, double_threshold.TUNED).detail


@pytest.mark.parametrize("method", [WALK, MIDDLE])
def test_no_walk_teaches_no_window(method):
    learner = method.learner(double_threshold.TUNED)
    learner.update(wrist("rest:20"))
    with pytest.raises(LearningError, match="walk evenly"):
        method.conclude(learner.finish(), double_threshold.TUNED)


def test_a_few_steps_teach_no_window():
    with pytest.raises(LearningError):
        WALK.conclude([27.0] * (FEWEST_SPACINGS - 1), double_threshold.TUNED)
    assert WALK.conclude([27.0] * FEWEST_SPACINGS, double_threshold.TUNED).params["first_window"] == 27


def test_the_middle_needs_its_300_samples():
    learner = MIDDLE.learner(double_threshold.TUNED)
    learner.update(next(pieces(WALKS["run"], [299])))
    with pytest.raises(LearningError, match="6 s"):
        learner.finish()


@pytest.mark.parametrize("rate", [np.zeros((300, 3)), np.full((300, 3), 0.5)])
def test_no_swing_teaches_no_threshold(rate):
    learner = SLOWEST_WALK.learner(gyro_zero_crossing.TUNED)
    learner.update(SampleBlock(start=0, acc_g=columns(rate), gyro_rad_s=columns(rate)))
    with pytest.raises(LearningError, match="to and fro"):
        SLOWEST_WALK.conclude(learner.finish(), gyro_zero_crossing.TUNED)


def test_a_device_without_a_gyroscope_is_told():
    with pytest.raises(CounterError, match="gyroscope"):
        SLOWEST_WALK.learner(gyro_zero_crossing.TUNED).update(WALKS["slow"])


@pytest.mark.parametrize(
    ("extrema", "said"),
    [
        ([1.0] * 4 + [-1.0] * 8, "4 swings one way and 8 the other"),
        ([0.05] * 8 + [-1.0] * 8, "hardly stand out of rest"),
    ],
)
def test_swings_that_are_no_walk_teach_nothing(extrema, said):
    with pytest.raises(LearningError, match=said):
        SLOWEST_WALK.conclude(extrema, gyro_zero_crossing.PAPER)


def test_swings_one_more_to_than_fro_are_a_walk():
    assert SLOWEST_WALK.conclude([1.0] * 3 + [-1.0] * 2, gyro_zero_crossing.PAPER).params["peak_rad_s"] == 0.8
