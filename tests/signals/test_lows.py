"""The line below delays: least points of slices of time, bounded in number, and the lower hull's edge under them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.signals.lows import FIRST_S, LAST_S, LEAST_SLICES, SLICES, Lows


def filled(points, slope=0.0):
    lows = Lows()
    for point in points:
        lows.add(point, slope)
    return lows


def test_a_slice_keeps_the_point_that_lies_lowest_along_the_slope():
    points = [(0.0, 0.5), (0.2, 0.4), (0.4, 0.45), (1.5, 0.9)]
    assert filled(points).since(0) == [(0.2, 0.4), (1.5, 0.9)]
    assert filled(points, slope=0.3).since(0) == [(0.4, 0.45), (1.5, 0.9)]


def test_a_slice_that_is_complete_is_told():
    lows = Lows()
    assert [lows.add((t * FIRST_S, 0.0), 0.0) for t in (0.0, 0.5, 1.0, 1.9, 3.0, 2.5)] == [
        False, False, True, False, True, False,
    ]  # fmt: skip


def test_what_is_kept_is_bounded_and_reaches_back_as_long_as_told():
    lows = Lows()
    for t in range(10_000):
        lows.add((float(t), 0.0), 0.0)
        assert len(lows.since(0)) <= SLICES
    kept = lows.since(0)
    assert (SLICES - 2) * LAST_S <= 10_000 - kept[0][0] <= (SLICES + 1) * LAST_S
    assert lows.since(9_900) == [low for low in kept if low[0] >= 9_900]


def test_too_few_slices_give_no_line():
    points = [(float(t), 0.0) for t in range(LEAST_SLICES + 1)]
    assert filled(points[:-1]).line() is None
    assert filled(points).line() is not None


@pytest.mark.parametrize("slope", [-0.02, -200e-6, 0.0, 150e-6, 0.02])
def test_the_line_lies_below_every_point_and_has_their_slope(slope):
    times = np.arange(0, 600, 0.2)
    delays = np.random.default_rng(3).exponential(0.1, len(times))
    lows = filled(zip(times.tolist(), (0.3 + slope * times + delays).tolist(), strict=True), slope)
    found, within = lows.line()
    assert abs(found - slope) < within < 60e-6


@given(
    st.lists(st.tuples(st.floats(0.01, 30), st.floats(-5, 5)), min_size=LEAST_SLICES + 2, max_size=200),
    st.floats(-0.03, 0.03),
)
def test_any_points_give_a_line_that_no_slice_lies_below(steps, slope):
    t, points = 0.0, []
    for step_s, behind_s in steps:
        t += step_s
        points.append((t, behind_s))
    lows = filled(points, slope)
    line = lows.line()
    if line is None:
        assert len(lows.since(0)) <= LEAST_SLICES
        return
    assert all(math.isfinite(value) for value in line)
    assert line[1] > 0
    heights = [y - line[0] * x for x, y in lows.since(0)[:-1]]
    touching = [height for height in heights if height <= min(heights) + 1e-9]
    assert len(touching) >= 2
