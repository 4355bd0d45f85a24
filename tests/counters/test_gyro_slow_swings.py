"""The gyroscope's zero crossings where the swing is slow or wide: slow walkers against arms that move about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from counters.conformance import Signal, collect
from counters.test_gyro_zero_crossing import SHARP, lobes, steps_of, strengths, swing

from device_sim.gait import Walker
from device_sim.gait_poses import POSES
from service.counters.gyro_zero_crossing import TUNED, build

SLOW = replace(
    SHARP, bout=4, extremum_wait_s=0.45, max_spacing_s=1.1, slow_wait_s=0.8, slow_spacing_s=1.5, slow_even=1.25
)
"""Half sines of height h rad/s and length T s sweep h T/π rad up to their extremum."""


def lobe(swept_rad, seconds):
    return swept_rad * np.pi / seconds, seconds


def alternating(*parts):
    return lobes((0, 0.5), *((height if n % 2 == 0 else -height, s) for n, (height, s) in enumerate(parts)), (0, 0.5))


@pytest.mark.parametrize("cadence_spm", [50, 62, 75, 100, 150])
def test_a_synthetic_thighs_steps_are_counted(cadence_spm):
    pose = POSES["pocket"]
    true = counted = 0
    for seed in range(4):
        gait = "slow" if cadence_spm < 90 else "fast"
        walker = Walker(
            f"rest:3,{gait}:60@{cadence_spm},rest:3",
            seed=seed,
            gravity=pose.gravity,
            arm_m=pose.arm_m,
            gaits=pose.gaits,
        )
        values = walker.sensed()
        signal = Signal(np.hstack([values.acc_g, values.gyro_rad_s, values.mag_ut]))
        true += walker.true_steps_until(walker.duration_s)
        counted += len(collect(build(TUNED), [signal.block()], finish=True).steps)
    assert counted == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize(("swept_rad", "counted"), [(0.05, 0), (0.3, 8), (0.7, 0)])
def test_a_slow_swing_is_as_wide_as_a_slow_walkers(swept_rad, counted):
    rate = alternating(*[lobe(swept_rad, 1.2)] * 8)
    assert len(steps_of(replace(SLOW, peak_rad_s=0.05, valley_rad_s=0.05), rate)) == counted


def test_a_swing_of_everyday_pace_may_be_narrower_and_wider():
    for swept_rad in (0.05, 0.7):
        rate = alternating(*[lobe(swept_rad, 0.6)] * 8)
        assert len(steps_of(replace(SLOW, peak_rad_s=0.05, valley_rad_s=0.05), rate)) >= 8


@pytest.mark.parametrize(("widest_rad", "counted"), [(0.9, 0), (1.1, 8)])
def test_a_swing_wider_than_the_widest_is_no_step(widest_rad, counted):
    rate = alternating(*[lobe(1.0, 0.6)] * 8)
    assert len(steps_of(replace(SLOW, widest_rad=widest_rad), rate)) == counted


@pytest.mark.parametrize(
    ("seconds", "counted"), [([1.2] * 6, 6), ([1.2, 1.3, 1.2, 1.3, 1.2, 1.3], 6), ([1.15, 1.49] * 3, 0)]
)
def test_slow_spacings_are_even(seconds, counted):
    rate = alternating(*(lobe(0.3, s) for s in seconds))
    assert len(steps_of(SLOW, rate)) == counted


def test_what_lay_a_slow_spacing_before_another_pace_is_dropped():
    """One swing of 1.3 s, then a walk: the swing is none of its steps, and too few of them are no walk."""
    walk = [lobe(0.2, 0.5)] * 4
    steps = steps_of(SLOW, alternating(lobe(0.3, 1.3), *walk))
    assert len(steps) == 4
    assert steps[0].at_s == pytest.approx(1.8, abs=0.03)
    assert steps[0].interval_s is None
    assert steps_of(SLOW, alternating(lobe(0.3, 1.3), *walk[:2])) == []


def test_a_certain_walk_may_slow_down_and_speed_up():
    paces = [0.9] * 4 + [1.1] * 4 + [0.9] * 4
    steps = steps_of(SLOW, alternating(*(lobe(0.3, s) for s in paces)))
    assert len(steps) == len(paces)
    assert [step.interval_s is None for step in steps] == [True] + [False] * (len(paces) - 1)


def test_without_slow_swings_nothing_passes_the_wait_or_the_spacing():
    plain = replace(SLOW, slow_wait_s=0.0, slow_spacing_s=0.0)
    rate = lobes((0, 0.5), *swing(8, height=0.8, seconds=1.2), (0, 0.5))
    assert strengths(steps_of(SLOW, rate)) == [0.8] * 8
    assert steps_of(plain, rate) == []
    assert steps_of(replace(SLOW, slow_spacing_s=0.0), rate) == []
