"""The adaptive double threshold against its text: an oracle, and each rule by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from counters import oracle
from counters.conformance import Signal, collect, cut_signals, signals, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import double_threshold_kernel as kernel
from service.counters.contract import with_overrides
from service.counters.double_threshold import (
    PAPER,
    TUNED,
    DoubleThresholdParams,
    build,
    middle_window,
    sampled_window,
    step_rows,
)
from service.counters.streaming import COMPILED_FROM
from service.errors import ParameterError
from service.samples import GRID_HZ, SampleBlock, Update

few = settings(max_examples=60, deadline=None)

PLAIN = replace(PAPER, axes="norm", rest_raw=0.0, window_mode="fixed")


def block_of(magnitude, start=0):
    """A block whose Z axis alone carries the magnitude."""
    zeros = [0.0] * len(magnitude)
    return SampleBlock(start=start, acc_g=(zeros, zeros, [float(m) for m in magnitude]))


def steps_of(params, magnitude):
    return collect(build(params), [block_of(magnitude)], finish=True).steps


def peaks_of(steps):
    """Grid indices of the steps' peaks on the filtered signal."""
    return [round(step.at_s * GRID_HZ) + 2 for step in steps]


def bumpy(samples, step_hz=2.0, swing_g=0.6):
    """A walk whose every second crest and valley is a little smaller, as steps are."""
    n = np.arange(samples) / GRID_HZ
    swing = np.where(np.floor(n * step_hz) % 2 == 0, swing_g, 0.8 * swing_g)
    return 1.0 + swing * np.sin(2 * np.pi * step_hz * n)


@few
@given(
    signal=signals(),
    half=st.integers(1, 3),
    length=st.integers(5, 90),
    valleys=st.integers(1, 3),
    wait=st.integers(10, 120),
    low=st.integers(5, 20),
    high=st.integers(30, 250),
    share=st.sampled_from([0.0, 0.4, 0.9]),
)
def test_agrees_with_the_text(signal, half, length, valleys, wait, low, high, share):
    params = replace(
        PLAIN,
        half_width=half,
        first_window=length,
        valleys=valleys,
        valley_wait=wait,
        min_spacing=low,
        max_spacing=high,
        lower_share=share,
        rest_raw=-1e9,  # off: with two peaks in a row a valley may lie above the first, and the text has no word on it
    )
    magnitude = np.sqrt(signal.values[:, 0] ** 2 + signal.values[:, 1] ** 2 + signal.values[:, 2] ** 2)
    magnitude = magnitude + 1e-9 * np.arange(len(signal)) % 7  # no ties that rounding could break either way
    valid, steps = oracle.valid_peaks(
        magnitude, half=half, length=length, valleys=valleys, wait=wait, low=low, high=high, share=share
    )
    assert peaks_of(steps_of(params, magnitude)) == steps
    everything = steps_of(replace(params, credit="retrospective"), magnitude)
    assert set(steps) <= set(peaks_of(everything)) <= set(valid)


def test_filter_is_the_mean_of_five_with_its_delay_taken_off():
    impulse = [1.0] * 20
    impulse[10] = 6.0
    update = build(PAPER).update(block_of(impulse, start=100))
    assert update.trace == pytest.approx([1.0] * 10 + [2.0] * 5 + [1.0] * 5)
    assert update.trace_from_s == pytest.approx((100 - 2) / GRID_HZ)
    centre_s = update.trace_from_s + 12 / GRID_HZ
    assert centre_s == pytest.approx(110 / GRID_HZ)


@pytest.mark.parametrize(("axes", "expected"), [("xz", 5.0), ("norm", 13.0)])
def test_magnitude_of_two_axes_or_three(axes, expected):
    block = SampleBlock(start=0, acc_g=([3.0] * 5, [12.0] * 5, [4.0] * 5))
    assert build(replace(PAPER, axes=axes)).update(block).trace == [expected] * 5


def test_thresholds_of_a_window_come_from_its_own_extrema():
    x = oracle.smooth(bumpy(400))
    found = oracle.extrema(x, 2)
    bands = collect(build(PLAIN), [block_of(bumpy(400))], finish=True).bands
    expected = [bounds for bounds in oracle.thresholds(found, 400, 30) if bounds]
    assert [(band.upper, band.lower) for band in bands] == [pytest.approx(bounds) for bounds in expected]
    assert len(bands) == 14
    assert all(a.to_s == b.from_s for a, b in pairwise(bands))
    assert bands[-1].to_s == pytest.approx((400 - 2) / GRID_HZ)


def test_lower_share_lifts_the_lower_threshold_only():
    plain = collect(build(PLAIN), [block_of(bumpy(400))]).bands
    lifted = collect(build(replace(PLAIN, lower_share=0.25)), [block_of(bumpy(400))]).bands
    for a, b in zip(plain, lifted, strict=True):
        assert b.upper == a.upper
        assert b.lower == pytest.approx(a.lower + 0.25 * 2 * (a.upper - a.lower))


def test_the_paper_takes_the_first_valid_peak_as_reference_and_tuned_credits_it():
    never = steps_of(PAPER, bumpy(600))
    credited = steps_of(replace(PAPER, credit="retrospective"), bumpy(600))
    assert peaks_of(credited)[1:] == peaks_of(never)
    for steps in (never, credited):
        assert [step.interval_s is None for step in steps] == [True] + [False] * (len(steps) - 1)


@pytest.mark.parametrize(("steps", "counted"), [(4, 0), (5, 5), (9, 9)])
def test_a_bout_shorter_than_five_is_dropped_a_longer_one_counts_whole(steps, counted):
    magnitude = np.concatenate([np.ones(60), bumpy(25 * steps), np.ones(200)])
    assert len(steps_of(replace(TUNED, lower_share=0.5), magnitude)) == counted


def test_a_pause_starts_a_new_reference():
    pause = np.ones(300)
    magnitude = np.concatenate([bumpy(300), pause, bumpy(300)])
    late = [step for step in steps_of(replace(PAPER, credit="retrospective"), magnitude) if step.at_s > 12.0]
    assert late[0].interval_s is None
    assert len(late) > 5


def test_peaks_too_near_are_one_step():
    fast = bumpy(500, step_hz=5.5)
    spacing = np.diff(peaks_of(steps_of(replace(PLAIN, half_width=1), fast)))
    assert len(spacing) > 5
    assert spacing.min() > 10


@pytest.mark.parametrize(("max_spacing", "counted"), [(50, False), (51, True)])
def test_a_spacing_of_the_maximum_is_a_new_reference(max_spacing, counted):
    signal = Signal(walk(2000, 1.0, 0.3))
    assert bool(step_rows(signal.block(), replace(TUNED, max_spacing=max_spacing)).size) is counted


def test_nothing_counts_before_both_means_exist():
    one_peak_then_valleys = np.concatenate([np.linspace(1.0, 2.0, 15), np.linspace(2.0, 0.5, 40), bumpy(200)])
    params = replace(PLAIN, first_window=30, lower_share=0.9, credit="retrospective")
    update = build(params).update(block_of(one_peak_then_valleys))
    assert update.bands[0].from_s >= 28 / GRID_HZ
    assert min(step.at_s for step in update.steps) >= update.bands[0].from_s


def test_a_peak_waits_for_its_valley_as_long_as_it_may_and_no_longer():
    counter = build(replace(PLAIN, valley_wait=100))
    counter.update(block_of(bumpy(585)))
    ramp = np.linspace(1.5, 0.1, 200)
    pending = [counter.update(block_of(ramp[k : k + 1], start=585 + k)).pending for k in range(len(ramp))]
    assert pending[90] == 1
    assert pending[100 + 30 + 10] == 0


@pytest.mark.parametrize(("swing_g", "moves"), [(0.014, False), (0.03, True)])
def test_less_than_one_raw_unit_is_rest(swing_g, moves):
    assert bool(steps_of(PAPER, bumpy(600, swing_g=swing_g))) is moves


def test_rest_is_raw_units_over_their_size():
    small = bumpy(600, swing_g=0.2)
    assert steps_of(replace(PAPER, rest_raw=8.0), small)
    assert not steps_of(replace(PAPER, rest_raw=8.0, lsb_per_g=16.0), small)


def test_a_crest_of_two_equal_samples_is_a_peak_only_where_ties_go_on():
    signal = Signal(walk(2000, 1.0, 0.3))  # 50 samples a step: the mean of five has two equal greatest values
    counted = {
        ties: len(collect(build(replace(TUNED, ties=ties)), [signal.block()], finish=True).steps)
        for ties in ("break", "go_on")
    }
    assert counted["go_on"] == 39
    assert counted["break"] < 30


@pytest.mark.parametrize("step_hz", [1.25, 2.0, 2.3])
def test_window_becomes_the_mean_spacing_of_steps(step_hz):
    counter = build(replace(TUNED, first_window=40))
    counter.update(block_of(bumpy(1500, step_hz)))
    assert counter.snapshot()["state"][kernel.WINDOW - kernel.CONSTANTS] == round(GRID_HZ / step_hz)


def test_a_long_mean_spacing_is_halved():
    counter = build(replace(TUNED, window_limit=35))
    counter.update(block_of(bumpy(1500, 1.25)))
    assert counter.snapshot()["state"][kernel.WINDOW - kernel.CONSTANTS] == 20


def test_a_fixed_window_stays():
    counter = build(replace(TUNED, window_mode="fixed", first_window=44))
    counter.update(block_of(bumpy(1500)))
    assert counter.snapshot()["state"][kernel.WINDOW - kernel.CONSTANTS] == 44


def test_window_of_a_sampling_walk_and_of_the_middle():
    fast_slow_fast = np.concatenate([bumpy(600, 2.5), bumpy(400, 1.25), bumpy(600, 2.5)])
    assert sampled_window(block_of(bumpy(900, 2.5)), TUNED) == 20
    assert middle_window(block_of(fast_slow_fast), TUNED) == 40
    assert middle_window(block_of(fast_slow_fast), replace(TUNED, window_limit=30)) == 20
    assert sampled_window(block_of(np.ones(600)), TUNED) == TUNED.first_window


def test_after_a_long_gap_only_belief_lasts():
    walked = build(TUNED)
    walked.update(block_of(bumpy(700)))
    belief = slice(0, kernel.BOUT_PEAKS - kernel.CONSTANTS)
    fresh = build(TUNED)
    state = fresh.snapshot()
    fresh_belief = list(state["state"][belief])
    walked.finish()
    state["state"][belief] = walked.snapshot()["state"][belief]
    assert state["state"][belief] != fresh_belief
    fresh.restore(state)
    after = block_of(bumpy(700, 1.7), start=2000)
    assert collect(walked, [after], finish=True).steps == collect(fresh, [after], finish=True).steps


@pytest.mark.parametrize(("gap", "goes_on"), [(40, True), (80, True), (150, False)])
def test_a_certain_bout_goes_on_over_a_short_gap(gap, goes_on):
    counter = build(TUNED)
    counter.update(block_of(bumpy(600)))
    few_steps = collect(counter, [block_of(bumpy(80), start=600 + gap)], finish=True).steps
    after = [step for step in few_steps if step.at_s > 12.0]
    assert bool(after) is goes_on
    assert not after or after[0].interval_s is None


def test_an_uncertain_bout_ends_with_a_gap():
    counter = build(TUNED)
    held = block_of(np.concatenate([np.ones(60), bumpy(90)]))
    assert counter.update(held).pending >= 2
    assert collect(counter, [block_of(bumpy(80), start=190)], finish=True).steps == []


def test_pending_rises_while_a_bout_is_uncertain_and_falls_when_it_ends():
    counter = build(TUNED)
    magnitude = np.concatenate([np.ones(60), bumpy(70), np.ones(400)])
    pending = [counter.update(block_of(magnitude[k : k + 10], start=k)).pending for k in range(0, len(magnitude), 10)]
    assert max(pending) >= 2
    assert pending[-1] == 0


def test_latency_is_the_sum_of_its_waits():
    assert build(PAPER).latency_s == pytest.approx((2 + 100 + 126 + 2) / GRID_HZ)
    assert build(TUNED).latency_s == pytest.approx((2 + 50 + 60 + 1 + 4 * 74) / GRID_HZ)


@few
@given(
    seed=st.integers(0, 2**32 - 1),
    half=st.integers(1, 4),
    wait=st.integers(10, 250),
    length=st.integers(5, 150),
    spacing=st.integers(5, 25),
)
def test_noise_never_overflows_the_queue_or_the_rows(seed, half, wait, length, spacing):
    params = replace(
        TUNED, half_width=half, valley_wait=wait, first_window=length, min_spacing=spacing, rest_raw=0.0, bout=12
    )
    counter = build(params)
    rng = np.random.default_rng(seed)
    x = 1.0 + rng.standard_normal(1900) * rng.choice([0.0, 1.0], size=1900)
    capacity = int(counter._state[kernel.CAPACITY])
    for k in range(0, len(x), 50):
        counter.update(block_of(x[k : k + 50], start=k))
        assert counter._state[kernel.COUNT] < capacity
    length_before = len(counter._state)
    counter.update(block_of(x, start=len(x)))
    assert len(counter._state) == length_before


def test_zigzag_fills_the_queue_no_further_than_it_holds():
    params = replace(TUNED, half_width=1, valley_wait=250, max_spacing=500)
    counter = build(params)
    zigzag = np.where(np.arange(3000) % 10 < 5, 1.0, 2.0) + np.arange(3000) * 0.01
    worst = 0.0
    for k in range(0, 3000, 10):
        counter.update(block_of(zigzag[k : k + 10], start=k))
        worst = max(worst, counter._state[kernel.COUNT])
    assert 1 < worst < counter._state[kernel.CAPACITY]


@few
@given(cut=cut_signals())
def test_rows_of_a_recording_are_the_steps(cut):
    signal, _ = cut
    steps = collect(build(TUNED), [signal.block()], finish=True).steps
    rows = step_rows(signal.block(), TUNED)
    assert [(r[0] - 2) / GRID_HZ for r in rows] == [step.at_s for step in steps]
    assert [r[2] - r[3] for r in rows] == [step.strength for step in steps]
    assert [(r[4], r[5]) for r in rows] == [(step.upper, step.lower) for step in steps]


def test_rows_of_nothing_are_none():
    assert step_rows(block_of([])).shape == (0, 6)


def test_an_empty_block_says_nothing():
    assert build(TUNED).update(block_of([])) == Update()


def test_an_overlapping_block_is_refused():
    counter = build(TUNED)
    counter.update(block_of(np.ones(20)))
    with pytest.raises(ValueError, match="20 was next"):
        counter.update(block_of(np.ones(20), start=19))


def test_state_is_plain_floats_on_either_path():
    long = Signal(np.tile(walk(500, 2.0, 0.5), (COMPILED_FROM // 500 + 1, 1)))
    counter = build(TUNED)
    counter.update(long.block(arrays=True))
    counter.update(long.block(0, 30, offset=len(long), arrays=True))
    assert {type(value) for value in counter.snapshot()["state"]} == {float}


@pytest.mark.parametrize(("name", "value"), [("half_width", 0), ("axes", "yz"), ("bout", 13), ("first_window", 4)])
def test_parameters_are_checked(name, value):
    with pytest.raises(ParameterError):
        with_overrides(DoubleThresholdParams(), {name: value})
