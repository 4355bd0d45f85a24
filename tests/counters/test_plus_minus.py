"""The plus-minus score against its text: an oracle, and each rule by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from counters import windowed_peak_oracle as oracle
from counters.conformance import Signal, collect, signals, walk
from counters.test_adaptive_peak import block_of
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import windowed_peak_kernel as kernel
from service.counters.contract import with_overrides
from service.counters.plus_minus import PAPER, TUNED, build
from service.errors import ParameterError
from service.samples import GRID_HZ


def steps_at(params, norm):
    steps = collect(build(params), [block_of(norm)], finish=True).steps
    return [round(step.at_s * GRID_HZ, 1) for step in steps]


def tent(samples, at, rises, falls):
    """Flat but for `rises` samples up to `at` and `falls` down after it; a flat pair scores −1."""
    x = np.ones(samples)
    x[at - rises : at + 1] = 1.0 + 0.01 * np.arange(rises + 1)
    x[at : at + falls + 1] = x[at] - 0.01 * np.arange(falls + 1)
    x[at + falls :] = x[at + falls]
    return x


@settings(max_examples=60, deadline=None)
@given(
    signal=signals(),
    half=st.integers(3, 20),
    score_over=st.integers(-6, 20),
    smoothing=st.integers(1, 5),
    bout=st.integers(1, 5),
)
def test_agrees_with_the_text(signal, half, score_over, smoothing, bout):
    score_over = min(score_over, 2 * half - 1)
    params = replace(PAPER, half=half, score_over=score_over, smoothing=smoothing, bout=bout)
    norm = np.sqrt(np.sum(signal.values[:, :3] ** 2, axis=1)) + 1e-9 * (np.arange(len(signal)) * 7919 % 10007)
    x = oracle.smooth(norm, smoothing)
    inside = [k for k in oracle.tops(x) if half <= k < len(x) - half]
    peaks = [k for k in inside if oracle.score(x, k, half) > score_over]
    delay = (smoothing - 1) / 2
    expected = [k - delay for k in oracle.regular(peaks, lambda _: (17, 50), bout)]
    assert steps_at(params, norm) == pytest.approx(expected)


@pytest.mark.parametrize(("rises", "falls", "points"), [(8, 8, 16), (8, 3, 6), (3, 8, 6), (1, 8, 2), (5, 5, 4)])
def test_a_pair_towards_the_peak_gains_a_point_and_any_other_loses_one(rises, falls, points):
    x = tent(60, 30, rises, falls)
    assert steps_at(replace(PAPER, score_over=points - 1), x) == [30]
    if points < 16:  # the most there can be
        assert steps_at(replace(PAPER, score_over=points), x) == []


def test_amplitude_does_not_matter_until_rest_is_set():
    faint = 1.0 + 1e-3 * (tent(60, 30, 8, 8) - 1.0)
    assert steps_at(PAPER, faint) == [30]
    drop_g = 0.08
    assert steps_at(replace(PAPER, rest_g=drop_g * 0.99), tent(60, 30, 8, 8)) == [30]
    assert steps_at(replace(PAPER, rest_g=drop_g * 1.01), tent(60, 30, 8, 8)) == []


def test_the_next_window_begins_where_the_last_one_ended():
    signal = Signal(walk(500, 4.0, 0.3))
    spacing = np.diff(steps_at(replace(PAPER, half=5), signal.values[:, 2]))
    assert set(spacing) <= {25.0}  # every second crest: 12.5 samples are too near
    nearer = np.diff(steps_at(replace(PAPER, half=5, shortest_s=0.22), signal.values[:, 2]))
    assert set(nearer) <= {12.0, 13.0}


@pytest.mark.parametrize(("half", "found"), [(6, True), (20, False)])
def test_a_fixed_window_fails_where_cadence_does_not_fit_it(half, found):
    fast = walk(800, 2.9, 0.5)[:, 2]
    assert (len(steps_at(replace(PAPER, half=half), fast)) > 40) is found


def test_noise_at_rest_has_steps_in_the_paper_and_none_in_tuned():
    noise = 1.0 + 0.01 * np.random.default_rng(4).standard_normal(3000)
    assert len(steps_at(PAPER, noise)) > 20
    assert steps_at(TUNED, noise) == []


def test_every_window_counts_in_the_paper_and_bouts_of_six_in_tuned():
    def rises(peaks):
        crests = 1.0 + 0.4 * np.sin(np.arange(25 * peaks) * 2 * np.pi / 25)
        return np.concatenate([np.ones(50), crests, np.ones(90)])

    assert [len(steps_at(PAPER, rises(n))) for n in (1, 5, 6)] == [1, 5, 6]
    assert [len(steps_at(TUNED, rises(n))) for n in (1, 5, 6)] == [0, 0, 6]


@pytest.mark.parametrize(("at", "counted"), [(7, False), (8, True), (51, True), (52, False)])
def test_a_window_lies_inside_its_stretch(at, counted):
    x = np.array([1.0 - 0.01 * abs(k - at) for k in range(60)])
    assert bool(steps_at(PAPER, x)) is counted


def test_a_step_has_a_valley_but_no_threshold():
    (step,) = collect(build(PAPER), [block_of(tent(60, 30, 8, 5))], finish=True).steps
    assert (step.upper, step.lower, step.interval_s) == (None, None, None)
    assert step.peak == pytest.approx(1.08)
    assert step.valley == pytest.approx(1.0)
    assert step.strength == pytest.approx(0.08)


def test_intervals_end_with_a_bout():
    signal = np.concatenate([walk(200, 2.0, 0.3)[:, 2], np.ones(120), walk(100, 2.0, 0.3)[:, 2]])
    intervals = [step.interval_s for step in collect(build(PAPER), [block_of(signal)], finish=True).steps]
    nulls = [index for index, value in enumerate(intervals) if value is None]
    assert nulls == [0, 7]  # the first crest lies nearer to the start than a window


def test_latency_is_the_sum_of_its_waits():
    assert build(PAPER).latency_s == pytest.approx(8 / GRID_HZ)
    assert build(TUNED).latency_s == pytest.approx((2 + 11 + 5 * 55) / GRID_HZ)


def test_a_zigzag_fills_the_queue_no_further_than_it_holds():
    counter = build(replace(PAPER, half=20))
    worst = 0.0
    for k in range(0, 600, 5):
        counter.update(block_of([1.0 + 0.1 * (i % 2) for i in range(k, k + 5)], start=k))
        worst = max(worst, counter._state[kernel.COUNT])
    assert 9 <= worst < kernel.QUEUE_MAX


@pytest.mark.parametrize(("name", "value"), [("half", 21), ("score_over", 4.5), ("rest_g", -1), ("window", 20)])
def test_parameters_are_checked(name, value):
    with pytest.raises(ParameterError):
        with_overrides(PAPER, {name: value})
