"""CSV: the header's units, a declared rate, errors with line and column, and a round trip to the bit."""

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from service.errors import RecordingError
from service.recordings import Recording, read, write_csv

GOOD = "time_s,x_g,y_g,z_g\n0,0,0,1\n0.02,0,0,1.1\n0.04,0,0,0.9\n"


def written(tmp_path, text, name="walk.csv"):
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


@pytest.mark.parametrize("text", [GOOD, "\ufeff" + GOOD, GOOD.replace("\n", "\r\n"), "\n" + GOOD + "\n\n"], ids=repr)
def test_the_plain_form(tmp_path, text):
    recording = read(written(tmp_path, text))
    assert recording.t_s.tolist() == [0, 0.02, 0.04]
    assert recording.acc_g[:, 2].tolist() == [1, 1.1, 0.9]
    assert recording.rate_hz == pytest.approx(50)
    assert recording.true_steps is None


def test_columns_go_by_name(tmp_path):
    text = (
        '"Z_g", note ,x_g,y_g,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,time_s\n1,rest,.1,.2,7,8,9,0\n1,,.1,.2,7,8,9,1\n'
    )
    recording = read(written(tmp_path, text))
    assert recording.acc_g[0].tolist() == [0.1, 0.2, 1]
    assert recording.gyro_rad_s[1].tolist() == [7, 8, 9]
    assert recording.mag_ut is None


def test_what_is_known_stands_above_the_header(tmp_path):
    about = "# rate_hz: 25\n# true_steps: 2\n# step_t_s: 0.01 0.03\n# placement: left wrist\n#note\n"
    recording = read(written(tmp_path, about + GOOD))
    assert (recording.rate_hz, recording.true_steps, recording.placement) == (25, 2, "left wrist")
    assert recording.step_t_s.tolist() == [0.01, 0.03]
    assert recording.t_s[1] == 0.02, "stamps come before the nominal rate"


def test_without_time_a_rate_makes_it(tmp_path):
    text = "x_g,y_g,z_g\n0,0,1\n0,0,1\n0,0,1\n"
    assert read(written(tmp_path, text), rate_hz=10).t_s.tolist() == [0, 0.1, 0.2]
    assert read(written(tmp_path, "# rate_hz: 4\n" + text), rate_hz=10).t_s.tolist() == [0, 0.25, 0.5]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x_g,y_g,z_g\n0,0,1\n0,0,1\n", "no column time_s and no rate"),
        ("time_s,x_g,z_g\n0,0,1\n", "line 1: no column y_g"),
        ("0,0,0,1\n0.02,0,0,1\n", "line 1: no column x_g, y_g, z_g; the header must be time_s,x_g,y_g,z_g"),
        (GOOD + "0.06,0,abc,1\n", "line 5, column y_g: 'abc' is no finite number"),
        (GOOD + "\n0.06,0,0,\n", "line 6, column z_g: ''"),
        (GOOD + "0.06,nan,0,1\n", "line 5, column x_g: 'nan'"),
        (GOOD + "1e999,0,0,1\n", "line 5, column time_s: '1e999'"),
        (GOOD + "0.06,0\n", "line 5: 2 columns, the header has 4"),
        (GOOD + "0.01,0,0,1\n", "time does not rise at sample 3"),
        ("time_s,x_g,y_g,z_g\n", "a header and no samples"),
        ("# rate_hz: 50\n", "no header"),
        ("time_s,x_g,y_g,z_g\n0,0,0,1\n", "1 sample; at least 2"),
        (GOOD.replace("1.1", "9.9").replace(",1\n", ",9.81\n").replace("0.9", "9.7"), "m/s²"),
        ("# rate_hz: fast\n" + GOOD, "'fast' is no rate"),
        ("# true_steps: 1.5\n" + GOOD, "'1.5' is no whole number"),
        ("# steps_range: 80\n" + GOOD, "'80'; two whole numbers"),
        ("# step_t_s: 1,2\n" + GOOD, "'1,2' is no time"),
        (b"time_s,x_g,y_g,z_g\n\xff", "byte 19 is no UTF-8"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, text))
    assert says in error.value.why


def triples(n, limit):
    return hnp.arrays(np.float64, (n, 3), elements=st.floats(-limit, limit))


@st.composite
def recordings(draw):
    n = draw(st.integers(2, 30))
    steps_s = draw(hnp.arrays(np.float64, n, elements=st.floats(0.001, 10)))
    steps = draw(st.none() | st.lists(st.floats(0, 1e6), max_size=5).map(sorted))
    words = st.none() | st.text(st.characters(exclude_categories=["C", "Z"]))
    return Recording(
        path=Path("x"),
        t_s=np.cumsum(steps_s),
        acc_g=draw(triples(n, 0.3)) + np.array([0, 0, 1]),
        rate_hz=draw(st.floats(0.1, 1e4)),
        gyro_rad_s=draw(st.none() | triples(n, 1e9)),
        mag_ut=draw(st.none() | triples(n, 1e9)),
        step_t_s=None if steps is None else np.array(steps, dtype=np.float64),
        true_steps=draw(st.none() | st.integers(0, 10**9)),
        steps_range=draw(st.none() | st.tuples(st.integers(0, 100), st.integers(100, 10**9))),
        **{name: draw(words) for name in ("placement", "activity", "subject", "quality")},
    )


@settings(deadline=None)
@given(recordings())
def test_a_round_trip_gives_the_same_bits(recording):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "walk.csv")
        write_csv(recording, path)
        again = read(path)
    for name in ("t_s", "acc_g", "gyro_rad_s", "mag_ut", "step_t_s"):
        before, after = getattr(recording, name), getattr(again, name)
        assert (before is None) == (after is None), name
        assert before is None or np.array_equal(before, after), name
    for name in ("rate_hz", "true_steps", "steps_range", "placement", "activity", "subject", "quality"):
        assert getattr(recording, name) == getattr(again, name), name


def test_what_a_line_cannot_hold_becomes_a_blank(tmp_path):
    recording = read(written(tmp_path, GOOD))
    write_csv(dataclasses.replace(recording, placement=" left\n# true_steps: 9\0 wrist "), tmp_path / "again.csv")
    again = read(tmp_path / "again.csv")
    assert again.placement == "left # true_steps: 9 wrist"
    assert again.true_steps is None
