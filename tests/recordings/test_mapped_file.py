"""Tables whose columns the caller names: units, separators, headers or none, and words that name nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import ParameterError, RecordingError
from service.recordings import ColumnMapping, TimeUnit, Unit, column_mapping, is_recording, read
from service.recordings.formats import FORMATS
from service.recordings.mapped_file import PER_G, PER_S, SUFFIXES

TEXT = "t,note,ax,ay,az\n0,rest,0,0.1,1\n20,,0,0.2,1\n40,,0,0.3,1\n"
MAPPING = column_mapping("time=t,x=ax,y=ay,z=az", time_unit="ms")


def written(tmp_path, text, name="log.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_by_name(tmp_path):
    path = written(tmp_path, TEXT)
    recording = read(path, mapping=MAPPING)
    assert recording.t_s.tolist() == [0, 0.02, 0.04]
    assert recording.acc_g.tolist() == [[0, 0.1, 1], [0, 0.2, 1], [0, 0.3, 1]]
    assert recording.rate_hz == pytest.approx(50)
    assert recording.true_steps is None
    assert is_recording(path, MAPPING)
    assert not is_recording(path)


@pytest.mark.parametrize("columns", ["time=1,x=3,y=4,z=5", "TIME = T, x = AX, y = 4, z = az"])
def test_columns_by_number_and_in_any_case(tmp_path, columns):
    mapping = column_mapping(columns, "g", "ms")
    assert read(written(tmp_path, TEXT), mapping=mapping).acc_g[2].tolist() == [0, 0.3, 1]


@pytest.mark.parametrize("top", ["t,x,y,z\n", "", "\ufefft,x,y,z\n", "\n\nt,x,y,z\n"], ids=repr)
def test_with_and_without_a_header(tmp_path, top):
    path = written(tmp_path, top + "0,0,0,1\n1,0,0,1\n2,0,0,1\n")
    mapping = column_mapping("time=1,x=2,y=3,z=4")
    assert len(read(path, mapping=mapping)) == 3
    assert is_recording(path, mapping)


@pytest.mark.parametrize(
    "text",
    [
        "t;x;y;z\n0;0,5;0;1\n1;0,5;0;1\n",
        "t;x;y;z\n0;0.5;0;1\n1;0.5;0;1\n",
        "t\tx\ty\tz\n0\t0.5\t0\t1\n1\t0.5\t0\t1\n",
        "t  x y z\n0  0.5 0 1\n1  0.5 0 1\n",
    ],
    ids=["decimal commas", "semicolons", "tabs", "blanks"],
)
def test_separators(tmp_path, text):
    path = written(tmp_path, text, "log.dat")
    mapping = column_mapping("time=t,x=x,y=y,z=z")
    assert read(path, mapping=mapping).acc_g.tolist() == [[0.5, 0, 1], [0.5, 0, 1]]
    assert is_recording(path, mapping)


@settings(deadline=None)
@given(st.sampled_from(Unit), st.sampled_from(TimeUnit), st.integers(0, 10**6))
def test_every_unit_gives_g_and_seconds(tmp_path_factory, unit, time_unit, start_s):
    t_s, acc_g = np.arange(5) / 50, np.tile([0.25, -0.5, 1.0], (5, 1))
    rows = np.column_stack([(start_s + t_s) * PER_S[time_unit], acc_g * PER_G[unit]]).tolist()
    text = "t,x,y,z\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    mapping = ColumnMapping(time="t", x="x", y="y", z="z", unit=unit, time_unit=time_unit)
    recording = read(written(tmp_path_factory.mktemp("log"), text), mapping=mapping)
    assert np.allclose(recording.acc_g, acc_g)
    assert np.allclose(recording.t_s, t_s, atol=1e-8)


def test_dates_are_times(tmp_path):
    text = "when,x,y,z\n2024-01-01T10:00:00.000,0,0,1\n2024-01-01T10:00:00.040,0,0,1\n"
    mapping = column_mapping("time=when,x=x,y=y,z=z", time_unit="ms")
    assert read(written(tmp_path, text), mapping=mapping).t_s.tolist() == [0, 0.04]


def test_without_a_time_a_rate_makes_it(tmp_path):
    mapping = column_mapping("x=ax,y=ay,z=az")
    path = written(tmp_path, TEXT)
    assert read(path, mapping=mapping, rate_hz=20).t_s.tolist() == [0, 0.05, 0.1]
    with pytest.raises(RecordingError, match="no column of time is named and no rate declared"):
        read(path, mapping=mapping)


def test_what_is_no_text_says_itself_what_it_holds(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(9) / 50, acc=np.tile([0, 0, 1.0], (9, 1)))
    assert len(read(tmp_path / "a.npz", mapping=MAPPING)) == 9
    assert is_recording(tmp_path / "a.npz", MAPPING)


def test_every_ending_of_text_is_one_that_is_read():
    assert set(SUFFIXES) <= {suffix for known in FORMATS for suffix in known.suffixes}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the file is empty"),
        (TEXT.replace("ay", "by"), "line 1: no column ay; there are t, note, ax, by, az"),
        (TEXT + "60,,0,soon,1\n", "line 5, column ay: 'soon'"),
        (TEXT + "60,,0\n", "line 5: 3 columns, the header has 5"),
        (TEXT + "soon,,0,0,1\n", "line 5, column t: 'soon'"),
        (TEXT + "20,,0,0,1\n", "time does not rise"),
        (TEXT.split("\n", maxsplit=1)[0], "no samples"),
        (TEXT.replace(",1\n", ",9.8\n"), "m/s²"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, text), mapping=MAPPING)
    assert says in error.value.why


WITH_ALL = "t,ax,ay,az,gx,gy,gz,mx,my,mz,s\n" + "".join(
    f"{20 * k},0,0,1,{90 * k},0,-90,{k},20,-40,{step}\n" for k, step in enumerate([0, 1, 0, 0, 1])
)
ALL = "time=t,x=ax,y=ay,z=az,gx=gx,gy=gy,gz=gz,mx=mx,my=my,mz=mz,steps=s"


def test_every_sensor_and_the_steps_may_be_named(tmp_path):
    recording = read(written(tmp_path, WITH_ALL), mapping=column_mapping(ALL, "g", "ms", "deg/s"))
    assert recording.gyro_rad_s[2] == pytest.approx([np.pi, 0, -np.pi / 2])
    assert recording.mag_ut[3].tolist() == [3, 20, -40]
    assert recording.step_t_s.tolist() == [0.02, 0.08]
    assert recording.true_steps == 2
    radians = read(written(tmp_path, WITH_ALL), mapping=column_mapping(ALL, "g", "ms"))
    assert radians.gyro_rad_s[2].tolist() == [180, 0, -90]


@pytest.mark.parametrize(
    ("told", "step_t_s"),
    [
        ([0, 1, 0, 0, 1], [0.02, 0.08]),
        ([1, 0, 0, 0, 0], [0.0]),
        ([7, 8, 8, 9, 9], [0.02, 0.06]),
        ([0, 0, 2, 2, 2], [0.04, 0.04]),
        ([0, 0, 0, 0, 0], []),
    ],
    ids=str,
)
def test_steps_are_marks_or_a_running_number(tmp_path, told, step_t_s):
    text = "t,x,y,z,s\n" + "".join(f"{20 * k},0,0,1,{step}\n" for k, step in enumerate(told))
    recording = read(written(tmp_path, text), mapping=column_mapping("time=t,x=x,y=y,z=z,steps=s", time_unit="ms"))
    assert recording.step_t_s.tolist() == pytest.approx(step_t_s)


@pytest.mark.parametrize("told", [[0, 2, 0], [0, 0.5, 1], [0, 5, 90]], ids=str)
def test_steps_that_are_neither_are_refused(tmp_path, told):
    text = "t,x,y,z,s\n" + "".join(f"{20 * k},0,0,1,{step}\n" for k, step in enumerate(told))
    with pytest.raises(RecordingError, match="steps: "):
        read(written(tmp_path, text), mapping=column_mapping("time=t,x=x,y=y,z=z,steps=s", time_unit="ms"))


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "", "t,note,ax,ay,az\nsoon,,n,n,n\n", "\0\1"])
def test_a_text_without_the_columns_is_passed_over(tmp_path, text):
    """An empty file is not: to read it says what is wrong."""
    assert is_recording(written(tmp_path, text), MAPPING) == (text == "")


@pytest.mark.parametrize(
    "words",
    [
        ("x=ax,y=ay",),
        ("x=ax,y=ay,z=",),
        ("x=ax,y=ay,z=az,w=aw",),
        ("x=ax,y=ay,z=az,x=bx",),
        ("x=a,y=a,z=b",),
        ("",),
        ("x=ax,y=ay,z=az", "ft/s2"),
        ("x=ax,y=ay,z=az", "g", "h"),
        ("x=ax,y=ay,z=az", "g", "s", "rpm"),
        ("x=ax,y=ay,z=az,gx=gx",),
        ("x=ax,y=ay,z=az,mx=mx,mz=mz",),
    ],
)
def test_words_that_name_nothing_are_refused(words):
    with pytest.raises(ParameterError):
        column_mapping(*words)


@settings(deadline=None)
@given(st.text("0123456789.,;-:T \n\tnt\0", max_size=120), st.sampled_from(["1", "2", "t"]))
def test_any_text_is_a_recording_or_an_error(tmp_path_factory, text, time):
    path = written(tmp_path_factory.mktemp("log"), text)
    mapping = ColumnMapping(time=time, x="2", y="3", z="4")
    is_recording(path, mapping)
    try:
        assert len(read(path, mapping=mapping)) > 1
    except RecordingError as error:
        assert error.why
