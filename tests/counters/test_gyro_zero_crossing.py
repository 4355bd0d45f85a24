"""The gyroscope's zero crossings against their text: an oracle, and each rule by hand."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from counters import conformance
from counters.conformance import Signal, collect, cut_signals, signals
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as filters

from service.counters.contract import with_overrides
from service.counters.gyro_zero_crossing import (
    PAPER,
    TUNED,
    GyroZeroCrossingParams,
    build,
    calibrated,
    step_rows,
)
from service.errors import CounterError, ParameterError
from service.samples import GRID_HZ, SampleBlock

few = settings(max_examples=60, deadline=None)

SHARP = replace(PAPER, cutoff_hz=10.0, rest_rad_s=0.0)
"""A filter that leaves lobes of 0.2 s and more as they are, and no learning of the rate at rest."""

HELD = replace(TUNED, start_delay_s=1.5, taken_out_s=2.5, bout=3)
"""All that makes a step wait at once."""


def block_of(rate_rad_s, start=0, axis=0):
    """A block whose gyroscope turns about one axis only."""
    columns = [[0.0] * len(rate_rad_s) for _ in range(3)]
    columns[axis] = [float(rate) for rate in rate_rad_s]
    still = [0.0] * len(rate_rad_s)
    return SampleBlock(start=start, acc_g=(still, still, still), gyro_rad_s=tuple(columns))


def lobes(*parts):
    """Half sines of (height in rad/s, seconds) one after the other; a height of 0 is rest."""
    rates = []
    for height, seconds in parts:
        n = round(seconds * GRID_HZ)
        rates.append(height * np.sin(np.pi * (np.arange(n) + 0.5) / n))
    return np.concatenate(rates)


def swing(steps, height=1.0, seconds=0.5):
    return [(height if step % 2 == 0 else -height, seconds) for step in range(steps)]


def steps_of(params, rate_rad_s, **where):
    return collect(build(params), [block_of(rate_rad_s, **where)], finish=True).steps


def strengths(steps):
    return [round(step.strength, 1) for step in steps]


def oracle(trace, p, delay):
    """Sections D to F on a filtered rate: the confirmed crossings as (where, extremum)."""
    found, side, last = [], 0, None
    for k in range(len(trace)):
        before = trace[k - 1] if k else 0.0
        sign = 1 if before <= 0 < trace[k] else -1 if before >= 0 > trace[k] else 0
        if sign in {0, side}:
            continue
        at = k - trace[k] / (trace[k] - before)
        if last is not None and at - last < p.refractory_s * GRID_HZ:
            continue
        side = sign
        if at < delay:
            continue
        threshold = p.peak_rad_s if sign > 0 else p.valley_rad_s
        for i in range(k, len(trace) - 1):
            value, falls = sign * trace[i], sign * trace[i + 1] < sign * trace[i]
            if value < 0 or i + 1 - at > p.extremum_wait_s * GRID_HZ:
                break
            if falls and value > threshold:
                found.append((at, trace[i]))
                last = at
            if falls and (value > threshold or p.extremum == "first"):
                break
    return found


@few
@given(
    signal=signals(),
    peak=st.sampled_from([0.0, 0.05, 0.3, 1.5]),
    valley=st.sampled_from([0.0, 0.05, 0.3, 1.5]),
    extremum=st.sampled_from(["first", "any"]),
    wait_s=st.sampled_from([0.1, 0.21, 0.5, 1.0]),
    refractory_s=st.sampled_from([0.02, 0.1, 0.3, 0.5]),
    cutoff_hz=st.sampled_from([3.0, 10.0]),
)
def test_agrees_with_the_text(signal, peak, valley, extremum, wait_s, refractory_s, cutoff_hz):
    params = GyroZeroCrossingParams(
        peak_rad_s=peak,
        valley_rad_s=valley,
        extremum=extremum,
        extremum_wait_s=wait_s,
        refractory_s=refractory_s,
        cutoff_hz=cutoff_hz,
        rest_rad_s=0.0,
    )
    counter = build(params)
    update = counter.update(signal.block())
    delay = -update.trace_from_s * GRID_HZ
    expected = oracle(update.trace, params, delay)
    assert [step.at_s * GRID_HZ + delay for step in update.steps] == pytest.approx([at for at, _ in expected])
    assert [step.strength for step in update.steps] == [abs(value) for _, value in expected]
    assert [step.upper is not None for step in update.steps] == [value > 0 for _, value in expected]


def test_the_oracle_finds_steps_at_all():
    p = SHARP
    update = build(p).update(block_of(lobes(*swing(8))))
    assert len(oracle(update.trace, p, -update.trace_from_s * GRID_HZ)) == 7 == len(update.steps)


@pytest.mark.parametrize("params", [PAPER, TUNED, HELD])
@few
@given(data=st.data())
def test_the_contract_holds_while_steps_are_held(params, data):
    make = partial(build, params)
    conformance.check_cutting(make, *data.draw(cut_signals()))
    signal = data.draw(signals())
    conformance.check_latency(make, signal)
    conformance.check_resume(make, signal, data.draw(st.integers(0, len(signal) - 1)))
    conformance.check_steps(make, signal)
    conformance.check_finished(make, signal)


@settings(max_examples=8, deadline=None)
@given(signal=signals())
def test_a_long_block_equals_packets_while_steps_are_held(signal):
    conformance.check_long_block(partial(build, HELD), signal, 3000)


@pytest.mark.parametrize("cutoff_hz", [1.5, 3.0, 10.0])
def test_the_filter_is_scipys(cutoff_hz):
    rate = np.random.default_rng(5).standard_normal(800)
    sections = filters.butter(6, cutoff_hz, fs=50, output="sos")
    trace = build(replace(SHARP, cutoff_hz=cutoff_hz)).update(block_of(rate)).trace
    assert trace == pytest.approx(filters.sosfilt(sections, rate), abs=1e-9)


@pytest.mark.parametrize("step_hz", [50 / 60, 100 / 60, 150 / 60])
@pytest.mark.parametrize("cutoff_hz", [3.0, 5.0])
def test_steps_lie_where_the_rate_is_zero(step_hz, cutoff_hz):
    rate = 2.0 * np.sin(np.pi * step_hz * np.arange(1000) / GRID_HZ)
    steps = steps_of(replace(SHARP, cutoff_hz=cutoff_hz), rate)
    assert len(steps) >= 20 * step_hz - 3
    for step in steps[3:]:
        off = step.at_s * step_hz
        assert abs(off - round(off)) / step_hz < 0.005
    for before, step in pairwise(steps):
        assert step.interval_s == pytest.approx(step.at_s - before.at_s)


def test_trace_carries_its_delay_and_time_starts_with_the_block():
    update = build(PAPER).update(block_of([0.0] * 20, start=1000))
    assert update.trace_from_s == pytest.approx(20.0 - 0.205, abs=0.001)


def test_both_crossings_count_and_say_which_threshold_they_passed():
    params = replace(SHARP, peak_rad_s=0.4, valley_rad_s=0.6)
    steps = steps_of(params, lobes((0, 0.5), *swing(4), (0, 0.5)))
    assert strengths(steps) == [1.0] * 4
    assert [step.upper for step in steps] == [0.4, None, 0.4, None]
    assert [step.lower for step in steps] == [None, -0.6, None, -0.6]
    assert all(step.peak is None and step.valley is None for step in steps)


@pytest.mark.parametrize(
    ("peak", "valley", "expected"), [(0.7, 0.3, [0.5, 0.5]), (0.3, 0.7, [0.6]), (0.3, 0.3, [0.5] * 3)]
)
def test_peaks_and_valleys_have_thresholds_of_their_own(peak, valley, expected):
    rate = lobes((0, 0.5), (-0.5, 0.5), (0.6, 0.5), (-0.5, 0.5), (0, 0.5))
    steps = steps_of(replace(SHARP, peak_rad_s=peak, valley_rad_s=valley), rate)
    if expected == [0.5] * 3:
        expected = [0.5, 0.6, 0.5]
    assert strengths(steps) == expected


def test_a_shoulder_is_the_first_extremum_and_the_lobe_goes_on():
    shoulder = np.concatenate([lobes((0.3, 0.3))[:11], np.linspace(0.2, 0.2, 5), 0.2 + lobes((1.0, 0.6))[:25]])
    rate = np.concatenate([np.zeros(25), shoulder, np.linspace(shoulder[-1], 0.0, 6), lobes((-1.0, 0.5), (0, 0.5))])
    first = steps_of(replace(SHARP, peak_rad_s=0.6), rate)
    both = steps_of(replace(SHARP, peak_rad_s=0.6, extremum="any"), rate)
    assert [step.lower for step in first] == [-0.3]
    assert [step.upper for step in both] == [0.6, None]


@pytest.mark.parametrize(("wait_s", "counted"), [(0.3, 0), (0.5, 1)])
def test_a_crossing_waits_only_so_long_for_its_extremum(wait_s, counted):
    assert len(steps_of(replace(SHARP, extremum_wait_s=wait_s), lobes((0, 0.5), (1.0, 0.8), (0, 0.5)))) == counted


def test_a_crossing_soon_after_a_confirmed_one_is_hidden_with_its_return():
    """Figure 1's red circle: heel strike, a short way back up, and the swing of the leg."""
    rate = lobes((0, 0.5), (1.0, 0.4), (-0.5, 0.12), (0.5, 0.1), (-1.0, 0.4), (1.0, 0.4), (0, 0.5))
    hidden = steps_of(replace(SHARP, refractory_s=0.2), rate)
    seen = steps_of(replace(SHARP, refractory_s=0.02), rate)
    assert [step.upper is None for step in hidden] == [False, True, False]
    assert [step.upper is None for step in seen] == [False, True, False, True, False]


def test_a_crossing_that_was_not_confirmed_hides_nothing():
    rate = lobes((0, 0.5), (0.1, 0.2), (-1.0, 0.4), (1.0, 0.4), (0, 0.5))
    assert strengths(steps_of(replace(SHARP, refractory_s=0.5), rate)) == [1.0]
    assert strengths(steps_of(replace(SHARP, refractory_s=0.39), rate)) == [1.0, 1.0]


@pytest.mark.parametrize(("steps", "counted"), [(4, 0), (5, 5), (9, 9)])
def test_a_bout_shorter_than_five_is_dropped_a_longer_one_counts_whole(steps, counted):
    rate = lobes((0, 1.0), *swing(steps), (0, 3.0))
    assert len(steps_of(replace(TUNED, axis="x", cutoff_hz=10.0), rate)) == counted


def test_a_pause_ends_a_bout_and_its_interval():
    params = replace(SHARP, bout=3, max_spacing_s=1.0)
    pause = steps_of(params, lobes((0, 0.5), *swing(2), (0, 1.2), *swing(4), (0, 0.5)))
    assert [step.interval_s is None for step in pause] == [True, False, False, False]
    assert pause[0].at_s == pytest.approx(2.7, abs=0.1)
    bridged = steps_of(replace(params, max_spacing_s=2.5), lobes((0, 0.5), *swing(2), (0, 1.2), *swing(4), (0, 0.5)))
    assert [step.interval_s is None for step in bridged] == [True] + [False] * 5


def test_nothing_counts_while_the_phone_goes_in():
    rate = lobes(*swing(20))
    steps = steps_of(replace(SHARP, start_delay_s=3.8), rate, start=500)
    assert len(steps) == 12
    assert steps[0].at_s == pytest.approx(14.0, abs=0.02)


def test_the_start_is_delayed_once_a_stream():
    counter = build(replace(SHARP, start_delay_s=2.0))
    first = collect(counter, [block_of(lobes(*swing(8)))], finish=False)
    assert len(first.steps) == 3  # the fourth's extremum is yet to come
    after_gap = collect(counter, [block_of(lobes(*swing(8)), start=400)], finish=True)
    assert len(after_gap.steps) == 7
    again = collect(counter, [block_of(lobes(*swing(8)), start=900)], finish=True)
    assert len(again.steps) == 3


def test_steps_of_taking_the_phone_out_are_subtracted():
    rate = lobes((0, 0.5), *swing(12), (0, 0.5))
    everything = steps_of(SHARP, rate)
    left = steps_of(replace(SHARP, taken_out_s=3.0), rate)
    end_s = (len(rate) - 1) / GRID_HZ
    assert left == [step for step in everything if step.at_s <= end_s - 3.0]
    assert 0 < len(left) < len(everything) == 12


def test_steps_that_may_be_subtracted_are_pending_until_they_may_not():
    counter = build(replace(SHARP, taken_out_s=2.0))
    rate = lobes((0, 0.5), *swing(6), (0, 3.0))
    confirmed = 0
    for k, value in enumerate(rate):
        update = counter.update(block_of([value], start=k))
        confirmed += len(update.steps)
        for step in update.steps:
            assert 2.0 <= k / GRID_HZ - step.at_s < 2.0 + 1.5 / GRID_HZ
        if k == 163:
            assert (confirmed, update.pending) == (2, 4)
    assert (confirmed, update.pending) == (6, 0)


def test_a_gap_takes_no_held_step_back():
    counter = build(replace(SHARP, taken_out_s=3.0))
    before = collect(counter, [block_of(lobes((0, 0.5), *swing(4), (0, 0.1)))])
    assert before.steps == []
    after = collect(counter, [block_of([0.0] * 10, start=400)])
    assert len(after.steps) == 4


def test_a_certain_bout_goes_on_over_a_short_gap_without_an_interval():
    counter = build(replace(SHARP, bout=3))
    collect(counter, [block_of(lobes((0, 0.5), *swing(5)))])
    over = collect(counter, [block_of(lobes((0, 0.2), *swing(2), (0, 0.2)), start=190)])
    assert [step.interval_s is None for step in over.steps] == [True, False]
    late = collect(counter, [block_of(lobes((0, 0.2), *swing(2), (0, 0.2)), start=190 + 300)], finish=True)
    assert late.steps == []


def test_an_uncertain_bout_ends_with_a_gap():
    counter = build(replace(SHARP, bout=3))
    collect(counter, [block_of(lobes((0, 0.5), *swing(2), (0, 0.1)))])
    assert counter.update(block_of(lobes((0, 0.2), *swing(2), (0, 0.2)), start=150)).pending == 2
    assert counter.finish().steps == ()


def test_a_crossing_past_its_threshold_is_likely_at_once():
    counter = build(SHARP)
    rate = lobes((0, 0.5), (1.0, 1.0))
    pending = [counter.update(block_of([value], start=k)).pending for k, value in enumerate(rate)]
    assert pending[:30] == [0] * 30
    passed = pending.index(1)
    assert passed == pytest.approx(25 + 50 * np.arcsin(0.3) / np.pi + 3, abs=2)
    assert len(build(SHARP).update(block_of(rate)).steps) == 1


def test_a_bout_that_did_not_come_about_is_likely_no_more():
    counter = build(replace(SHARP, bout=4, max_spacing_s=1.0, extremum_wait_s=0.5))
    rate = lobes((0, 0.5), *swing(2), (0, 3.0))
    pending = [counter.update(block_of([value], start=k)).pending for k, value in enumerate(rate)]
    assert pending[70:100] == [2] * 30
    assert pending[53 + 75 + 1 :] == [0] * (len(rate) - 53 - 75 - 1)


@pytest.mark.parametrize(("bias", "learnt"), [(0.1, True), (-0.15, True), (0.3, False)])
def test_the_rate_at_rest_is_subtracted_once_it_is_known(bias, learnt):
    trace = build(PAPER).update(block_of([bias] * 400)).trace
    assert trace[40] == pytest.approx(bias, rel=0.1)
    assert trace[-1] == pytest.approx(0.0 if learnt else bias, abs=1e-6)


def test_a_swing_smaller_than_its_bias_is_counted_after_a_rest():
    params = replace(SHARP, rest_rad_s=0.03, peak_rad_s=0.05, valley_rad_s=0.05)
    rest, moving = np.zeros(150), lobes(*swing(20, height=0.1), (0, 0.5))
    with_rest = steps_of(params, 0.15 + np.concatenate([rest, moving]))
    assert len(with_rest) == pytest.approx(20, abs=1)
    assert len(steps_of(replace(params, rest_rad_s=0.0), 0.15 + np.concatenate([rest, moving]))) <= 1


def test_moving_is_not_taken_for_rest():
    rate = 0.15 + lobes(*swing(40, height=0.2))
    trace = build(replace(SHARP, rest_rad_s=0.03)).update(block_of(rate)).trace
    assert np.mean(trace[200:]) == pytest.approx(0.15, abs=0.02)


def test_the_rate_at_rest_outlasts_a_gap():
    counter = build(PAPER)
    counter.update(block_of([0.1] * 200))
    assert counter.update(block_of([0.1] * 20, start=900)).trace == pytest.approx([0.0] * 20, abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_axis_can_be_set_or_found(axis):
    rate = lobes((0, 1.0), *swing(30), (0, 1.0))
    for name in ("xyz"[axis], "largest"):
        assert len(steps_of(replace(SHARP, axis=name), rate, axis=axis)) == pytest.approx(30, abs=3)
    other = "xyz"[(axis + 1) % 3]
    assert steps_of(replace(SHARP, axis=other), rate, axis=axis) == []


def turning(x_rad_s, y_rad_s, seconds=20.0):
    """A turning of 0.5 Hz about x and one of 0.8 Hz about y."""
    t_s = np.arange(round(seconds * GRID_HZ)) / GRID_HZ
    x, y = x_rad_s * np.sin(np.pi * t_s), y_rad_s * np.sin(1.6 * np.pi * t_s)
    still = [0.0] * len(t_s)
    return SampleBlock(start=0, acc_g=(still, still, still), gyro_rad_s=(x.tolist(), y.tolist(), still))


@pytest.mark.parametrize(("y_rad_s", "step_hz"), [(1.1, 1.0), (1.4, 1.6)])
def test_the_axis_changes_only_for_a_clearly_larger_one(y_rad_s, step_hz):
    steps = build(replace(SHARP, axis="largest")).update(turning(1.0, y_rad_s)).steps
    late = [step.interval_s for step in steps if step.at_s > 10.0]
    assert np.median(late) == pytest.approx(1 / step_hz, abs=0.02)


def test_calibration_takes_the_smallest_true_extremum_of_either_sign():
    walk = lobes((0, 3.0), (1.0, 0.6), (-0.8, 0.6), (0.15, 0.2), (-0.9, 0.6), (0.7, 0.6), (-0.7, 0.6), (0, 1.0))
    params = calibrated(block_of(walk), replace(SHARP, margin=0.5))
    assert params.peak_rad_s == pytest.approx(0.35, abs=0.01)
    assert params.valley_rad_s == pytest.approx(0.35, abs=0.01)
    assert replace(params, peak_rad_s=0.3, valley_rad_s=0.3) == replace(SHARP, margin=0.5)
    low = calibrated(block_of(lobes((0, 1.0), *swing(10, height=0.2, seconds=0.8))), SHARP)
    assert (low.peak_rad_s, low.valley_rad_s) == pytest.approx((0.16, 0.16), abs=0.005)


def test_a_calibrated_counter_counts_the_slowest_walk_it_learnt():
    walk = lobes((0, 2.0), *swing(20, height=0.22, seconds=1.2), (0, 1.0))
    noise = 0.03 * np.random.default_rng(3).standard_normal(len(walk))
    assert len(steps_of(PAPER, walk + noise)) == 0
    assert len(steps_of(calibrated(block_of(walk + noise), PAPER), walk + noise)) == pytest.approx(20, abs=1)


def test_calibration_is_not_misled_by_a_long_stand():
    standing = swing(200, height=0.01, seconds=0.2)
    walk = lobes(*standing, *swing(10, height=1.0), (0.35, 0.5), (-0.35, 0.5), *swing(10, height=1.0))
    assert calibrated(block_of(walk), SHARP).peak_rad_s == pytest.approx(0.8, abs=0.02)


def test_calibration_leaves_out_what_the_hand_does():
    handled = lobes((0, 0.5), *swing(3, height=5.0), *swing(20, height=1.0), *swing(3, height=5.0))
    params = replace(SHARP, start_delay_s=2.2, taken_out_s=1.7)
    assert calibrated(block_of(handled), params).peak_rad_s == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("rate", [np.zeros(300), np.zeros(1), lobes((0, 0.4), (1.0, 0.5), (0, 0.001))])
def test_calibration_without_a_walk_changes_only_what_it_saw(rate):
    params = calibrated(block_of(rate), SHARP)
    assert params.valley_rad_s == SHARP.valley_rad_s
    if not rate.any():
        assert params == SHARP


def test_a_whole_recording_gives_the_same_steps_as_rows():
    rate = lobes((0, 1.0), *swing(40), (0, 1.0))
    rows = step_rows(block_of(rate), SHARP)
    steps = steps_of(SHARP, rate)
    assert [abs(row[2]) for row in rows] == [step.strength for step in steps]
    assert [row[1] / GRID_HZ for row in rows[1:]] == [step.interval_s for step in steps[1:]]
    assert step_rows(block_of([]), SHARP).shape == (0, 4)


def test_thresholds_are_shown_without_a_break():
    bands = build(replace(SHARP, peak_rad_s=0.4)).update(block_of([0.0] * 300, start=50)).bands
    assert [(band.upper, band.lower) for band in bands] == [(0.4, -0.3)] * 3
    assert all(a.to_s == b.from_s for a, b in pairwise(bands))
    assert bands[0].to_s - bands[0].from_s == pytest.approx(2.0)


def test_a_value_that_is_no_number_is_forgotten_within_five_samples():
    rate = lobes((0, 1.0), *swing(20), (0, 1.0))
    for bad in (float("nan"), float("inf"), 1e308):
        broken = rate.copy()
        broken[203] = bad
        update = build(replace(SHARP, axis="largest")).update(block_of(broken))
        assert np.isfinite(update.trace[230:]).all()
        assert all(np.isfinite([step.at_s, step.strength]).all() for step in update.steps)
    broken[203] = float("nan")
    assert len(steps_of(SHARP, broken)) >= len(steps_of(SHARP, rate)) - 3


def test_latency_is_the_sum_of_what_a_step_waits_for():
    delay_s = -build(PAPER).update(block_of([0.0])).trace_from_s
    assert build(PAPER).latency_s == pytest.approx(delay_s + 1.0)
    assert build(TUNED).latency_s == pytest.approx(delay_s + 0.9 + 4 * 1.5)
    assert build(replace(PAPER, taken_out_s=5.0)).latency_s == pytest.approx(5.02)


def test_a_block_without_gyroscope_says_so():
    block = SampleBlock(start=0, acc_g=([0.0], [0.0], [1.0]))
    with pytest.raises(CounterError, match="gyroscope"):
        build(PAPER).update(block)


@pytest.mark.parametrize(("name", "value"), [("axis", "w"), ("cutoff_hz", 30), ("refractory_s", 0), ("margin", 1.5)])
def test_parameters_out_of_range_are_refused(name, value):
    with pytest.raises(ParameterError, match=name):
        with_overrides(PAPER, {name: value})


def test_the_signal_of_the_suite_is_one_it_counts():
    walk = Signal(conformance.walk(1000, 1.8, 0.5))
    assert len(collect(build(TUNED), [walk.block()], finish=True).steps) == pytest.approx(36, abs=1)
