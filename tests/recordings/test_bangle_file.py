"""Bangle.js logs: counts or g, the number of steps in the file's name, holes while the watch is still."""

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import is_recording, read

ROWS = "80,900,-1300,-8100\n160,760,-1150,-7990\n240,620,-1070,-7930\n"
HEADER = "Time (ms),X,Y,Z\n"


def written(folder, text, name="100.csv"):
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def minute(rest="0,0,8192"):
    return HEADER + "".join(f"{80 * k},{rest}\n" for k in range(750))


def test_counts_and_milliseconds(tmp_path):
    path = written(tmp_path, HEADER + ROWS)
    recording = read(path)
    assert is_recording(path)
    assert np.allclose(recording.t_s, [0.08, 0.16, 0.24])
    assert np.allclose(recording.acc_g[0], [900 / 8192, -1300 / 8192, -8100 / 8192])
    assert recording.rate_hz == pytest.approx(12.5)
    assert recording.placement == "wrist"


def test_newer_logs_may_hold_g_and_a_total(tmp_path):
    counts = read(written(tmp_path, minute("0,4096,8192,9159").replace("Z\n", "Z,Total\n")))
    in_g = read(written(tmp_path, minute("0,0.5,1.0,1.118").replace("Z\n", "Z,Total\n")))
    assert np.array_equal(counts.acc_g, in_g.acc_g)


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("100.csv", 100),
        ("100_5.csv", 100),
        ("0_HughB-static.csv", 0),
        ("accellog.0.csv", None),
        ("20220104.csv", None),
        ("301.csv", None),
        ("2022-01-04.csv", None),
    ],
)
def test_steps_stand_at_the_head_of_the_name(tmp_path, name, steps):
    """A minute holds 300 at most."""
    assert read(written(tmp_path, minute(), name)).true_steps == steps


@pytest.mark.parametrize(("folder", "quality"), [("controlled", "A"), ("uncontrolled", "B")])
def test_the_folder_says_who_counted(tmp_path, folder, quality):
    assert read(written(tmp_path / folder, minute(), "80.csv")).quality == quality
    assert read(written(tmp_path / folder, minute(), "log.csv")).quality is None


def test_a_hole_while_the_watch_is_still_stays_in_time(tmp_path):
    recording = read(written(tmp_path, HEADER + ROWS + "1040,623,-1072,-7930\n1120,623,-1072,-7930\n"))
    assert np.allclose(np.diff(recording.t_s), [0.08, 0.08, 0.8, 0.08])
    assert recording.rate_hz == pytest.approx(12.5)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEADER, "a header and no samples"),
        (HEADER + ROWS + "325,623,,-7930\n", "line 5, column y: ''"),
        (HEADER + ROWS + "325,623\n", "line 5: 2 columns, the header has 4"),
        (HEADER + ROWS + "5,623,-1072,-7930\n", "time does not rise at sample 3"),
        (HEADER + ROWS.replace(",-", ",-99"), "powers of two"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, text))
    assert says in error.value.why
