"""Clemson's pedometer data: nine columns, a file of steps beside them, and what is no step."""

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import is_recording, read

STEPS = "10 right\n18 left\n22 leftshift\n31 right\n"


def table(n=60):
    wrist, hip, ankle = "0.1 -0.2 0.97", "1.0 0.0 0.1", "0.9 0.1 0.2"
    return f"{wrist} {hip} {ankle}\n" * n


def written(tmp_path, steps=STEPS, text=None, name="P001_Regular.txt"):
    if steps is not None:
        (tmp_path / "steps.txt").write_text(steps)
    path = tmp_path / name
    path.write_text(table() if text is None else text)
    return path


def test_a_walk_of_the_data_set(tmp_path):
    path = written(tmp_path)
    recording = read(path)
    assert recording.acc_g[0].tolist() == [0.1, -0.2, 0.97]
    assert np.allclose(recording.t_s, np.arange(60) / 15)
    assert recording.rate_hz == 15
    assert np.allclose(recording.step_t_s, [10 / 15, 18 / 15, 31 / 15])
    assert (recording.true_steps, recording.quality) == (3, "A")
    assert (recording.subject, recording.activity, recording.placement) == ("P001", "walk_regular", "wrist")


@pytest.mark.parametrize(
    ("name", "activity"),
    [
        ("P010_Semiregular.txt", "walk_semiregular"),
        ("P010_SemiRegular.txt", "walk_semiregular"),
        ("P030_Irregular.txt", "walk_irregular"),
        ("other.txt", None),
    ],
)
def test_the_gait_is_in_the_name(tmp_path, name, activity):
    assert read(written(tmp_path, name=name)).activity == activity


def test_only_the_table_is_a_recording(tmp_path):
    assert is_recording(written(tmp_path))
    assert not is_recording(tmp_path / "steps.txt")


def test_tabs_other_rates_and_shifts_beyond_the_end(tmp_path):
    """Two shifts of the data set lie behind the last sample."""
    path = written(tmp_path, steps="10\tright\n\n9233\trightshift\n", text=table().replace(" ", "\t"))
    assert read(path).true_steps == 1
    assert read(path, rate_hz=30).step_t_s.tolist() == [10 / 30]


@pytest.mark.parametrize(
    ("steps", "text", "says"),
    [
        (None, None, "no steps.txt beside them"),
        ("10 right\n60 left\n", None, "line 2: sample 60 of 60; a file is cut short"),
        ("10 both\n", None, "line 1: '10 both'"),
        ("ten right\n", None, "line 1: 'ten right'"),
        ("10\n", None, "line 1: '10'"),
        (STEPS, table() + "0.1 -0.2\n", "line 61: 2 columns, the header has 9"),
        (STEPS, table() + "0.1 -0.2 n 1 0 0 1 0 0\n", "line 61, column wrist_z: 'n'"),
        (STEPS, table().replace("0.97", "9.7"), "m/s²"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, steps, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, steps, text))
    assert says in error.value.why
