"""The Oxford step counter's folders and validation files: units, switches, notes, and a truth that is not trusted."""

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import is_recording, read

ZERO_NS = 5_000_000_000_000
WALK = "Pixel_Ann_Hard_InHand_1"


def accelerometer(n=1200, rate_hz=100):
    return "".join(f"{ZERO_NS + k * 10**9 // rate_hz},3,0.0,0.0,9.80665\r\n" for k in range(n))


def switches(left_s, right_s, until_s=12.0):
    """Return the rows of both switches every 0.1 s, each closed for 0.3 s after its steps."""
    times = np.arange(1, until_s * 10) / 10
    closed = [[any(0 <= t - step < 0.25 for step in steps) for t in times] for steps in (left_s, right_s)]
    return "".join(
        f"{ZERO_NS + round(t * 1e9)},{int(left)},{int(right)}\n"
        for t, left, right in zip(times, *closed, strict=True)
    )  # fmt: skip


LEFT_S = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
RIGHT_S = [step + 0.5 for step in LEFT_S]


def folder(tmp_path, name=WALK, **files):
    place = tmp_path / name
    place.mkdir()
    for stem, text in ({"accelerometer": accelerometer()} | files).items():
        (place / f"{stem}.{'txt' if stem == 'notes' else 'csv'}").write_text(text, newline="")
    return place / "accelerometer.csv"


def test_a_walk_of_the_data_set(tmp_path):
    path = folder(tmp_path, stepcounter=switches(LEFT_S, RIGHT_S), notes="17 steps")
    recording = read(path)
    assert np.allclose(recording.acc_g[0], [0, 0, 1])
    assert np.allclose(recording.t_s, np.arange(1200) / 100)
    assert recording.rate_hz == pytest.approx(100)
    assert np.allclose(recording.step_t_s, sorted(LEFT_S + RIGHT_S))
    assert (recording.true_steps, recording.quality) == (18, "A"), "switches come before notes"
    assert (recording.subject, recording.placement, recording.activity) == ("Ann", "hand", "walk_hard_floor")


def test_only_the_accelerometer_is_a_recording(tmp_path):
    path = folder(tmp_path, stepcounter=switches(LEFT_S, RIGHT_S), notes="17 steps")
    assert [other.name for other in path.parent.iterdir() if is_recording(other)] == ["accelerometer.csv"]


@pytest.mark.parametrize(
    ("name", "placement", "activity"),
    [
        ("Samsung_Bo_Hard_Backpocket_2", "back_pocket", "walk_hard_floor"),
        ("Samsung_Bo_Carpet_Purse_2", "bag", "walk_carpet_floor"),
        ("Samsung_Bo_Hard_SwingingArm_10", "hand_swinging", "walk_hard_floor"),
        ("Samsung_Bo_Hard_Shoe_1", None, "walk_hard_floor"),
        ("_Patient_1", None, None),
    ],
)
def test_the_folder_says_where_the_phone_was(tmp_path, name, placement, activity):
    recording = read(folder(tmp_path, name))
    assert (recording.placement, recording.activity) == (placement, activity)
    assert (recording.true_steps, recording.step_t_s, recording.quality) == (None, None, None)


LONG_S = [float(second) for second in range(1, 29)]
LONG_RIGHT_S = [step + 0.5 for step in LONG_S]


def bouncing(steps, bounces):
    """Return `steps` with a second contact after 0.4 s at the first `bounces` of them."""
    return sorted(steps + [step + 0.4 for step in steps[:bounces]])


@pytest.mark.parametrize(
    ("left_s", "right_s"),
    [
        (bouncing(LONG_S, 3), bouncing(LONG_RIGHT_S, 2)),
        ([step for step in LONG_S if not 3.5 < step < 6.5], LONG_RIGHT_S),
        (LONG_S[:24], LONG_RIGHT_S),
    ],
    ids=["five bounces", "three strides left out", "feet four steps apart"],
)
def test_switches_not_to_be_trusted_give_a_number_and_no_times(tmp_path, left_s, right_s):
    recording = read(folder(tmp_path, stepcounter=switches(left_s, right_s, 30.0)))
    assert (recording.true_steps, recording.step_t_s, recording.quality) == (len(left_s) + len(right_s), None, "B")


@pytest.mark.parametrize(
    ("left_s", "right_s"),
    [
        (bouncing(LONG_S, 2), bouncing(LONG_RIGHT_S, 2)),
        ([step for step in LONG_S if not 3.5 < step < 5.5], LONG_RIGHT_S),
        (LONG_S[:25], LONG_RIGHT_S),
    ],
    ids=["four bounces", "two strides left out", "feet three steps apart"],
)
def test_a_little_less_is_trusted(tmp_path, left_s, right_s):
    recording = read(folder(tmp_path, stepcounter=switches(left_s, right_s, 30.0)))
    assert np.allclose(recording.step_t_s, sorted(left_s + right_s))
    assert recording.quality == "A"


@pytest.mark.parametrize(
    ("notes", "steps"),
    [("614 steps", 614), ("steps 317", 317), ("right hand 301 Steps", 301), ("had to stop", None), ("", None)],
)
@pytest.mark.parametrize("worn", [True, False])
def test_without_switches_the_notes_count(tmp_path, notes, steps, worn):
    open_ones = {"stepcounter": switches([], [])} if worn else {}
    recording = read(folder(tmp_path, notes=notes, **open_ones))
    assert (recording.true_steps, recording.quality) == (steps, None if steps is None else "B")


def validation(counts, name="user1_neckpouch_1506422851785.csv"):
    rows = [f"{ZERO_NS + k * 10**7},0.0,9.80665,0.0,{k},{count},0" for k, count in enumerate(counts)]
    return name, "\n".join(rows)


def test_a_validation_file_holds_all_in_one(tmp_path):
    name, text = validation([4, 4, 5, 5, 7, 7])
    (tmp_path / name).write_text(text)
    recording = read(tmp_path / name)
    assert is_recording(tmp_path / name)
    assert np.allclose(recording.acc_g[0], [0, 1, 0])
    assert np.allclose(recording.step_t_s, [0.02, 0.04, 0.04])
    assert (recording.true_steps, recording.subject, recording.placement) == (3, "user1", "neck_pouch")


@pytest.mark.parametrize("counts", [[0, 1, 0], [0, 400]])
def test_a_count_that_falls_or_leaps_is_refused(tmp_path, counts):
    name, text = validation(counts)
    (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match="the true steps change by"):
        read(tmp_path / name)


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({"accelerometer": accelerometer(3) + "5000030000000,3,0.0,x,9.8\n"}, "line 4, column y: 'x'"),
        ({"accelerometer": accelerometer(3) + "5000030000000,3,0.0\n"}, "line 4: 3 columns"),
        ({"accelerometer": accelerometer(3) + accelerometer(3)}, "time does not rise at sample 3"),
        ({"accelerometer": accelerometer().replace("9.80665", "0.1")}, "median norm"),
        ({"stepcounter": "5000000000000,1\n"}, "line 1: 2 columns"),
        ({"stepcounter": ""}, "no samples"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, files, says):
    with pytest.raises(RecordingError) as error:
        read(folder(tmp_path, **files))
    assert says in error.value.why
