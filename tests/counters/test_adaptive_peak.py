"""Adaptive peak detection against its text: an oracle, and each rule by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from counters import windowed_peak_oracle as oracle
from counters.conformance import Signal, collect, signals, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import windowed_peak_kernel as kernel
from service.counters.adaptive_peak import PAPER, TUNED, AdaptivePeakParams, build
from service.counters.contract import with_overrides
from service.errors import ParameterError
from service.samples import GRID_HZ, SampleBlock, Update

EVERY_PEAK = replace(PAPER, bout=1)
"""The first of a bout counts too: what is accepted shows as it is."""


def block_of(norm, start=0):
    """A block whose Z axis alone carries the norm."""
    zeros = [0.0] * len(norm)
    return SampleBlock(start=start, acc_g=(zeros, zeros, [float(m) for m in norm]))


def spikes(samples, heights, floor=1.0):
    """A gently falling floor with tops of one rise and one fall at the given samples."""
    x = floor - 1e-6 * np.arange(samples)
    for at, height in heights.items():
        x[at - 1 : at + 2] = (floor + height) / 2, height, (floor + height) / 2
    return x


def steps_at(params, norm):
    """Grid indices of the steps, the filter's delay removed."""
    steps = collect(build(params), [block_of(norm)], finish=True).steps
    return [round(step.at_s * GRID_HZ, 1) for step in steps]


@settings(max_examples=60, deadline=None)
@given(
    signal=signals(),
    window=st.integers(11, 32),
    walk_half=st.integers(2, 20),
    run_half=st.integers(2, 10),
    walk_g=st.sampled_from([0.9, 1.05, 1.2]),
    run_g=st.sampled_from([1.21, 1.5, 2.0]),
    bout=st.integers(1, 5),
)
def test_agrees_with_the_text(signal, window, walk_half, run_half, walk_g, run_g, bout):
    params = replace(
        PAPER, window=window, walk_half=walk_half, run_half=run_half, walk_g=walk_g, run_g=run_g, bout=bout
    )
    norm = np.sqrt(np.sum(signal.values[:, :3] ** 2, axis=1)) + 1e-9 * (np.arange(len(signal)) * 7919 % 10007)
    halves = [walk_half if value <= run_g else run_half for value in norm]
    peaks = [
        k
        for k in oracle.tops(norm)
        if norm[k] >= walk_g
        and oracle.greatest_of_a_window(norm, k, window)
        and oracle.greatest_beside(norm, k, halves[k])
    ]
    expected = oracle.regular(peaks, lambda k: (15, 40) if norm[k] <= run_g else (10, 25), bout)
    assert steps_at(params, norm) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("height", "counted"), [(1.19, False), (1.2, True), (1.5, True), (2.0, True), (2.01, True), (6.0, True)]
)
def test_idle_below_walking_height_and_no_ceiling_above_running(height, counted):
    assert bool(steps_at(EVERY_PEAK, spikes(80, {40: height}))) is counted


@pytest.mark.parametrize(
    ("height", "spacing", "counted"),
    [
        (1.5, 14, False),
        (1.5, 15, True),
        (1.5, 40, True),
        (1.5, 41, False),
        (2.0, 14, False),
        (2.5, 14, True),
        (2.5, 25, True),
        (2.5, 26, False),
    ],
)
def test_each_gait_has_its_own_times(height, spacing, counted):
    assert steps_at(PAPER, spikes(120, {30: height, 30 + spacing: height})) == ([30 + spacing] if counted else [])


@pytest.mark.parametrize(("shortest_s", "counted"), [(0.20, True), (0.22, False)])
def test_running_steps_may_not_come_sooner_than_their_shortest_time(shortest_s, counted):
    params = replace(PAPER, run_shortest_s=shortest_s)
    x = spikes(120, {30: 2.5, 40: 2.4})  # the second stands alone in the ten samples after it and the nine before
    assert steps_at(params, x) == ([40] if counted else [])


@pytest.mark.parametrize(("distance", "both"), [(10, False), (11, True)])
def test_a_walking_peak_is_the_greatest_of_ten_on_either_side(distance, both):
    x = spikes(120, {50: 1.5, 50 + distance: 1.6})
    params = replace(EVERY_PEAK, walk_shortest_s=0.1)
    assert steps_at(params, x) == ([50, 50 + distance] if both else [50 + distance])


@pytest.mark.parametrize(("distance", "both"), [(5, False), (6, True)])
def test_a_running_peak_is_the_greatest_of_five_on_either_side(distance, both):
    x = spikes(120, {50: 2.5, 50 + distance: 2.6})
    params = replace(EVERY_PEAK, run_shortest_s=0.1)
    assert steps_at(params, x) == ([50, 50 + distance] if both else [50 + distance])


@pytest.mark.parametrize(("after", "counted"), [(14, False), (15, True)])
def test_a_candidate_is_the_greatest_of_twenty_samples(after, counted):
    x = spikes(120, {44: 2.6, 50: 2.5, 50 + after: 2.6})  # five lower ones before it, after − 1 behind it
    assert (50 in steps_at(replace(EVERY_PEAK, run_shortest_s=0.1), x)) is counted


def test_a_bump_on_the_way_up_does_not_hide_the_crest():
    gait = {30 + 25 * i: 1.6 for i in range(4)} | {26 + 25 * i: 1.3 for i in range(4)}
    assert steps_at(PAPER, spikes(160, gait)) == [55, 80, 105]


def test_two_peaks_in_a_row_are_one_step_and_a_pause_begins_anew():
    x = spikes(260, {30: 1.5, 55: 1.5, 80: 1.5, 180: 1.5, 205: 1.5})
    steps = collect(build(PAPER), [block_of(x)], finish=True).steps
    assert [round(step.at_s * GRID_HZ) for step in steps] == [55, 80, 205]
    assert [step.interval_s for step in steps] == [None, pytest.approx(0.5), None]
    credited = collect(build(replace(PAPER, credit="retrospective")), [block_of(x)], finish=True).steps
    assert [round(step.at_s * GRID_HZ) for step in credited] == [30, 55, 80, 180, 205]


@pytest.mark.parametrize(("peaks", "counted"), [(4, 0), (5, 5), (12, 12)])
def test_a_bout_shorter_than_five_is_dropped_a_longer_one_counts_whole(peaks, counted):
    x = np.concatenate([np.ones(50), 1.0 + 0.4 * np.sin(np.arange(25 * peaks) * 2 * np.pi / 25), np.ones(90)])
    assert len(steps_at(TUNED, x)) == counted


def test_a_peak_too_near_changes_nothing():
    params = replace(PAPER, walk_half=5, window=11)
    assert steps_at(params, spikes(120, {30: 1.5, 42: 1.5, 55: 1.5})) == [55]


@pytest.mark.parametrize("distance", [8, 10])
def test_of_equal_peaks_the_first_counts(distance):
    x = spikes(120, {50: 1.5, 50 + distance: 1.5})
    assert steps_at(replace(EVERY_PEAK, walk_shortest_s=0.1), x) == [50]


def test_a_flat_crest_counts_at_its_first_sample_unless_it_is_longer_than_its_window():
    def crest(length):
        x = spikes(120, {30: 1.5})
        x[30 : 30 + length] = 1.5
        return steps_at(EVERY_PEAK, x)

    assert crest(1) == crest(2) == crest(10) == [30]
    assert crest(12) == []


@pytest.mark.parametrize(("at", "counted"), [(9, False), (10, True), (69, True), (70, False)])
def test_a_window_lies_inside_its_stretch(at, counted):
    assert bool(steps_at(EVERY_PEAK, spikes(80, {at: 1.5}))) is counted


def test_a_step_carries_what_decided_it():
    x = spikes(120, {30: 1.5, 55: 1.7, 75: 2.5})
    x[50], x[70] = 0.4, 0.3
    walking, running = collect(build(PAPER), [block_of(x)], finish=True).steps
    assert (walking.peak, walking.valley, walking.upper, walking.lower) == (1.7, 0.4, 1.2, None)
    assert (running.peak, running.valley, running.upper) == (2.5, 0.3, 2.0)
    assert walking.strength == pytest.approx(1.3)


@pytest.mark.parametrize(("height", "half"), [(1.5, 10), (2.5, 5)])
def test_the_valley_is_the_lowest_of_the_neighbourhood(height, half):
    for dip, inside in ((-half - 1, False), (-half, True), (half, True), (half + 1, False)):
        x = spikes(120, {50: height})
        x[50 + dip] = 0.2
        (step,) = collect(build(EVERY_PEAK), [block_of(x)], finish=True).steps
        assert (step.valley == 0.2) is inside


@pytest.mark.parametrize("smoothing", [1, 2, 3, 4, 5])
def test_smoothing_is_a_mean_with_its_delay_taken_off(smoothing):
    impulse = [1.0] * 60
    impulse[30] = 61.0
    counter = build(replace(EVERY_PEAK, smoothing=smoothing))
    update = counter.update(block_of(impulse, start=100))
    held = [1.0 + 60.0 / smoothing] * smoothing
    assert update.trace == pytest.approx([1.0] * 30 + held + [1.0] * (30 - smoothing))
    assert update.trace_from_s == pytest.approx((100 - (smoothing - 1) / 2) / GRID_HZ)


@pytest.mark.parametrize(("gap", "goes_on"), [(40, True), (90, True), (160, False)])
def test_a_certain_bout_goes_on_over_a_short_gap(gap, goes_on):
    counter = build(TUNED)
    signal = Signal(walk(600, 2.0, 0.5))
    counter.update(signal.block())
    after = collect(counter, [signal.block(0, 75, offset=600 + gap)], finish=True).steps
    assert bool(after) is goes_on
    assert not after or after[0].interval_s is None


def test_an_uncertain_bout_ends_with_a_gap():
    counter = build(TUNED)
    signal = Signal(walk(600, 2.0, 0.5))
    assert counter.update(signal.block(0, 90)).pending == 3
    assert collect(counter, [signal.block(0, 120, offset=130)], finish=True).steps == []


def test_a_bout_ends_with_the_stream():
    counter = build(TUNED)
    signal = Signal(walk(600, 2.0, 0.5))
    assert collect(counter, [signal.block()], finish=True).steps
    assert collect(counter, [signal.block(0, 90, offset=600)], finish=True).steps == []


def test_a_peak_is_called_likely_once_it_falls_and_taken_back_when_another_tops_it():
    counter = build(replace(PAPER, walk_half=10))
    x = spikes(120, {30: 1.5, 55: 1.5, 61: 1.6})
    updates = [counter.update(block_of(x[k : k + 1], start=k)) for k in range(len(x))]
    told = {k: [round(at_s * GRID_HZ) for at_s, *_ in update.likely] for k, update in enumerate(updates)}
    assert told[31] == told[39] == told[55] == []  # the first of a bout is but a reference
    assert told[56] == [55]
    assert told[62] == [61]
    assert told[71] == []
    assert [round(step.at_s * GRID_HZ) for step in updates[71].steps] == [61]
    assert [update.pending for update in updates] == [len(names) for names in told.values()]


def test_a_peak_too_near_one_just_counted_is_likely_no_more():
    counter = build(EVERY_PEAK)
    x = spikes(120, {20: 2.6, 32: 2.5, 38: 2.4})  # the second waits for eight samples, the third for fourteen
    likely = [counter.update(block_of(x[k : k + 1], start=k)).likely for k in range(len(x))]
    told = [[round(at_s * GRID_HZ) for at_s, *_ in names] for names in likely]
    assert told[39] == [32, 38]
    assert told[40] == []


def test_held_peaks_are_likely_until_their_bout_is_certain_or_over():
    counter = build(TUNED)
    x = np.concatenate([np.ones(50), 1.0 + 0.4 * np.sin(np.arange(100) * 2 * np.pi / 25), np.ones(120)])
    pending = [counter.update(block_of(x[k : k + 1], start=k)).pending for k in range(len(x))]
    assert max(pending) == 4
    assert pending[-1] == 0
    assert pending[45] == 0


def test_latency_is_the_sum_of_its_waits():
    assert build(PAPER).latency_s == pytest.approx(14 / GRID_HZ)
    assert build(TUNED).latency_s == pytest.approx((2 + 14 + 4 * 50) / GRID_HZ)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    window=st.integers(11, 32),
    walk_half=st.integers(2, 20),
    run_half=st.integers(2, 10),
    smoothing=st.integers(1, 5),
)
def test_noise_never_overflows_the_queue_or_the_rows(seed, window, walk_half, run_half, smoothing):
    params = AdaptivePeakParams(
        window=window, walk_half=walk_half, run_half=run_half, smoothing=smoothing, walk_g=0.0, run_g=1.0, bout=12
    )
    counter = build(replace(params, credit="retrospective"))
    rng = np.random.default_rng(seed)
    x = 1.0 + rng.standard_normal(1500) * 0.3 - 0.01 * np.arange(1500) % 3
    room = len(counter._state)
    for k in range(0, len(x), 50):
        counter.update(block_of(x[k : k + 50], start=k))
        assert counter._state[kernel.COUNT] < kernel.QUEUE_MAX
    assert len(counter._state) == room == kernel.STATE


def test_a_falling_staircase_fills_the_queue_no_further_than_it_holds():
    counter = build(AdaptivePeakParams(window=32, walk_half=2, walk_g=0.0, run_g=16.0))
    x = 9.0 - 0.005 * np.arange(1000) + np.tile([0.0, 0.1, 0.0], 334)[:1000]
    worst = 0.0
    for k in range(0, 1000, 10):
        counter.update(block_of(x[k : k + 10], start=k))
        worst = max(worst, counter._state[kernel.COUNT])
    assert 5 < worst < kernel.QUEUE_MAX


def test_a_sample_that_is_no_number_harms_only_its_neighbourhood():
    signal = walk(900, 2.0, 0.5)
    signal[400, 2] = np.nan
    steps = steps_at(TUNED, signal[:, 2])
    clean = steps_at(TUNED, walk(900, 2.0, 0.5)[:, 2])
    assert [at for at in steps if at < 380] == [at for at in clean if at < 380]
    assert [at for at in steps if at > 450] == [at for at in clean if at > 450]


def test_an_empty_block_and_one_sample_say_nothing():
    assert build(TUNED).update(block_of([])) == Update()
    assert build(TUNED).update(block_of([1.0])).steps == ()


@pytest.mark.parametrize(("name", "value"), [("smoothing", 6), ("window", 33), ("walk_half", 21), ("credit", "maybe")])
def test_parameters_are_checked(name, value):
    with pytest.raises(ParameterError):
        with_overrides(PAPER, {name: value})
