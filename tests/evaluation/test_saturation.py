"""A range that ends is found at either end of any axis, noisy or not; a whole crest and a single blow are none."""

import dataclasses

import numpy as np
import pytest
from evaluation.made import still, walk

from service.evaluation.saturation import saturated
from service.recordings import read


def noisy(recording, noise_g=0.02):
    noise = np.random.default_rng(1).normal(0, noise_g, recording.acc_g.shape)
    return dataclasses.replace(recording, acc_g=recording.acc_g + noise)


def clipped(recording, low_g, high_g):
    return dataclasses.replace(recording, acc_g=np.clip(recording.acc_g, low_g, high_g))


@pytest.mark.parametrize("noise_g", [0.0, 0.02])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_end_of_any_axis_is_found(noise_g, axis, sign):
    made = clipped(walk(20, 100, swing_g=1.5), -2, 2)
    turned = dataclasses.replace(made, acc_g=sign * np.roll(made.acc_g, axis + 1, axis=1))
    assert saturated(noisy(turned, noise_g))


@pytest.mark.parametrize("swing_g", [0.8, 1.5, 3.0])
@pytest.mark.parametrize("rate_hz", [25, 100])
def test_a_whole_crest_is_no_end(swing_g, rate_hz):
    made = walk(20, rate_hz, swing_g=swing_g)
    assert not saturated(made)
    assert not saturated(noisy(made))


def test_no_range_ends_at_gravity():
    assert not saturated(still(10))
    assert not saturated(clipped(walk(10), -1.3, 1.3))


def test_one_blow_is_no_end_but_three_equal_samples_are():
    spike = still(10)
    spike.acc_g[100:102, 0] = -2.0
    assert not saturated(spike)
    spike.acc_g[102, 0] = -2.0
    assert saturated(spike)


@pytest.mark.full
@pytest.mark.parametrize("name", ["eth2023_wrist/labeled_03", "eth2022_wrist/6_jog_44", "eth2022_wrist/7_run_32"])
def test_runs_beyond_the_range_of_their_sensor_are_found(recordings, name):
    assert saturated(read(recordings / f"{name}.npz"))


@pytest.mark.full
@pytest.mark.parametrize("dataset", ["oxford_opt", "voisard_lowback", "banglejs_walk"])
def test_sensors_of_a_wider_range_are_at_no_end(recordings, dataset):
    assert [path.name for path in sorted((recordings / dataset).glob("*.npz")) if saturated(read(path))] == []
