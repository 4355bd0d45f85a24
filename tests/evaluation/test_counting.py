"""One counter over one recording: the same as live, plain or compiled, and clear about what it cannot count."""

import dataclasses

import numpy as np
import pytest
from evaluation.lossless import live_steps
from evaluation.made import still, walk
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from device_sim.source import RecordingSource
from service.counters import registry
from service.errors import CounterError, ParameterError, RecordingError
from service.evaluation.counting import MIN_RATE_HZ, count, grid_block, raw_block, sensors
from service.recordings import evenly_spaced, stated_rate_hz
from service.recordings.even import MAX_SAMPLES
from service.recordings.recording import median_rate_hz
from service.samples import Sensor

VARIANTS = [(name, preset) for name in registry.COUNTERS for preset in registry.COUNTERS[name].presets]


def jittered(seed, seconds, rate_hz):
    """A walk whose samples come at uneven times."""
    made = walk(seconds, rate_hz)
    jitter_s = np.random.default_rng(seed).uniform(-0.4, 0.4, len(made)) / rate_hz
    return dataclasses.replace(made, t_s=np.sort(made.t_s + jitter_s) + 7.0, step_t_s=None)


def test_a_walk_is_counted_at_its_crests():
    made = walk(20, 100)
    counted = count(made, "double_threshold")
    assert counted.steps == 40
    assert counted.step_t_s == pytest.approx(made.step_t_s, abs=0.02)
    assert counted.samples == 1000
    assert counted.elapsed_s > 0


def test_the_grid_holds_every_sensor_of_the_file():
    block = grid_block(walk(4, 25))
    assert len(block) == len(block.gyro_rad_s[0]) == len(block.mag_ut[0]) == 199
    assert sensors(block) == set(Sensor)
    assert sensors(grid_block(still(4))) == {Sensor.ACCELEROMETER}


def test_at_50_hz_the_grid_is_the_file():
    made = walk(4)
    assert np.array_equal(np.column_stack(grid_block(made).acc_g), made.acc_g)


RECORDED = given(st.integers(0, 1000), st.floats(0.3, 8), st.sampled_from([12.5, 25, 31.25, 50, 52.083333, 100]))


@settings(max_examples=8)
@RECORDED
def test_packets_plain_python_and_numba_give_the_same_steps(seed, seconds, rate_hz):
    check_alike([variant for variant in VARIANTS if variant[0] != "steplink"], seed, seconds, rate_hz)


@pytest.mark.full  # numba takes seven seconds to compile it
@settings(max_examples=8)
@RECORDED
def test_packets_plain_python_and_numba_give_the_same_steps_of_steplink(seed, seconds, rate_hz):
    check_alike([variant for variant in VARIANTS if variant[0] == "steplink"], seed, seconds, rate_hz)


def check_alike(variants, seed, seconds, rate_hz):
    made = jittered(seed, seconds, rate_hz)
    assume(median_rate_hz(made.t_s) >= MIN_RATE_HZ)  # of a few samples most may come late
    assert variants
    live = live_steps(made, variants, n=1 + seed % 30)
    for variant in variants:
        for fast in (True, False):
            assert count(made, *variant, fast=fast).step_t_s.tolist() == live[variant]


def test_the_bracelet_plays_the_samples_that_are_counted():
    made = jittered(1, 5, 40.004)
    played = RecordingSource(made)
    assert played.rate_hz == stated_rate_hz(made) == 50  # its stamps are uneven: laid on the grid at once
    assert np.array_equal(played.read(10_000), np.column_stack(raw_block(made).acc_g))


def test_a_block_is_counted_as_its_recording():
    made = walk(10)
    assert np.array_equal(count(grid_block(made)).step_t_s, count(made).step_t_s)


def test_overrides_reach_the_counter():
    assert count(walk(10), "double_threshold", overrides={"rest_raw": "64"}).steps == 0


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("seconds", [0.04, 0.1, 0.3])
def test_a_recording_shorter_than_a_step_has_none(seconds, fast):
    for variant in VARIANTS:
        assert count(walk(seconds, step_hz=0.0), *variant, fast=fast).steps == 0


def test_rest_has_no_steps():
    assert count(still()).step_t_s.tolist() == []


@pytest.mark.parametrize("stated_hz", [5.0, 50.0])
def test_under_10_hz_nothing_is_counted_whatever_the_file_states(stated_hz):
    made = dataclasses.replace(walk(20, 5), rate_hz=stated_hz)
    with pytest.raises(RecordingError, match="5 samples a second"):
        count(made)


def test_a_tenth_of_a_second_in_milliseconds_is_10_hz():
    made = walk(20, 10)
    count(dataclasses.replace(made, t_s=np.round(made.t_s * 1.004, 3)))


def test_a_stamp_from_another_age_does_not_fill_the_memory():
    made = walk(20)
    made.t_s[-1] = MAX_SAMPLES / 50
    with pytest.raises(RecordingError, match="is a stamp wrong"):
        evenly_spaced(made, made.acc_g, 50.0)


def test_a_missing_sensor_a_wrong_name_and_a_wrong_parameter_are_refused(monkeypatch):
    kind = dataclasses.replace(registry.kind("double_threshold"), sensors=frozenset({Sensor.GYROSCOPE}))
    with pytest.raises(CounterError, match="abacus"):
        count(walk(), "abacus")
    with pytest.raises(ParameterError, match="colour"):
        count(walk(), overrides={"colour": "red"})
    monkeypatch.setattr(registry, "COUNTERS", {"double_threshold": kind})
    with pytest.raises(CounterError, match="needs gyroscope"):
        count(still(), "double_threshold")
