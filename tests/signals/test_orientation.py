"""Which way is up and north: at rest, turned, shaken, near a magnet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from service.signals import orientation
from service.signals.compiled import compiled

REST_G = np.array([0.0, 0.0, 1.0])
FIELD_UT = np.array([0.0, 20.0, -40.0])
"""East, north, up: a field that dips by 63°."""

MAGNET_UT = np.array([90.0, 0.0, 0.0])

few = settings(max_examples=40, deadline=None)
OFFSET = 3
angles = st.floats(-math.pi, math.pi)
attitudes = st.tuples(angles, angles, angles).map(lambda a: Rotation.from_euler("zyx", a))


def fresh(body, acc_g=REST_G, field_ut=FIELD_UT):
    """A state begun in attitude `body` (body to world: east, north, up)."""
    s = [9.0] * (OFFSET + orientation.SIZE + 2)
    orientation.begin(s, OFFSET, *body.inv().apply(acc_g).tolist(), *body.inv().apply(field_ut).tolist())
    return s


def feed(s, body, rate_rad_s=(0.0, 0.0, 0.0), acc_g=REST_G, field_ut=FIELD_UT):
    acc, field = body.inv().apply(acc_g).tolist(), body.inv().apply(field_ut).tolist()
    orientation.advance(s, OFFSET, *acc, *map(float, rate_rad_s), *field)


def vector(s, name):
    return np.array(s[OFFSET + name : OFFSET + name + 3])


def degrees_between(a, b):
    return math.degrees(math.acos(min(1.0, float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b)))))


@few
@given(body=attitudes)
def test_one_sample_at_rest_is_enough(body):
    s = fresh(body)
    assert vector(s, orientation.UP) == pytest.approx(body.inv().apply([0, 0, 1]), abs=1e-9)
    assert vector(s, orientation.NORTH) == pytest.approx(body.inv().apply([0, 1, 0]), abs=1e-9)


@few
@given(body=attitudes, push=st.tuples(*[st.floats(-1, 1)] * 3))
def test_horizontal_is_north_and_east_of_the_world_and_free_of_gravity(body, push):
    s = fresh(body)
    acc_g = body.inv().apply(np.array([0, 0, 1]) + np.array(push))
    assert orientation.horizontal(s, OFFSET, *acc_g) == pytest.approx((push[1], push[0]), abs=1e-9)


@few
@given(body=attitudes, samples=st.integers(1, 60), seed=st.integers(0, 2**32 - 1))
def test_both_directions_stay_unit_vectors_at_right_angles(body, samples, seed):
    s, rng = fresh(body), np.random.default_rng(seed)
    for _ in range(samples):
        orientation.advance(s, OFFSET, *rng.normal(0, 2, 3), *rng.normal(0, 5, 3), *rng.normal(0, 40, 3))
    up, north = vector(s, orientation.UP), vector(s, orientation.NORTH)
    assert np.linalg.norm(up) == pytest.approx(1)
    assert np.linalg.norm(north) == pytest.approx(1)
    assert up @ north == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 2)])
def test_turning_is_followed_by_the_gyroscope(axis):
    """At 5 rad/s, as an arm swings, with what is measured held back by its small weight."""
    rate = 5.0 * np.array(axis) / np.linalg.norm(axis)
    body, s = Rotation.identity(), fresh(Rotation.identity())
    for _ in range(300):
        feed(s, body)
    for _ in range(50):
        body = body * Rotation.from_rotvec(rate / 50)
        feed(s, body, rate)
    assert degrees_between(vector(s, orientation.UP), body.inv().apply([0, 0, 1])) < 1
    assert degrees_between(vector(s, orientation.NORTH), body.inv().apply([0, 1, 0])) < 1


def test_a_wrong_start_is_drawn_to_what_is_measured():
    tilted = Rotation.from_euler("xz", [40, 70], degrees=True)
    s = fresh(tilted)
    for _ in range(400):
        feed(s, Rotation.identity())
    assert degrees_between(vector(s, orientation.UP), np.array([0, 0, 1])) < 1.5
    assert degrees_between(vector(s, orientation.NORTH), np.array([0, 1, 0])) < 3


def test_the_start_is_the_mean_of_the_first_samples():
    """A first sample taken in motion is forgotten as 1/k, not as the weight says."""
    s = fresh(Rotation.identity(), acc_g=np.array([1.0, 0.0, 1.0]))
    for _ in range(24):
        feed(s, Rotation.identity())
    assert degrees_between(vector(s, orientation.UP), np.array([0, 0, 1])) < 45 / 25 * 1.5


def test_walking_leaves_up_where_it_is():
    s, worst = fresh(Rotation.identity()), 0.0
    for k in range(1000):
        push = 0.3 * math.sin(2 * math.pi * 1.9 * k / 50)
        feed(s, Rotation.identity(), acc_g=np.array([push, 0.0, 1.0 + push]))
        if k > 250:
            worst = max(worst, degrees_between(vector(s, orientation.UP), np.array([0, 0, 1])))
    assert worst < 1.5


def test_a_magnet_does_not_turn_north():
    s = fresh(Rotation.identity())
    for _ in range(300):
        feed(s, Rotation.identity())
    for _ in range(50):
        feed(s, Rotation.identity(), field_ut=FIELD_UT + MAGNET_UT)
    assert degrees_between(vector(s, orientation.NORTH), np.array([0, 1, 0])) < 0.5


def test_a_field_of_the_usual_strength_does():
    s = fresh(Rotation.identity())
    for _ in range(300):
        feed(s, Rotation.identity())
    for _ in range(50):
        feed(s, Rotation.identity(), field_ut=np.array([20.0, 0.0, -40.0]))
    assert degrees_between(vector(s, orientation.NORTH), np.array([0, 1, 0])) > 20


@pytest.mark.parametrize("acc_g", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_without_a_field_north_is_some_steady_direction(acc_g):
    s = fresh(Rotation.identity(), np.array(acc_g), np.zeros(3))
    first = vector(s, orientation.NORTH)
    for _ in range(100):
        feed(s, Rotation.identity(), acc_g=np.array(acc_g), field_ut=np.zeros(3))
    assert vector(s, orientation.NORTH) == pytest.approx(first)
    assert np.linalg.norm(first) == pytest.approx(1)
    assert first @ vector(s, orientation.UP) == pytest.approx(0, abs=1e-12)


def test_only_its_own_part_of_the_state_is_touched():
    s = fresh(Rotation.identity())
    feed(s, Rotation.from_euler("x", 1.0), (1.0, 2.0, 3.0))
    assert s[:OFFSET] == [9.0] * OFFSET
    assert s[OFFSET + orientation.SIZE :] == [9.0, 9.0]


def test_compiled_it_is_the_same_to_the_bit():
    pytest.importorskip("numba")
    rng = np.random.default_rng(5)
    s = fresh(Rotation.identity())
    fast = np.array(s)
    for row in rng.normal(0, 3, (200, 9)):
        orientation.advance(s, OFFSET, *row.tolist())
        compiled(orientation.advance)(fast, OFFSET, *row)
    assert fast.tolist() == s
