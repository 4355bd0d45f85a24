"""The autocorrelation counter against its text: an oracle, and each rule by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from counters import conformance
from counters.conformance import Signal, collect, cut_signals, signals, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import autocorrelation_kernel as kernel
from service.counters.autocorrelation import GRAVITY_M_S2, PAPER, STRIDE, TUNED, build
from service.counters.streaming import COMPILED_FROM
from service.errors import ParameterError
from service.samples import GRID_HZ, SampleBlock, Update

few = settings(max_examples=60, deadline=None)


def block_of(norm, start=0):
    """A block whose Z axis alone carries the norm."""
    zeros = [0.0] * len(norm)
    return SampleBlock(start=start, acc_g=(zeros, zeros, [float(v) for v in norm]))


def steps_of(params, norm):
    """In pieces short enough to go through plain Python: numba would take seconds to compile."""
    blocks = [block_of(norm[first : first + 1000], start=first) for first in range(0, len(norm), 1000)]
    return collect(build(params), blocks, finish=True).steps


def indices(steps):
    return [round(step.at_s * GRID_HZ) for step in steps]


def even(samples, spacing, swing_g=0.5):
    """A walk of one crest each `spacing` samples, the first after a quarter of it."""
    return 1.0 + swing_g * np.sin(2 * np.pi * np.arange(samples) / spacing)


def swinging(samples, spacing, step_g=0.15, arm_g=0.5):
    """A walk on an arm that swings once in two steps."""
    n = np.arange(samples)
    return 1.0 + step_g * np.sin(2 * np.pi * n / spacing) + arm_g * np.sin(np.pi * n / spacing)


def likest(x, k, lags, rho_min):
    """(1), (2): the lag whose correlation is largest among those that exceed `rho_min`, else None."""
    best, lag = rho_min, None
    for t in lags:
        now, before = x[k - t + 1 : k + 1], x[k - 2 * t + 1 : k - t + 1]
        if now.std() > 1e-6 and before.std() > 1e-6 and np.corrcoef(now, before)[0, 1] > best:
            best, lag = np.corrcoef(now, before)[0, 1], t
    return lag


def crests(x, k, t, p, expected):
    """The highest sample of each part of a period of `t` samples that ends at `k`, or before it where not expected."""
    n = 2 if p.period == "stride" else 1
    half, wide, last = t // (2 * n), t // (2 * n) // 2, k - t // (2 * n)
    if not expected:
        last += 1 - t // n + int(np.argmax(x[last - t // n + 1 : last + 1]))
    back = 2 * n if p.credit == "retrospective" and not expected else n
    centres = [last - j * t // n for j in reversed(range(back))]
    return [c - wide + int(np.argmax(x[c - wide : c + wide + 1])) for c in centres if c >= wide], half


def oracle(x, p):
    """Every crest the text counts over one stretch, before bouts are asked for: no ring, no running sums."""
    steps = 2 if p.period == "stride" else 1
    found, period, expected, k = [], None, False, 2 * p.t_min - 1
    while k < len(x):
        if period and k - found[-1] > p.patience:
            period = None
        low, high = (max(p.t_min, period - p.lock), min(p.t_max, period + p.lock)) if period else (p.t_min, p.t_max)
        high = min(high, (k + 1) // 2)
        window = x[max(k + 1 - (period or p.t_max), 0) : k + 1]
        moving = high >= low and window.std() >= p.idle / GRAVITY_M_S2
        t = likest(x, k, range(low, high + 1), p.rho_min) if moving else None
        if t is None:
            expected, k = False, k + p.hop
            continue
        period, (at, half) = t, crests(x, k, t, p, expected)
        for one in at:
            if not found or one - found[-1] >= 0.6 * t / steps:
                found.append(one)
        expected, k = True, max(at[-1] + half + t, k + 1)
    return found


@few
@given(
    signal=signals(),
    period=st.sampled_from(["step", "stride"]),
    lags=st.tuples(st.integers(10, 40), st.integers(20, 60)).filter(lambda two: two[0] <= two[1]),
    lock=st.sampled_from([2, 10, 150]),
    idle=st.sampled_from([0.1, 0.5, 1.5]),
    rho_min=st.sampled_from([0.3, 0.7]),
    hop=st.integers(1, 12),
    patience=st.integers(50, 120),
    credit=st.sampled_from(["never", "retrospective"]),
)
def test_agrees_with_the_text(signal, period, lags, lock, idle, rho_min, hop, patience, credit):
    if period == "stride":
        lags = (lags[0] + 20, lags[1] + 20)
    params = replace(
        PAPER,
        period=period,
        t_min=lags[0],
        t_max=lags[1],
        lock=lock,
        idle=idle,
        rho_min=rho_min,
        hop=hop,
        patience=max(patience, lags[1]),
        credit=credit,
    )
    uneven = 1e-4 * np.random.default_rng(7).standard_normal(len(signal))  # two lags are never equally good
    norm = np.sqrt((signal.values[:, :3] ** 2).sum(axis=1)) + uneven
    assert indices(steps_of(params, np.abs(norm))) == oracle(np.abs(norm), params)


@pytest.mark.full
@few
@given(cut=cut_signals(), params=st.sampled_from([STRIDE, replace(STRIDE, credit="retrospective", bout=7)]))
def test_strides_keep_the_contract(cut, params):
    conformance.check_cutting(lambda: build(params), *cut)
    conformance.check_steps(lambda: build(params), cut[0])
    conformance.check_latency(lambda: build(params), cut[0])


def test_the_trace_is_the_norm_without_delay():
    update = build(PAPER).update(SampleBlock(start=40, acc_g=([3.0, 0.0], [12.0, 0.0], [4.0, -1.0])))
    assert list(update.trace) == [13.0, 1.0]
    assert update.trace_from_s == 40 / GRID_HZ


@pytest.mark.parametrize("params", [PAPER, TUNED])
@pytest.mark.parametrize("spacing", [17, 25, 31, 45])
def test_steps_are_the_crests_of_an_even_walk(params, spacing):
    steps = steps_of(params, even(30 * spacing, spacing))
    for step in steps:
        off = (step.at_s * GRID_HZ - spacing / 4 + spacing / 2) % spacing - spacing / 2
        assert abs(off) <= 0.75
        assert step.peak == pytest.approx(1.5, abs=0.02)
        assert step.valley == pytest.approx(0.5, abs=0.06)
        assert step.strength == step.peak - step.valley
        assert step.upper is step.lower is None
    assert [step.interval_s for step in steps] == [None] + [pytest.approx(spacing / GRID_HZ)] * (len(steps) - 1)
    assert len(steps) >= 27


@pytest.mark.parametrize("idle", [0.5, 1.2])
def test_a_swing_under_the_idle_deviation_is_none(idle):
    amplitude_g = math.sqrt(2) * idle / GRAVITY_M_S2
    params = replace(PAPER, t_min=25, t_max=25, idle=idle)
    assert steps_of(params, even(500, 25, 0.98 * amplitude_g)) == []
    assert len(steps_of(params, even(500, 25, 1.02 * amplitude_g))) >= 17


def test_a_period_must_correlate_better_than_rho_min():
    rng = np.random.default_rng(3)
    noisy = 3.0 + 0.2 * (np.tile(rng.standard_normal(30), 40) + rng.standard_normal(1200))  # ρ = 0.5 on average
    params = replace(PAPER, t_min=30, t_max=30, lock=1)
    counts = [len(steps_of(replace(params, rho_min=rho_min), noisy)) for rho_min in (0.2, 0.6, 0.9)]
    assert counts[0] == pytest.approx(38, abs=1)
    assert 10 <= counts[1] <= 34
    assert counts[2] == 0


def test_noise_is_no_walk():
    noise = 1.0 + 0.2 * np.random.default_rng(5).standard_normal(6000)
    assert len(steps_of(PAPER, noise)) < 12
    assert steps_of(TUNED, noise) == []


def test_a_stride_is_two_steps_where_only_strides_repeat():
    norm = swinging(1500, 24)
    assert len(steps_of(STRIDE, norm)) == pytest.approx(60, abs=3)
    assert len(steps_of(PAPER, norm)) == pytest.approx(32, abs=2)


@pytest.mark.parametrize("spacing", [22, 26, 31])
def test_the_slopes_of_an_arm_swing_are_no_steps_of_their_own(spacing):
    assert len(steps_of(TUNED, swinging(60 * spacing, spacing))) <= 62


def test_a_running_stride_shorter_than_forty_samples_counts_half_as_the_paper_found():
    assert len(steps_of(STRIDE, swinging(3400, 17))) == pytest.approx(100, abs=3)
    assert len(steps_of(replace(STRIDE, t_min=30), swinging(3400, 17))) == pytest.approx(200, abs=3)


def test_a_locked_period_follows_a_drift():
    spacing = np.linspace(20, 40, 1500)
    drifting = 1.0 + 0.5 * np.sin(2 * np.pi * np.cumsum(1.0 / spacing))
    assert len(steps_of(TUNED, drifting)) == pytest.approx(np.sum(1.0 / spacing), abs=2)


def test_a_locked_period_does_not_jump_to_the_stride():
    norm = np.concatenate([even(500, 20), swinging(1000, 20, step_g=0.5, arm_g=0.19)])  # ρ is 0.75 at 20, 1 at 40
    assert len(steps_of(replace(PAPER, lock=3), norm)) == pytest.approx(75, abs=2)
    assert len(steps_of(PAPER, norm)) == pytest.approx(50, abs=4)


def test_a_new_tempo_beyond_the_lock_is_found_when_patience_ends():
    jump = np.concatenate([even(500, 20), even(400, 40)])
    intervals = [b - a for a, b in pairwise(indices(steps_of(TUNED, jump)))]
    assert intervals[:20] == [20] * 20
    assert intervals[-4:] == [40] * 4


def test_retrospective_credit_adds_the_period_before_and_the_steps_before_a_bout_is_certain():
    crests_at = [25 * i + 6 for i in range(24)]
    counted = {
        (bout, credit): indices(steps_of(replace(TUNED, bout=bout, credit=credit), even(600, 25)))
        for bout in (1, 6)
        for credit in ("never", "retrospective")
    }
    assert counted[1, "retrospective"] == counted[6, "retrospective"] == crests_at
    assert counted[1, "never"] == crests_at[1:]
    assert counted[6, "never"] == crests_at[6:]


@pytest.mark.parametrize(("crests_walked", "counted"), [(4, 0), (9, 9)])
def test_a_bout_shorter_than_six_is_dropped_a_longer_one_counts_whole(crests_walked, counted):
    norm = np.concatenate([np.ones(150), even(25 * crests_walked, 25), np.ones(200)])
    assert len(steps_of(TUNED, norm)) == pytest.approx(counted, abs=1 if counted else 0)


def test_patience_ends_a_bout():
    def walks(pause):
        return np.concatenate([np.ones(100), even(500, 25), np.ones(pause), even(500, 25), np.ones(100)])

    for params in (PAPER, TUNED):
        starts = [sum(step.interval_s is None for step in steps_of(params, walks(pause))) for pause in (25, 400)]
        assert starts == [1, 2]


def test_a_long_rest_leaves_only_its_own_length_to_the_next_search():
    norm = np.concatenate([even(500, 20), np.ones(400), even(500, 40)])
    late = [at for at in indices(steps_of(TUNED, norm)) if at >= 900]
    assert len(late) >= 11
    assert {b - a for a, b in pairwise(late)} == {40}


@pytest.mark.parametrize(("gap", "starts", "unknown"), [(60, 1, 2), (200, 2, 1)])
def test_a_certain_bout_goes_on_over_a_short_gap(gap, starts, unknown):
    norm = even(500, 25)
    counter = build(TUNED)
    steps = list(counter.update(block_of(norm)).steps)
    fresh = counter.update(block_of(norm[:120], start=500 + gap)).steps
    steps += fresh + counter.finish().steps
    assert sum(step.interval_s is None for step in steps) == unknown
    # A bout that goes on needs no second proof: fewer than six crests after the gap are steps at once.
    assert bool(fresh) is (starts == 1)
    assert all(step.at_s >= (500 + gap) / GRID_HZ for step in fresh)


def test_an_uncertain_bout_ends_with_a_gap():
    counter = build(TUNED)
    assert counter.update(block_of(even(110, 25))).pending > 0
    after = counter.update(block_of(even(110, 25), start=150))
    assert after.steps == ()
    assert after.pending <= 5


def test_likely_steps_are_named_before_they_are_certain_and_keep_their_time():
    counter = build(TUNED)
    norm = np.concatenate([even(400, 25), np.ones(200)])
    named: set[float] = set()
    steps = []
    for k, value in enumerate(norm):
        update = counter.update(block_of([value], start=k))
        assert update.pending == sum(passes for _, _, passes in update.likely)
        for at_s, strength, _ in update.likely:
            assert strength >= 0.0
            if at_s not in named and len(steps) > 6:
                assert k / GRID_HZ - at_s <= 0.25
            named.add(at_s)
        steps += update.steps
    assert len(steps) >= 14
    assert {step.at_s for step in steps} <= named
    assert len(named) <= len(steps) + 1
    assert counter.update(block_of([1.0], start=len(norm))).likely == ()


def test_nothing_is_likely_that_could_not_count():
    counter = build(replace(PAPER, bout=4))
    for k in range(0, 120, 5):
        update = counter.update(block_of(even(k + 5, 25)[k:], start=k))
        assert update.pending <= 1
        assert update.pending == 0 or k + 5 > 93  # the third crest, at 81, is certain only then


def test_a_period_cut_short_is_no_step_and_finish_forgets():
    counter = build(TUNED)
    counter.update(block_of(even(400, 25)))
    assert counter.finish() == Update()
    slower = block_of(even(400, 40))
    assert counter.update(slower).steps == build(TUNED).update(slower).steps != ()


def test_after_a_long_gap_all_is_as_at_the_start():
    counter = build(PAPER)
    counter.update(block_of(even(512, 25)))
    for n in range(60):
        after = counter.update(block_of([even(400, 25)[n]], start=800 + n))
        assert after.pending == 0 or n > 50
    after = counter.update(block_of(even(400, 25)[60:], start=860))
    fresh = build(PAPER).update(block_of(even(400, 25), start=800))
    assert indices(after.steps) == indices(fresh.steps)[-len(after.steps) :]
    assert len(fresh.steps) - len(after.steps) <= 1


def test_a_recording_shorter_than_a_step_has_none():
    for n in (1, 5, 2 * TUNED.t_min - 1):
        assert steps_of(TUNED, even(n, 20)) == []


def test_a_nan_costs_the_periods_that_hold_it_and_no_more():
    norm = even(1500, 25)
    whole = indices(steps_of(TUNED, norm))
    crest = whole[30]
    norm[crest] = math.nan
    steps = steps_of(TUNED, norm)
    assert all(math.isfinite(step.strength) for step in steps)
    assert all(abs(at - crest) <= 2.5 * TUNED.t_max for at in set(whole) - set(indices(steps)))
    assert crest not in indices(steps)
    assert len(steps) >= len(whole) - 5


def test_a_clipped_walk_is_counted_all_the_same():
    norm = np.minimum(even(1000, 20, 1.5), 2.0)
    assert len(steps_of(TUNED, norm)) == pytest.approx(50, abs=2)


def test_a_sensor_without_gravity_or_with_a_large_offset_counts_the_same():
    norm = even(1000, 23.7, 0.4)
    assert indices(steps_of(PAPER, norm + 7.0)) == indices(steps_of(PAPER, norm))


@pytest.mark.full  # numba takes seconds to compile the kernel
def test_count_gives_what_update_and_finish_give():
    signal = Signal(walk(COMPILED_FROM + 900, 1.9, 0.4))
    counter = build(TUNED)
    rows = counter.count(signal.block(arrays=True))
    assert rows.shape[1] == kernel.ROW
    assert counter.read(rows) == tuple(collect(build(TUNED), [signal.block()], finish=True).steps)


def test_no_lag_between_t_min_and_t_max_is_refused():
    with pytest.raises(ParameterError, match="t_max"):
        build(replace(PAPER, t_min=40, t_max=39))
    assert build(replace(PAPER, t_min=40, t_max=40)).name == "autocorrelation"


def test_latency_counts_what_each_choice_waits_for():
    assert build(PAPER).latency_s == 1.75 * 50 / GRID_HZ
    assert build(replace(PAPER, bout=5)).latency_s == build(PAPER).latency_s
    assert build(TUNED).latency_s == (2.75 * 46 + 5 * 75) / GRID_HZ
