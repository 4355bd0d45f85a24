"""What a disturbance makes of samples."""

import numpy as np
import pytest
from evaluation.made import walk
from hypothesis import given
from hypothesis import strategies as st

from service.evaluation.scorecard.disturbances import (
    DISTURBANCES,
    RATES,
    at_rate,
    cheap,
    clipped,
    rounded,
    seed_of,
    turned,
)
from service.evaluation.scorecard.sampled import Sampled, rotation, rotation_onto, sampled

RAMP = Sampled(acc_g=np.outer(np.arange(200.0), [1, 0, 0]), rate_hz=100.0, gyro_rad_s=np.ones((200, 3)))


@pytest.mark.parametrize(("rate_hz", "first"), [(50.0, [0, 2, 4, 6]), (25.0, [0, 4, 8, 12]), (12.5, [0, 8, 16, 24])])
def test_a_lower_rate_keeps_every_kth_sample_unfiltered(rate_hz, first):
    slower = at_rate(RAMP, 0, rate_hz)
    assert slower.acc_g[:4, 0].tolist() == first
    assert (slower.rate_hz, len(slower), len(slower.gyro_rad_s)) == (rate_hz, 200 * rate_hz / 100, 200 * rate_hz / 100)


def test_a_rate_that_does_not_divide_takes_the_newest_sample_there_is():
    of_32_hz = Sampled(acc_g=RAMP.acc_g, rate_hz=32.0)
    assert at_rate(of_32_hz, 0, 25.0).acc_g[:6, 0].tolist() == [0, 1, 2, 3, 5, 6]  # at 0, 1.28, 2.56, 3.84, 5.12, 6.4


@pytest.mark.parametrize("rate_hz", [100.0, 125.0])
def test_no_lower_rate_is_no_disturbance(rate_hz):
    assert at_rate(RAMP, 0, rate_hz) is None


@given(st.integers(0, 2**32 - 1))
def test_a_rotation_keeps_lengths_and_hands(seed):
    by = rotation(np.random.default_rng(seed))
    assert by @ by.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(by) == pytest.approx(1)


def test_rotations_are_the_recordings_own_and_the_same_every_time():
    of = sampled(walk(2))
    assert np.array_equal(turned(of, seed_of("a")).acc_g, turned(of, seed_of("a")).acc_g)
    assert not np.allclose(turned(of, seed_of("a")).acc_g, turned(of, seed_of("b")).acc_g)
    assert np.linalg.norm(turned(of, 1).gyro_rad_s, axis=1) == pytest.approx(np.linalg.norm(of.gyro_rad_s, axis=1))


vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)


@given(vectors, vectors)
def test_a_direction_is_turned_onto_another(direction, onto):
    by = rotation_onto(direction, onto)
    assert by @ (direction / np.linalg.norm(direction)) == pytest.approx(onto / np.linalg.norm(onto), abs=1e-4)
    assert np.linalg.det(by) == pytest.approx(1, abs=1e-4)


def test_the_opposite_direction_is_half_a_turn():
    by = rotation_onto(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -2.0]))
    assert by @ [0, 0, 1] == pytest.approx([0, 0, -1])
    assert np.linalg.det(by) == pytest.approx(1)


def test_a_range_ends_at_both_sides():
    of = Sampled(acc_g=np.array([[-3.0, 0.5, 3.0]]), rate_hz=50.0)
    assert clipped(of, 0, 2.0).acc_g.tolist() == [[-2.0, 0.5, 2.0]]


def test_eight_bits_are_256_values_of_a_sixteenth_g():
    of = Sampled(acc_g=np.column_stack([np.linspace(-9, 9, 5000)] * 3), rate_hz=50.0)
    coarse = rounded(of, 0, 8).acc_g[:, 0]
    assert len(np.unique(coarse)) == 256
    assert (coarse.min(), coarse.max()) == (-8.0, 8.0 - 1 / 16)
    inside = np.abs(of.acc_g[:, 0]) < 7.9
    assert np.abs(coarse - of.acc_g[:, 0])[inside].max() <= 1 / 32 + 1e-12


def test_a_cheap_wearable_has_all_three_faults():
    of = sampled(walk(4, 100))
    made = cheap(of, 3)
    assert made.rate_hz == 25.0
    assert np.allclose(made.acc_g * 16, np.round(made.acc_g * 16))
    assert not np.allclose(made.acc_g, rounded(at_rate(of, 0, 25.0), 0, 8).acc_g)
    assert cheap(sampled(walk(4, 25)), 3).rate_hz == 25.0


@pytest.mark.full
def test_every_disturbance_of_a_walk_can_be_counted():
    of = sampled(walk(4, 100))
    made = {each.name: each.change(of, 1) for each in DISTURBANCES}
    assert {f"{rate:g} Hz" for rate in RATES} < set(made)
    assert all(len(other.on_grid()) == pytest.approx(200, abs=4) for other in made.values())
