"""The direction of walking: a body that is carried tells it, a limb that swings tells a line, the rest nothing."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.samples import SampleBlock
from service.signals.heading import EVERY, FORWARD, KEPT, WalkingDirection

N = 600
STEP_HZ = 1.8
DIP_UT = (20.0, -43.0)
"""Horizontal to the north, and up: central Europe."""


def block(values, first=0, last=None, *, start=0):
    """Samples `first` to `last` of n × 9 values as a block."""
    columns = [column.tolist() for column in values[first:last].T]
    return SampleBlock(
        start=start + first, acc_g=tuple(columns[:3]), gyro_rad_s=tuple(columns[3:6]), mag_ut=tuple(columns[6:])
    )


def walk(heading_deg, *, swing_rad_s=0.0, held_deg=0.0, n=N, turn_deg_s=0.0, seed=1):
    """n × 9 of somebody who walks there with a device that lies flat, its y axis `held_deg` to the right of ahead.

    The body bobs once a step, is pushed forward FORWARD before that, and sways to the side once a stride. With
    `swing_rad_s` it is a limb: it also moves along the heading once a stride, and turns about the side.
    """
    t_s = np.arange(n) / 50
    phase = 2 * np.pi * STEP_HZ * t_s
    up = 0.25 * np.cos(phase)
    ahead = 0.1 * np.cos(phase + FORWARD) + 0.3 * (swing_rad_s > 0) * np.sin(phase / 2)
    right = 0.12 * np.sin(phase / 2 + 0.7) * (swing_rad_s == 0)
    facing = np.radians(held_deg + heading_deg + turn_deg_s * t_s)
    # Ahead and right of the body as the device's x (right of y) and y see them.
    c, s = np.cos(np.radians(held_deg)), np.sin(np.radians(held_deg))
    values = np.zeros((n, 9))
    values[:, 0], values[:, 1], values[:, 2] = right * c - ahead * s, ahead * c + right * s, 1.0 + up
    values[:, 3] = swing_rad_s * np.sqrt(2) * np.cos(phase / 2)
    values[:, 5] = -np.radians(turn_deg_s)
    values[:, 6], values[:, 7], values[:, 8] = -DIP_UT[0] * np.sin(facing), DIP_UT[0] * np.cos(facing), DIP_UT[1]
    return values + np.random.default_rng(seed).normal(0, [0.01] * 3 + [0.02] * 3 + [0.4] * 3, (n, 9))


def headings(values, **options):
    direction = WalkingDirection()
    direction.update(block(values, **options))
    return [direction.at(k / 50) for k in range(0, len(values), EVERY)]


def off_deg(found, true_deg):
    return (found.deg - true_deg + 180) % 360 - 180


@pytest.mark.parametrize("heading_deg", [0, 75, 140, 255, 330])
@pytest.mark.parametrize("held_deg", [0, 100])
def test_a_carried_device_tells_the_direction_however_it_is_held(heading_deg, held_deg):
    found = headings(walk(heading_deg, held_deg=held_deg))[40:]
    assert all(one is not None and not one.is_line for one in found)
    assert max(abs(off_deg(one, heading_deg)) for one in found) < 18
    assert all(14 < one.uncertainty_deg < 40 for one in found)


@pytest.mark.parametrize("heading_deg", [20, 160, 200, 340])
def test_a_swinging_limb_tells_a_line(heading_deg):
    found = headings(walk(heading_deg, swing_rad_s=1.2))[60:]
    assert all(one is not None and one.is_line for one in found)
    assert all(0 <= one.deg < 180 for one in found)
    assert max(abs((one.deg - heading_deg + 90) % 180 - 90) for one in found) < 15


def test_a_turn_shows_at_once():
    turn_deg_s = 30.0
    direction = WalkingDirection()
    direction.update(block(walk(10.0, turn_deg_s=turn_deg_s)))
    for k in range(250, N, EVERY):
        assert abs(off_deg(direction.at(k / 50), 10.0 + turn_deg_s * k / 50)) < 20


def test_none_at_rest_nor_at_the_start():
    still = walk(0.0)
    still[:, :3] = np.array([0.0, 0.0, 1.0]) + np.random.default_rng(2).normal(0, 0.01, (N, 3))
    assert headings(still) == [None] * len(headings(still))
    assert headings(walk(0.0))[:20] == [None] * 20


def test_none_where_the_front_is_not_settled():
    """Pushed a quarter of a step earlier or later than people are, it could be either way round."""
    values = walk(0.0)
    values[:, 1] = np.roll(values[:, 1], round(50 / STEP_HZ / 4))
    assert sum(one is not None for one in headings(values)[60:]) < 10


def test_a_field_that_moves_widens_the_uncertainty_and_iron_ends_it():
    calm = headings(walk(30.0))[-1]
    moved, iron = walk(30.0), walk(30.0)
    moved[:, 6:] *= 1 + 0.08 * np.sin(np.arange(N) / 9)[:, None]
    assert headings(moved)[-1].uncertainty_deg > calm.uncertainty_deg + 1
    iron[:, 6:] *= 1 + 1.5 * (np.arange(N) // 20 % 2)[:, None]
    assert headings(iron)[-1] is None


@pytest.mark.parametrize("sensor", ["gyro_rad_s", "mag_ut"])
def test_none_without_all_three_sensors(sensor):
    direction = WalkingDirection()
    whole = block(walk(30.0))
    columns = {name: getattr(whole, name) for name in ("acc_g", "gyro_rad_s", "mag_ut") if name != sensor}
    direction.update(SampleBlock(start=0, **columns))
    assert direction.at(10.0) is None


def test_a_sample_that_is_no_number_is_got_over():
    values = walk(30.0)
    values[300] = np.nan
    found = headings(values)
    assert found[62] is None
    assert found[-1] is not None


def test_a_gap_begins_afresh_and_what_is_too_old_is_forgotten():
    direction, values = WalkingDirection(), walk(30.0)
    direction.update(block(values))
    assert direction.at(8.0) is not None
    direction.update(block(values, last=50, start=700))
    assert direction.at(14.5) is None
    assert direction.at(13.0) is None
    assert direction.at(8.0) is not None
    direction.update(block(values, last=50, start=400 + KEPT * EVERY))
    assert direction.at(8.0) is None


@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, 400), max_size=8), at=st.integers(0, 400))
def test_any_cutting_and_any_snapshot_give_the_same(cuts, at):
    values = walk(70.0, n=400)
    whole, cut = WalkingDirection(), WalkingDirection()
    whole.update(block(values))
    for a, b in pairwise([0, *sorted([*cuts, at]), 400]):
        cut.update(block(values, a, b))
        if b == at:
            state = json.loads(json.dumps(cut.snapshot()))
            cut = WalkingDirection()
            cut.restore(state)
    assert json.dumps(cut.snapshot()) == json.dumps(whole.snapshot())
    assert [cut.at(k / 50) for k in range(0, 400, 5)] == [whole.at(k / 50) for k in range(0, 400, 5)]
