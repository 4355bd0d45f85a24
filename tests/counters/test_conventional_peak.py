"""Conventional peak detection: what it does otherwise than the adaptive one, and an oracle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from counters import windowed_peak_oracle as oracle
from counters.conformance import collect, signals
from counters.test_adaptive_peak import block_of, spikes
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import adaptive_peak
from service.counters.contract import with_overrides
from service.counters.conventional_peak import PAPER, TUNED, build
from service.errors import ParameterError
from service.samples import GRID_HZ

EVERY_PEAK = replace(PAPER, bout=1)


def steps_at(params, norm):
    steps = collect(build(params), [block_of(norm)], finish=True).steps
    return [round(step.at_s * GRID_HZ, 1) for step in steps]


@settings(max_examples=60, deadline=None)
@given(
    signal=signals(),
    window=st.integers(11, 32),
    half=st.integers(2, 20),
    least_g=st.sampled_from([0.9, 1.05, 1.2]),
    most_g=st.sampled_from([1.21, 1.5, 3.0]),
    smoothing=st.integers(1, 5),
    bout=st.integers(1, 5),
)
def test_agrees_with_the_text(signal, window, half, least_g, most_g, smoothing, bout):
    params = replace(PAPER, window=window, half=half, least_g=least_g, most_g=most_g, smoothing=smoothing, bout=bout)
    norm = np.sqrt(np.sum(signal.values[:, :3] ** 2, axis=1)) + 1e-9 * (np.arange(len(signal)) * 7919 % 10007)
    x = oracle.smooth(norm, smoothing)
    peaks = [
        k
        for k in oracle.tops(x)
        if least_g <= x[k] <= most_g
        and oracle.greatest_of_a_window(x, k, window)
        and oracle.greatest_beside(x, k, half)
    ]
    delay = (smoothing - 1) / 2
    expected = [k - delay for k in oracle.regular(peaks, lambda _: (20, 50), bout)]
    assert steps_at(params, norm) == pytest.approx(expected)


@pytest.mark.parametrize(("height", "counted"), [(1.19, False), (1.2, True), (3.0, True), (3.01, False)])
def test_heights_are_from_1_2_to_3_g(height, counted):
    assert bool(steps_at(EVERY_PEAK, spikes(80, {40: height}))) is counted


def test_a_peak_above_the_ceiling_still_overshadows_its_neighbourhood():
    assert steps_at(EVERY_PEAK, spikes(120, {50: 2.0, 58: 3.5})) == []
    assert steps_at(EVERY_PEAK, spikes(120, {50: 2.0, 62: 3.5})) == [50]


@pytest.mark.parametrize(("spacing", "counted"), [(19, False), (20, True), (50, True), (51, False)])
def test_times_are_from_0_4_to_1_s(spacing, counted):
    assert steps_at(PAPER, spikes(120, {30: 1.5, 30 + spacing: 1.5})) == ([30 + spacing] if counted else [])


def test_running_has_the_same_neighbourhood_and_times_as_walking():
    fast = spikes(400, {30 + 16 * i: 2.5 for i in range(20)})
    assert len(steps_at(PAPER, fast)) == 9  # every second one, as the paper's 70 % when running hints at
    assert len(collect(adaptive_peak.build(adaptive_peak.PAPER), [block_of(fast)], finish=True).steps) == 19


def test_steps_carry_the_least_height_as_threshold():
    (step,) = collect(build(PAPER), [block_of(spikes(120, {30: 1.5, 60: 2.5}))], finish=True).steps
    assert (step.peak, step.upper) == (2.5, 1.2)


def test_latency_is_the_sum_of_its_waits():
    assert build(PAPER).latency_s == pytest.approx(10 / GRID_HZ)
    assert build(TUNED).latency_s == pytest.approx((1 + 11 + 4 * 50) / GRID_HZ)


@pytest.mark.parametrize(("name", "value"), [("half", 1), ("most_g", 17), ("longest_s", 4), ("run_g", 2)])
def test_parameters_are_checked(name, value):
    with pytest.raises(ParameterError):
        with_overrides(PAPER, {name: value})
