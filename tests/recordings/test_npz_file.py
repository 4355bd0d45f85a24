"""Archives: units, optional arrays, and files that only look like one."""

import zipfile

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import read

N = 20


def arrays(**changes):
    acc = np.tile([0.0, 0.0, 1.0], (N, 1)).astype(np.float32)
    return {"t": np.arange(N) / 100, "acc": acc, "rate_hz": 100.0} | changes


def saved(path, **changes):
    np.savez(path, **{name: value for name, value in arrays(**changes).items() if value is not None})
    return path


def test_units_and_scalars(tmp_path):
    path = saved(
        tmp_path / "a.npz",
        gyro=np.full((N, 3), 180.0),
        mag=np.full((N, 3), 48.0),
        step_t=np.array([0.05, 0.15]),
        true_steps=2,
        steps_min=1.0,
        steps_max=3.0,
        placement="wrist",
        activity="walk",
        subject="s1",
        gt_quality="A",
    )
    recording = read(path)
    assert recording.acc_g.dtype == np.float64
    assert recording.rate_hz == 100
    assert np.allclose(recording.gyro_rad_s, np.pi)
    assert (recording.mag_ut == 48).all()
    assert recording.step_t_s.tolist() == [0.05, 0.15]
    assert (recording.true_steps, recording.steps_range, recording.quality) == (2, (1, 3), "A")
    assert (recording.placement, recording.activity, recording.subject) == ("wrist", "walk", "s1")


def test_only_time_and_acceleration_must_be_there(tmp_path):
    recording = read(saved(tmp_path / "a.npz", rate_hz=None))
    assert recording.rate_hz == pytest.approx(100)
    optional = (recording.gyro_rad_s, recording.mag_ut, recording.step_t_s, recording.true_steps, recording.placement)
    assert (*optional, recording.steps_range) == (None,) * 6


def test_repeated_stamps_are_merged_in_every_array(tmp_path):
    t = np.arange(N) / 100
    t[7] = t[6]
    recording = read(saved(tmp_path / "a.npz", t=t, gyro=np.arange(3.0 * N).reshape(N, 3)))
    assert len(recording) == N - 1
    assert np.rad2deg(recording.gyro_rad_s[7, 0]) == pytest.approx(24)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"acc": None}, "no array acc; it holds rate_hz, t"),
        ({"t": None, "acc": None}, "no array t and acc"),
        ({"acc": np.array([["a"] * 3] * N)}, "array acc holds <U1, not numbers"),
        ({"acc": np.array([[None] * 3] * N)}, "no numpy archive of plain arrays"),
        ({"acc": np.ones((N, 2))}, "acc has shape"),
        ({"acc": np.ones((3, N))}, "acc has shape"),
        ({"true_steps": np.arange(3)}, "true_steps is [0.0, 1.0, 2.0], not one finite number"),
        ({"true_steps": np.nan}, "not one finite number"),
        ({"t": np.zeros((0,)), "acc": np.zeros((0, 3))}, "0 samples"),
    ],
)
def test_what_is_no_recording_is_named(tmp_path, changes, says):
    with pytest.raises(RecordingError) as error:
        read(saved(tmp_path / "a.npz", **changes))
    assert says in error.value.why


def test_a_zip_that_is_no_archive(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("walk.csv", "time_s,x_g,y_g,z_g\n")
    with pytest.raises(RecordingError, match="no array t and acc; it holds no array"):
        read(path)


def test_a_truncated_archive(tmp_path):
    path = saved(tmp_path / "a.npz")
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(RecordingError, match="no numpy archive"):
        read(path)
