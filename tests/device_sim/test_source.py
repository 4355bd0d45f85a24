"""Sources: a recording on even times, once or looped, with its truth; a walker as it stands."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from device_sim.source import RecordingSource, Source, WalkerSource
from service.errors import ParameterError
from service.recordings import Recording
from service.samples import Sensor


def recorded(n=10, rate_hz=50.0, **changes):
    t_s = np.arange(n) / rate_hz
    acc_g = np.column_stack([np.arange(n) / n, np.zeros(n), np.ones(n)])
    return Recording(**({"path": Path("x"), "t_s": t_s, "acc_g": acc_g, "rate_hz": rate_hz} | changes))


def test_even_samples_come_as_they_are():
    recording = recorded(n=1000)
    source = RecordingSource(recording)
    assert source.rate_hz == 50
    assert source.read(2000) == pytest.approx(recording.acc_g)
    assert source.read(5).shape == (0, 3)


@given(st.integers(2, 60), st.lists(st.integers(0, 25), max_size=12), st.booleans())
def test_any_chunking_gives_the_same_samples(n, sizes, loop):
    whole, cut = (RecordingSource(recorded(n=n), loop=loop) for _ in range(2))
    chunks = [cut.read(size) for size in sizes]
    assert np.array_equal(np.concatenate([np.empty((0, 3)), *chunks]), whole.read(sum(sizes)))
    assert [len(chunk) for chunk in chunks] == sizes or not loop


def test_a_loop_begins_again_after_the_last_sample():
    source = RecordingSource(recorded(n=4), loop=True)
    assert source.read(10)[:, 0] == pytest.approx([0, 0.25, 0.5, 0.75, 0, 0.25, 0.5, 0.75, 0, 0.25])


def test_another_rate_is_interpolated_over_the_same_time():
    source = RecordingSource(recorded(n=51, rate_hz=50.0), rate_hz=20.0)
    samples = source.read(1000)
    assert source.rate_hz == 20
    assert len(samples) == 21
    assert samples[1, 0] == pytest.approx(2.5 / 51)


def test_a_hole_in_time_is_bridged():
    recording = recorded(n=3, t_s=np.array([5.0, 5.02, 5.08]), acc_g=np.array([[0, 0, 1], [0.3, 0, 1], [0.9, 0, 1.0]]))
    assert RecordingSource(recording).read(99)[:, 0] == pytest.approx([0, 0.3, 0.5, 0.7, 0.9])


def test_truth_with_step_times_starts_with_the_recording():
    recording = recorded(n=50, t_s=3 + np.arange(50) / 50, step_t_s=np.array([3.1, 3.5]), true_steps=2)
    once, looped = RecordingSource(recording), RecordingSource(recording, loop=True)
    times_s = (-1, 0, 0.11, 0.51, 0.99, 1.11, 1.51, 5.2)
    assert [once.true_steps_until(t_s) for t_s in times_s] == [0, 0, 1, 2, 2, 2, 2, 2]
    assert [looped.true_steps_until(t_s) for t_s in times_s] == [0, 0, 1, 2, 2, 3, 4, 11]


def test_truth_without_step_times_comes_at_the_end():
    once, looped = (RecordingSource(recorded(n=50, true_steps=3), loop=loop) for loop in (False, True))
    assert [once.true_steps_until(t_s) for t_s in (0.98, 1.01, 9)] == [0, 3, 3]
    assert [looped.true_steps_until(t_s) for t_s in (0.98, 1.01, 9.01)] == [0, 3, 27]


def test_truth_nobody_knows():
    assert RecordingSource(recorded()).true_steps_until(1) is None


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_is_above_zero(rate_hz):
    with pytest.raises(ParameterError, match="rate_hz"):
        RecordingSource(recorded(), rate_hz=rate_hz)


def test_a_walker_is_a_source():
    source: Source = WalkerSource("normal:10@120", rate_hz=25.0, seed=2)
    assert source.rate_hz == 25
    assert source.read(999).shape == (250, 3)
    assert source.true_steps_until(10.0) == 20


def test_a_recording_plays_what_it_has_of_the_sensors_asked_for():
    gyro, mag = np.full((10, 3), 2.0), np.full((10, 3), 30.0)
    has_all, no_gyro = recorded(gyro_rad_s=gyro, mag_ut=mag), recorded(mag_ut=mag)
    assert RecordingSource(has_all).sensors == (Sensor.ACCELEROMETER,)
    assert RecordingSource(has_all).read(1).shape == (1, 3)
    everything = RecordingSource(has_all, sensors=tuple(Sensor), rate_hz=25.0)
    assert everything.sensors == tuple(Sensor)
    assert everything.read(1)[0, 2:7] == pytest.approx([1.0, 2.0, 2.0, 2.0, 30.0])
    without = RecordingSource(no_gyro, sensors=tuple(Sensor), loop=True)
    assert without.sensors == (Sensor.ACCELEROMETER, Sensor.MAGNETOMETER)
    assert without.read(25).shape == (25, 6)
