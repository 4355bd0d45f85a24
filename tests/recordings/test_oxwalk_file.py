"""OxWalk's CSV and stepcount's: stamps, marks, names of files, and what is wrong in them."""

from datetime import datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import RecordingError
from service.recordings import is_recording, read

HEADER = "timestamp,x,y,z,annotation\n"
START = datetime(2022, 12, 9, 10, 30)  # noqa: DTZ001  # as in the files: no zone


def rows(n=300, rate_hz=100, steps=(100, 160, 221), zone=""):
    return "".join(
        f"{START + timedelta(seconds=k / rate_hz):%Y-%m-%d %H:%M:%S.%f}{zone},-0.1,0.02,0.99,{int(k in steps)}\n"
        for k in range(n)
    )


def written(tmp_path, text, name="P07_wrist100.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("placement", ["wrist", "hip"])
@pytest.mark.parametrize("rate_hz", [100, 25])
def test_a_file_of_the_data_set(tmp_path, placement, rate_hz):
    path = written(tmp_path, HEADER + rows(rate_hz=rate_hz), f"P07_{placement}{rate_hz}.csv")
    recording = read(path)
    assert is_recording(path)
    assert (recording.placement, recording.subject, recording.rate_hz) == (placement, "P07", rate_hz)
    assert (recording.activity, recording.quality) == ("free_living", "A")
    assert np.allclose(recording.t_s, np.arange(300) / rate_hz)
    assert recording.acc_g[0].tolist() == [-0.1, 0.02, 0.99]
    assert recording.true_steps == 3
    assert np.allclose(recording.step_t_s, [100 / rate_hz, 160 / rate_hz, 221 / rate_hz])


def test_a_byte_order_mark_hides_nothing(tmp_path):
    path = written(tmp_path, "\ufeff" + HEADER + rows())
    assert is_recording(path)
    assert read(path).true_steps == 3


def test_an_hour_without_a_step_has_none(tmp_path):
    recording = read(written(tmp_path, HEADER + rows(steps=())))
    assert (recording.true_steps, len(recording.step_t_s)) == (0, 0)


def test_stepcounts_own_form_knows_no_steps(tmp_path):
    text = "time,x,y,z\n" + rows().replace(",0\n", "\n").replace(",1\n", "\n")
    recording = read(written(tmp_path, text, "sample.csv"))
    assert (len(recording), recording.true_steps, recording.step_t_s, recording.quality) == (300, None, None, None)
    assert recording.rate_hz == pytest.approx(100)


def test_a_repeated_stamp_loses_no_step(tmp_path):
    lines = rows(steps=(100,)).splitlines(keepends=True)
    lines.insert(101, lines[100].replace(",1\n", ",0\n"))
    lines[100], lines[101] = lines[101], lines[100]
    recording = read(written(tmp_path, HEADER + "".join(lines)))
    assert (len(recording), recording.true_steps) == (300, 1)


@pytest.mark.parametrize("zone", ["+00:00", "+0100", "Z", "+0100 [Europe/London]"])
def test_a_zone_changes_nothing(tmp_path, zone):
    assert np.allclose(read(written(tmp_path, HEADER + rows(zone=zone))).t_s, np.arange(300) / 100)


def test_summer_time_may_end_within(tmp_path):
    text = HEADER + "2022-10-30 01:59:59.990+01:00,0,0,1,0\n2022-10-30 01:00:00.000+00:00,0,0,1,0\n"
    assert read(written(tmp_path, text)).t_s.tolist() == [0.0, 0.01]


@settings(deadline=None)
@given(st.lists(st.integers(1, 10**9), min_size=1, max_size=20))
def test_irregular_stamps_are_kept_to_the_microsecond(tmp_path_factory, steps_us):
    after_us = np.cumsum([0, *steps_us])
    text = "".join(f"{START + timedelta(microseconds=int(us))},0,0,1,0\n" for us in after_us)
    recording = read(written(tmp_path_factory.mktemp("walk"), HEADER + text))
    assert np.allclose(recording.t_s, after_us / 1e6, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (rows(3) + "soon,0,0,1,0\n", "line 5: 'soon' is no date and time"),
        (rows(3) + "2022-12-09 10:30:00.030,0,zero,1,0\n", "line 5, column y: 'zero'"),
        (rows(3) + "2022-12-09 10:30:00.030,0,0,1,\n", "line 5, column annotation: ''"),
        (rows(3) + "2022-12-09 10:30:00.030,0,0,1,2\n", "annotation of sample 3 is 2"),
        (rows(3) + "2022-12-09 10:30:00.030,0,0\n", "line 5: 3 columns, the header has 5"),
        (rows(3) + "2022-12-09 10:30:00.030Z,0,0,1,0\n", "some stamps have a time zone"),
        (rows(3) + rows(3), "time does not rise at sample 3"),
        (rows(1), "1 sample;"),
        (rows(3).replace("0.99", "9.79"), "m/s²"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, HEADER + text))
    assert says in error.value.why


@pytest.mark.parametrize("text", ["timestamp,x,y,z\n0,0,0,1\n0.02,0,0,1\n", "timestamp,x,y,z,annotation\n"])
def test_without_dates_it_is_another_format(tmp_path, text):
    path = written(tmp_path, text)
    assert not is_recording(path)
    with pytest.raises(RecordingError, match="the header must be time_s"):
        read(path)
