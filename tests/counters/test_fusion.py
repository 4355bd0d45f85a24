"""The fusion counter against its text: an oracle for its time filter, and each rule by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from counters import fusion_oracle
from counters.conformance import Signal, collect, signals
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from service.counters import fusion_checks as checks
from service.counters import fusion_kernel as kernel
from service.counters import registry
from service.counters.contract import with_overrides
from service.counters.fusion import PAPER, TUNED, build, cutoffs_hz, first_cadence_hz, step_rows
from service.errors import CounterError, ParameterError
from service.samples import GRID_HZ, SampleBlock, Sensor

few = settings(max_examples=60, deadline=None)

FREE = replace(PAPER, distance_share=-1.0, suspect_share=-1.0)
"""Every pair is a step."""

STRICT = replace(FREE, suspect_share=9.0, first_suspects="fail", swing_rad_s=0.5)
"""Every pair is a step unless it is suspect."""

AT, SPACING, PEAK, VALLEY, CROSSING, DISTANCE, DIRECTION = range(7)


def walk(
    seconds=12.0,
    step_hz=2.0,
    *,
    swing_rad_s=0.0,
    swing_phase=0.0,
    turn=0.0,
    turn_phase=0.0,
    field_ut=40.0,
    forward_g=0.2,
    bearing=0.0,
):
    """A walk with its crests at phase 0: vertical along z, forward along `bearing` (from x = north to −y = east).

    The arm's rate has its extrema at the crests, the field's angle too, each later by its phase of a step.
    """
    phase = 2 * np.pi * step_hz * np.arange(round(seconds * GRID_HZ)) / GRID_HZ
    values = np.zeros((len(phase), 9))
    forward = forward_g * np.sin(phase)
    values[:, 0], values[:, 1] = forward * np.cos(bearing), -forward * np.sin(bearing)
    values[:, 2] = 1.0 + 0.3 * np.cos(phase)
    values[:, 4] = swing_rad_s * np.cos((phase - 2 * np.pi * swing_phase) / 2)
    angle = turn * np.cos((phase - 2 * np.pi * turn_phase) / 2)
    values[:, 6], values[:, 7] = field_ut * np.cos(angle), field_ut * np.sin(angle)
    return Signal(values)


def rows_of(params, signal):
    return step_rows(signal.block(arrays=True), params)


def count(params, signal):
    return len(rows_of(params, signal))


def still(n):
    return np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0], (n, 1))


@few
@given(
    signal=signals(),
    reject=st.sampled_from([0.3, 0.45, 0.5, 0.7]),
    update=st.sampled_from([0.0, 0.2, 0.3, 0.5]),
    half=st.integers(15, 60),
    limit=st.integers(5, 60),
    rest_g=st.sampled_from([0.0, 0.05, 0.2]),
    jump_g=st.sampled_from([0.05, 0.5]),
)
def test_agrees_with_the_text(signal, reject, update, half, limit, rest_g, jump_g):
    params = replace(
        FREE,
        reject_share=reject,
        update_share=update,
        half_limit=limit,
        longest_half=half,
        rest_g=rest_g,
        jump_g=jump_g,
        swing_rad_s=1e9,
    )
    outcome = collect(build(params), [signal.block()], finish=True)
    expected = fusion_oracle.steps(
        outcome.trace, params, first=7, first_half=GRID_HZ / (2.0 * first_cadence_hz(params))
    )
    delay = 6
    assert [round(step.at_s * GRID_HZ) + delay for step in outcome.steps] == [pair[0] for pair in expected]
    assert [(step.peak, step.valley) for step in outcome.steps] == [pair[2:] for pair in expected]


def test_signal_is_the_norm_of_low_passed_axes():
    rng = np.random.default_rng(0)
    signal = Signal(rng.standard_normal((300, 9)) + 3.0)
    update = build(replace(PAPER, rest_g=1e9)).update(signal.block())
    b, a = butter(2, 3.0, fs=GRID_HZ)
    settled = np.concatenate([np.repeat(signal.values[:1], 200, axis=0), signal.values])
    smooth = lfilter(b, a, settled[:, :3], axis=0)[200:]
    norm = np.sqrt((smooth**2).sum(axis=1))
    slowest, second = 6, 4  # √2/(2π 2 Hz) and √2/(2π 3 Hz) at 50 Hz
    assert update.trace[slowest - second :] == pytest.approx(norm[: len(norm) - slowest + second].tolist(), abs=1e-6)
    assert update.trace_from_s == pytest.approx(-slowest / GRID_HZ)


def test_the_bank_has_five_cut_offs():
    assert cutoffs_hz(PAPER) == (2.0, 3.0, 4.0, 5.0, 6.0)
    assert cutoffs_hz(TUNED) == (1.5, 2.5, 3.5, 4.5, 5.5)


@pytest.mark.parametrize("step_hz", [0.8, 1.4, 2.0, 2.6, 3.4])
@pytest.mark.parametrize("params", [PAPER, TUNED], ids=["paper", "tuned"])
def test_every_filter_of_the_bank_places_the_crests_alike(params, step_hz):
    at = rows_of(replace(params, distance_share=-1.0, suspect_share=-1.0), walk(20.0, step_hz))[6:, AT]
    delay = build(params).update(walk(0.2).block()).trace_from_s * -GRID_HZ
    crest = (at - delay) * step_hz / GRID_HZ
    assert np.abs((crest + 0.5) % 1 - 0.5).max() * GRID_HZ / step_hz <= 2.0


def test_filter_follows_the_pace():
    """(11), (12): a jump of peak-to-valley picks the filter of the pace, and none leaves it alone."""
    slow, fast = walk(10.0, 1.5).values, walk(10.0, 2.8).values
    fast[:, 2] = 1.0 + 3.0 * (fast[:, 2] - 1.0)
    signal = Signal(np.concatenate([slow, fast]))
    assert count(replace(FREE, jump_g=0.1), signal) == pytest.approx(15 + 28, abs=2)
    for jump_g, cutoff_hz in ((0.1, 4.0), (1e9, 3.0)):
        trace = collect(build(replace(FREE, jump_g=jump_g)), [signal.block()]).trace[-100:]
        gain = 1 / math.sqrt(1 + (2.8 / cutoff_hz) ** 4)
        assert max(trace) - min(trace) == pytest.approx(2 * 0.9 * gain, rel=0.03)


def test_a_pace_that_more_than_doubles_is_followed_only_with_a_limit():
    """th_s = 0.5 × 28 samples rejects half-steps of 9, and the third extremum confirms the long Δt₁."""
    signal = Signal(np.concatenate([walk(10.0, 0.9).values, walk(10.0, 2.8).values]))
    assert count(FREE, signal) < 22
    assert count(replace(FREE, half_limit=16), signal) == pytest.approx(9 + 28, abs=2)


@pytest.mark.parametrize(("height_cm", "sex"), [(120, "unknown"), (170, "female"), (200, "male")])
def test_first_half_step_follows_height_and_sex(height_cm, sex):
    mean = {"male": (110.5, 176.0), "female": (116.5, 163.0), "unknown": (113.5, 169.5)}[sex]
    params = with_overrides(PAPER, {"height_cm": height_cm, "sex": sex})
    expected = mean[0] / 60 * math.sqrt(mean[1] / height_cm)
    assert first_cadence_hz(params) == pytest.approx(expected)


def test_a_childs_first_half_step_admits_what_an_adults_rejects():
    """The second event comes 6 samples after the first: too soon for 0.5 × 14 samples, not for 0.5 × 10."""
    values = still(60)
    values[20:, 2] = np.interp(np.arange(40), [0, 4, 10, 16, 22, 40], [1.0, 1.6, 0.7, 1.0, 1.0, 1.0])
    signal = Signal(values)
    wide = replace(FREE, cutoff_margin_hz=4.0)
    peaks = {cm: collect(build(replace(wide, height_cm=cm)), [signal.block()], finish=True).steps for cm in (230, 80)}
    assert len(peaks[80]) >= len(peaks[230])
    assert first_cadence_hz(replace(wide, height_cm=80)) > 1.6 * first_cadence_hz(replace(wide, height_cm=230))


def test_a_half_step_may_be_as_long_as_the_longest():
    signal = walk(12.0, 1.0)
    assert count(replace(FREE, longest_half=25), signal) == pytest.approx(12, abs=1)
    assert count(replace(FREE, longest_half=24), signal) <= 1


def test_rest_is_a_matter_of_peak_to_valley():
    signal = walk()
    swing_g = np.median(rows_of(FREE, signal)[:, PEAK] - rows_of(FREE, signal)[:, VALLEY])
    assert count(replace(FREE, rest_g=0.9 * swing_g), signal) >= 22
    assert count(replace(FREE, rest_g=1.1 * swing_g), signal) <= 1


def test_pseudo_zero_crossing_is_between_peak_and_valley():
    rows = rows_of(FREE, walk())
    assert rows[:, CROSSING] == pytest.approx((rows[:, PEAK] + rows[:, VALLEY]) / 2)
    step = collect(build(FREE), [walk().block()]).steps[3]
    assert step.upper == step.lower == pytest.approx((step.peak + step.valley) / 2)


@pytest.mark.parametrize(("before_g", "after_g"), [(3.0, 0.0), (0.0, 3.0)])
def test_a_pair_on_one_side_of_the_last_crossing_is_suspect(before_g, after_g):
    """The norm's level falls by 3 g: the next peak lies below the crossing; it rises: the next valley lies above."""
    before, after = walk(6.0).values, walk(6.0).values
    before[:, 2] += before_g
    after[:, 2] += after_g
    signal = Signal(np.concatenate([before, after]))
    at = rows_of(FREE, signal)[:, AT]
    missed = set(at) - set(rows_of(STRICT, signal)[:, AT])
    assert 1 <= len(missed) <= 2
    assert all(300 <= k <= 360 for k in missed)


SWINGS = {"swing_rad_s": 2.0, "turn": 0.5}


@pytest.mark.parametrize(
    ("arm", "counted"),
    [
        ({"swing_rad_s": 0.3, "swing_phase": 0.5}, True),  # it hardly swings: not looked at
        ({**SWINGS}, True),
        ({**SWINGS, "swing_phase": 0.5}, False),  # extrema half-way between the peaks
        ({**SWINGS, "turn_phase": 0.5}, False),
        ({"swing_rad_s": 2.0, "turn": 0.0}, True),  # gyroscope periodic, field not: disturbed, so not asked
        ({"swing_rad_s": 2.0, "turn": 0.5, "turn_phase": 0.5, "field_ut": "moves"}, True),
    ],
)
def test_a_swing_must_go_with_the_steps(arm, counted):
    moves = arm.get("field_ut") == "moves"
    signal = walk(**{**arm, "field_ut": 40.0})
    if moves:
        signal.values[:, 6:] *= 1.0 + 0.3 * np.sin(np.pi * 2.0 * np.arange(len(signal)) / GRID_HZ)[:, None]
    found = count(STRICT, signal)
    assert found >= 21 if counted else found <= 3


def test_match_share_is_how_far_the_extremum_may_be():
    signal = walk(**SWINGS, swing_phase=0.3, turn_phase=0.3)
    assert count(replace(STRICT, match_share=0.2), signal) <= 3
    assert count(replace(STRICT, match_share=0.4), signal) >= 21


def test_irregular_swings_are_suspect_only_if_asked():
    signal = walk(turn=0.5)
    rng = np.random.default_rng(1)
    signal.values[:, 3:6] = rng.normal(0, 4, (len(signal), 3))
    kept = replace(STRICT, match_share=0.5)
    assert count(replace(kept, irregular="suspect", periodicity=0.9), signal) <= 3
    assert count(replace(kept, irregular="pass", periodicity=0.9), signal) >= 15


@few
@given(signal=signals(), share=st.floats(0.1, 1.5), along=st.sampled_from(["plain", "along"]))
def test_every_step_goes_farther_than_the_share_of_the_last_three(signal, share, along):
    params = replace(PAPER, distance_share=share, suspect_share=share, path=along, swing_rad_s=1e9)
    last: list[float] = []
    for at, spacing, *_, distance, _ in rows_of(params, signal):
        if spacing == 0.0:
            last = []
        if distance > 0.0:
            assert len(last) < 3 or distance > share * sum(last[-3:]) / 3 * (1 - 1e-12), at
            last.append(distance)


def test_the_first_three_displacements_pass():
    """Two long steps and short ones: the third passes, the fourth falls short of 0.6 × the mean."""
    signal = walk(4.0, forward_g=0.5)
    signal.values[75:, 0] *= 0.3
    rows = rows_of(FREE, signal)
    assert (rows[:4, DISTANCE] > 0).tolist() == [False, True, True, True]
    assert rows[3, DISTANCE] < 0.3 * rows[2, DISTANCE]
    strict = rows_of(PAPER, signal)[:, AT]
    assert strict[:4].tolist() == rows[:4, AT].tolist()
    assert rows[4, AT] not in strict


def test_shuffling_on_the_spot_after_a_walk_is_not_counted_until_a_pause():
    fast, spot, pause = walk(10.0).values, walk(10.0, forward_g=0.03).values, still(100)
    assert count(PAPER, Signal(fast)) == pytest.approx(20, abs=1)
    together = count(PAPER, Signal(np.concatenate([fast, spot[:70]])))
    assert together <= 21
    assert count(PAPER, Signal(np.concatenate([fast, pause, spot]))) >= 38


def test_a_long_stride_does_not_end_counting_for_ever():
    """Rejected for `longest_step`, a walk begins afresh."""
    far, near = walk(6.0, forward_g=0.6).values, walk(20.0, forward_g=0.1).values
    rows = rows_of(PAPER, Signal(np.concatenate([far, near])))
    assert (rows[:, AT] > 600).sum() > 20


@pytest.mark.parametrize("bearing", [-1.2, -0.4, 0.0, 0.9])
def test_direction_is_the_bearing_of_the_walk(bearing):
    rows = rows_of(FREE, walk(20.0, bearing=bearing))
    assert np.median(rows[8:, DIRECTION]) == pytest.approx(bearing, abs=0.05)


def test_along_its_direction_a_straight_step_is_as_long():
    signal = walk(20.0, bearing=0.5)
    plain = rows_of(FREE, signal)[8:, DISTANCE]
    along = rows_of(replace(FREE, path="along"), signal)[8:, DISTANCE]
    assert along == pytest.approx(plain, rel=0.05)


def test_bout_holds_steps_back_until_there_are_enough():
    signal = walk(2.4)
    free = count(FREE, signal)
    assert 3 <= free <= 5
    assert count(replace(FREE, bout=free), signal) == free
    assert count(replace(FREE, bout=free + 1), signal) == 0


def test_a_bout_goes_on_over_a_short_gap_only():
    params = replace(TUNED, distance_share=-1.0, suspect_share=-1.0)
    signal, more = walk(6.0), walk(1.9)
    for gap, expected in ((50, True), (200, False)):
        counter = build(params)
        collect(counter, [signal.block()])
        block = more.block(offset=len(signal) + gap)
        steps = collect(counter, [block], finish=True).steps
        late = [step for step in steps if step.at_s >= block.start / GRID_HZ]
        assert bool(late) is expected
        assert all(step.interval_s is None for step in late[:1])


def test_an_uncertain_bout_ends_at_a_gap():
    signal = walk(1.4)
    free = count(FREE, signal)
    counter = build(replace(FREE, bout=free + 1))
    collect(counter, [signal.block()])
    assert collect(counter, [signal.block(offset=len(signal) + 40)], finish=True).steps == []


@few
@given(signal=signals(), gap=st.integers(31, 400), preset=st.sampled_from([PAPER, TUNED]), seed=st.integers(0, 99))
def test_no_check_looks_across_a_gap(signal, gap, preset, seed):
    """A device that lay still in a turning field, then a gap: what follows is counted as from a fresh start."""
    before = Signal(still(300))
    before.values[:, 3:] = np.random.default_rng(seed).normal(0, 30, (300, 6))
    params = replace(preset, irregular="suspect")
    counter, offset = build(params), len(before) + gap
    collect(counter, [before.block()])
    after = collect(counter, [signal.block(offset=offset)], finish=True)
    fresh = collect(build(params), [signal.block(offset=offset)], finish=True)
    assert (after.steps, after.trace) == (fresh.steps, fresh.trace)


def test_the_first_step_after_a_gap_has_no_displacement():
    counter, signal = build(FREE), walk(4.0)
    collect(counter, [signal.block()])
    block = walk(4.0).block(offset=len(signal) + 31)
    columns = (*block.acc_g, *block.gyro_rad_s, *block.mag_ut)
    kernel.close(counter._state, [0.0] * 100)
    kernel.begin(counter._state, block.start, *(column[0] for column in columns))
    out = [0.0] * 2000
    end = kernel.scan(*columns, len(block), counter._state, out)
    rows = np.reshape(out[len(block) : end], (-1, 7))
    assert len(rows) >= 6
    assert rows[0, DISTANCE] == 0.0
    assert (rows[1:, DISTANCE] > 0.0).all()


def test_nothing_is_likely_at_rest():
    counter = build(TUNED)
    counter.update(walk(1.2).block())
    after = counter.update(Signal(still(200)).block(offset=60))
    assert list(after.likely) == []
    assert after.pending == 0


def test_likely_steps_come_soon_and_bear_the_time_they_are_confirmed_with():
    counter, signal = build(TUNED), walk(8.0)
    told: dict[float, float] = {}
    confirmed = []
    for k in range(len(signal)):
        update = counter.update(signal.block(k, k + 1))
        assert update.pending == sum(passes for _, _, passes in update.likely)
        for at_s, strength, passes in update.likely:
            told.setdefault(at_s, k / GRID_HZ)
            assert not passes or strength > TUNED.rest_g
        confirmed += [step.at_s for step in update.steps]
    assert len(confirmed) >= 13
    assert set(confirmed) <= set(told)
    assert max(told[at_s] - at_s for at_s in confirmed[1:]) <= 0.18
    assert sorted(told[at_s] - at_s for at_s in confirmed)[len(confirmed) // 2] <= 0.13  # before the filter is through


def test_clipped_and_huge_values_are_counted_without_harm():
    signal = walk(12.0)
    signal.values[:, 2] = np.clip(4 * (signal.values[:, 2] - 1) + 1, -2, 2)
    assert count(FREE, signal) == pytest.approx(24, abs=2)
    signal.values[::7] *= 1e6
    assert np.isfinite(rows_of(PAPER, signal)).all()


@pytest.mark.parametrize("lacking", ["gyro_rad_s", "mag_ut"])
def test_a_missing_sensor_is_an_error(lacking):
    block = walk(1.0).block()
    with pytest.raises(CounterError, match="needs a"):
        build().update(replace(block, **{lacking: None}))
    with pytest.raises(CounterError, match="needs gyroscope, magnetometer"):
        registry.make("fusion", sensors=[Sensor.ACCELEROMETER])


@pytest.mark.parametrize("override", [{"height_cm": 20}, {"sex": "x"}, {"bout": 13}, {"cutoff_margin_hz": 0.1}])
def test_parameters_out_of_range_are_refused(override):
    with pytest.raises(ParameterError):
        with_overrides(TUNED, override)


def test_an_empty_recording_has_no_rows():
    empty: SampleBlock = Signal(np.empty((0, 9))).block(arrays=True)
    assert step_rows(empty).shape == (0, 7)


# What looks back, over a ring filled by hand.


def ring(**columns):
    """A ring at offset 2 whose channels hold the columns given from sample 0 on."""
    s = [0.0] * (2 + checks.DEPTH * checks.CHANNELS)
    for name, column in columns.items():
        for k, value in enumerate(column):
            s[2 + k % checks.DEPTH * checks.CHANNELS + int(name[1:])] = float(value)
    return s


@few
@given(values=st.lists(st.floats(-50, 50), min_size=3, max_size=60), first=st.integers(0, 20))
def test_variance_is_numpys(values, first):
    first = min(first, len(values) - 2)
    assert checks.variance(ring(c4=values), 2, 4, first, len(values) - 1) == pytest.approx(
        np.var(values[first:]), abs=1e-7
    )


def test_main_axis_varies_most():
    s = ring(c0=[0, 1, 0, 1], c1=[5, 5, 5, 5], c2=[0, 3, 0, 3], c3=[0, 9, 0, 9], c4=[0, 8, 0, 8])
    assert checks.main_axis(s, 2, checks.GYROSCOPE, 0, 3) == 2
    assert checks.main_axis(s, 2, checks.MAGNETOMETER, 0, 3) == 3


@pytest.mark.parametrize("sign", [1, -1])
def test_extremum_of_either_sign_inside_the_span(sign):
    s = ring(c1=[sign * v for v in (0, 1, 2, 3, 2, 1, 0)])
    assert checks.has_extremum(s, 2, 1, 3, 3)
    assert checks.has_extremum(s, 2, 1, 1, 5)
    assert not checks.has_extremum(s, 2, 1, 1, 2)
    assert not checks.has_extremum(s, 2, 1, 4, 5)


def test_correlation_knows_a_repetition_and_a_mirror_image():
    swing = np.sin(np.pi * np.arange(60) / 20)
    assert checks.correlation(ring(c0=swing), 2, 0, 20, 39, 20) == pytest.approx(-1)
    assert checks.correlation(ring(c0=3 + 2 * swing), 2, 0, 40, 59, 40) == pytest.approx(1)
    assert checks.correlation(ring(c0=[4.0] * 60), 2, 0, 20, 39, 20) == 0.0


def test_field_moves_by_its_norm_and_not_by_its_direction():
    angle = np.linspace(0, 3, 30)
    turning = ring(c3=40 * np.cos(angle), c4=40 * np.sin(angle))
    assert checks.field_movement(turning, 2, 0, 29) == pytest.approx(0, abs=1e-12)
    assert checks.field_movement(ring(c3=[40] * 15 + [60] * 15), 2, 0, 29) == pytest.approx(0.4)
    assert checks.field_movement(ring(), 2, 0, 9) == 1.0


def test_displacement_is_the_double_integral():
    """From rest at a constant 0.1 g for 20 samples, as the document sums it: a Δt² n (n + 1)/2."""
    s = ring(c6=[0.1] * 30, c7=[-0.2] * 30)
    north, east = checks.displacement_m(s, 2, 5, 25)
    expected = 0.1 * 9.80665 * 0.02**2 * 20 * 21 / 2
    assert (north, east) == pytest.approx((expected, -2 * expected))


@pytest.mark.parametrize("angle", [-1.5, -0.7, 0.0, 0.3, 1.5])
def test_direction_is_the_line_of_least_squares(angle):
    rng = np.random.default_rng(2)
    along, across = rng.normal(0, 1, 40), rng.normal(0, 0.02, 40)
    north = 3 + along * np.cos(angle) - across * np.sin(angle)
    east = -1 + along * np.sin(angle) + across * np.cos(angle)
    found = checks.direction(ring(c6=north, c7=east), 2, 0, 39)
    assert (found - angle + np.pi / 2) % np.pi - np.pi / 2 == pytest.approx(0, abs=0.02)


def test_the_ring_goes_round():
    values = np.arange(300.0)
    s = ring(c0=values)
    assert checks.value(s, 2, 0, 299) == 299.0
    assert checks.variance(s, 2, 0, 250, 299) == pytest.approx(np.var(values[250:]))
