"""The fusion counter where the device swings: turns, one a step, on synthetic wrists and by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from counters.conformance import Signal
from counters.test_fusion import FREE, STRICT, count, walk

from device_sim.gait import Walker
from service.counters import fusion_checks as checks
from service.counters import fusion_state as state
from service.counters import fusion_swing as swings
from service.counters.fusion import TUNED
from service.samples import GRID_HZ


def sensed(schedule, seed):
    """A synthetic walker and what the nine axes on its wrist measure."""
    walker = Walker(schedule, seed=seed)
    values = walker.sensed()
    return walker, Signal(np.hstack([values.acc_g, values.gyro_rad_s, values.mag_ut]))


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_an_even_swing_goes_with_the_steps_at_any_phase(phase):
    signal = walk(swing_rad_s=2.0, swing_phase=phase, turn=0.0)
    assert count(replace(STRICT, matching="turns"), signal) >= 21
    assert (count(STRICT, signal) <= 3) is (phase == 0.5)


def test_each_step_has_a_turn_of_its_own():
    """The norm has two crests a step, of which the swing knows one."""
    signal = walk(swing_rad_s=2.0, turn=0.0)
    phase = 2 * np.pi * 2.0 * np.arange(len(signal)) / GRID_HZ
    signal.values[:, 2] = 1.0 + 0.3 * np.cos(2 * phase)
    free = replace(FREE, swing_rad_s=0.5, reject_share=0.3, cutoff_margin_hz=4.0)
    assert count(free, signal) == pytest.approx(48, abs=2)
    assert count(replace(free, matching="turns"), signal) == pytest.approx(24, abs=3)


@pytest.mark.parametrize("activity", ["slow", "normal", "fast"])
def test_synthetic_wrists_steps_are_counted(activity):
    true = counted = 0
    for seed in range(4):
        walker, signal = sensed(f"rest:3,{activity}:60,rest:3", seed)
        true += walker.true_steps_until(walker.duration_s)
        counted += count(TUNED, signal)
    assert counted == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize(("activity", "most"), [("type", 0), ("rotate", 0), ("sit", 0), ("gesture", 0), ("knock", 20)])
def test_a_synthetic_wrist_that_does_not_walk_is_not_counted(activity, most):
    assert count(TUNED, sensed(f"rest:3,{activity}:30", 1)[1]) <= most


def test_a_magnet_that_passes_a_resting_wrist_is_no_step():
    signal = sensed("rest:33", 1)[1]
    since_s = np.arange(len(signal)) / GRID_HZ % 8.0 - 4.0
    signal.values[:, 6:] += np.outer(np.exp(-((2.0 * since_s) ** 2)), [40.0, -30.0, 25.0])
    assert count(TUNED, signal) == 0


def swung(column, *, first=0, matched=-1.0, swing=0.01):
    """A state whose gyroscope's x axis has the column's values from sample 0 on."""
    s = [0.0] * state.SIZE
    s[state.SWING], s[state.MAX_STEP], s[state.FIRST], s[state.MATCHED] = swing, 90.0, float(first), matched
    for k, value in enumerate(column):
        s[state.MOTION + k % checks.DEPTH * checks.CHANNELS] = float(value)
    return s


SWUNG = np.sin(np.pi * np.arange(100) / 25 + 0.5)
"""It crosses its mean at samples 21, 46, 71 and 96."""


@pytest.mark.parametrize(
    ("matched", "previous", "turn"), [(-1, 0, 24), (24, 0, 49), (24, 60, 74), (74, 60, swings.TAKEN)]
)
def test_a_turn_is_matched_once_and_after_the_peak_before(matched, previous, turn):
    s = swung(SWUNG, matched=float(matched))
    assert swings.look(s, previous, 80, 90) == pytest.approx(turn, abs=1)
    assert s[state.PERIOD] == 25.0


def test_no_turn_is_seen_at_rest_before_the_stretch_or_in_noise_about_the_mean():
    assert swings.look(swung(SWUNG, swing=1.0), 0, 80, 90) == swings.STILL
    assert swings.look(swung(SWUNG, first=55), 0, 80, 90) == pytest.approx(74, abs=2)
    noisy = SWUNG + 0.3 * (-1.0) ** np.arange(100)
    s = swung(noisy)
    assert swings.look(s, 30, 80, 90) == pytest.approx(49, abs=2)
    assert s[state.PERIOD] == pytest.approx(25, abs=1)


def test_an_uneven_swing_gives_no_time_of_a_step():
    uneven = np.concatenate([np.ones(20), -np.ones(40), np.ones(20), -np.ones(20)])
    s = swung(uneven)
    assert swings.look(s, 0, 85, 90) == 20
    assert s[state.PERIOD] == 0.0
    even = np.concatenate([np.ones(20), -np.ones(30), np.ones(20), -np.ones(30)])
    s = swung(even)
    swings.look(s, 0, 85, 90)
    assert s[state.PERIOD] == 25.0
