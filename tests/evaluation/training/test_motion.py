"""Changed recordings: the same steps at the same share of the way, the same length, nothing that is no number."""

import numpy as np
import pytest
from evaluation.made import STEP_HZ, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.evaluation.training import motion
from service.samples import GRID_HZ

seeds = st.integers(0, 2**32 - 1)
factors = st.floats(0.78, 1.28)
few_samples = st.integers(100, 600)

few = settings(max_examples=25)


def crests_s(acc_g):
    """Times of the norm's crests above 1.2 g."""
    norm = np.linalg.norm(acc_g, axis=1)
    inner = norm[1:-1]
    return (np.flatnonzero((inner > norm[:-2]) & (inner >= norm[2:]) & (inner > 1.2)) + 1) / GRID_HZ


def noise(samples, seed):
    return np.random.default_rng(seed).normal([0.0, 0.0, 1.0], 1.0, (samples, 3))


@few
@given(factor=factors, seconds=st.floats(5, 40))
def test_a_stretched_walk_keeps_its_steps_where_they_were(factor, seconds):
    acc_g = walk(seconds).acc_g
    before, after = crests_s(acc_g), crests_s(motion.stretched(acc_g, factor))
    assert len(after) == len(before) >= STEP_HZ * seconds - 1
    assert np.abs(after * factor - before).max() <= 2.0 / GRID_HZ


@few
@given(factor=factors, samples=few_samples)
def test_a_stretch_is_as_long_as_its_pace_says(factor, samples):
    acc_g = noise(samples, 1)
    made = motion.stretched(acc_g, factor)
    assert len(made) == round(samples / factor)
    assert made[0] == pytest.approx(acc_g[0])
    assert made[-1] == pytest.approx(acc_g[-1])


@few
@given(rate_hz=st.sampled_from(motion.RATES_HZ), samples=few_samples, seed=seeds)
def test_another_rate_is_as_long_and_makes_nothing_up(rate_hz, samples, seed):
    acc_g = noise(samples, seed)
    made = motion.at_rate(acc_g, rate_hz, np.random.default_rng(seed))
    assert made.shape == acc_g.shape
    assert (made.max(axis=0) <= acc_g.max(axis=0) + 1e-12).all()
    assert (made.min(axis=0) >= acc_g.min(axis=0) - 1e-12).all()


@few
@given(seed=seeds)
def test_a_rotation_turns_and_does_not_mirror(seed):
    turn = motion.rotation(np.random.default_rng(seed))
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


@few
@given(seed=seeds, opposite=st.booleans())
def test_a_direction_is_turned_onto_another(seed, opposite):
    start, end = np.random.default_rng(seed).standard_normal((2, 3))
    end = -start if opposite else end
    turn = motion.turn_onto(start, end)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert start @ turn / np.linalg.norm(start) == pytest.approx(end / np.linalg.norm(end), abs=1e-6)


@few
@given(seed=seeds)
def test_an_arm_swings_once_in_two_steps(seed):
    recording = walk(20.0)
    made = motion.with_arm_swing(recording.acc_g, recording.step_t_s, np.random.default_rng(seed))
    assert made.shape == recording.acc_g.shape
    assert np.isfinite(made).all()
    t_s = np.arange(1000) / GRID_HZ
    angle = motion._swing(t_s, recording.step_t_s, np.random.default_rng(seed))[100:900]
    half, whole = (abs(np.exp(-2j * np.pi * hz * t_s[:800]) @ (angle - angle.mean())) for hz in (STEP_HZ / 2, STEP_HZ))
    assert half > whole


@few
@given(seed=seeds)
def test_an_arm_hangs_still_where_nobody_steps(seed):
    still = np.tile([0.0, 0.6, 0.8], (200, 1))
    made = motion.with_arm_swing(still, np.empty(0), np.random.default_rng(seed))
    assert np.ptp(made, axis=0) == pytest.approx([0.0] * 3, abs=1e-9)
    assert np.linalg.norm(made[0]) == pytest.approx(1.0)


@few
@given(samples=few_samples, seed=seeds)
def test_another_sensor_is_as_long_and_measures_numbers(samples, seed):
    acc_g = noise(samples, seed)
    made = motion.as_sensed(acc_g, np.random.default_rng(seed))
    assert made.shape == acc_g.shape
    assert np.isfinite(made).all()
