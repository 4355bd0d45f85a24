"""The paper's table: its own rows, other separators and headers, and stamps that contradict the rate."""

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import read

HEADER = "序号,X轴,Y轴,Z轴,年/月/日,时间\n"
ROWS = "58,-22,-5,16,2017/1/3,21:47:38:314\n59,-22,-6,16,2017/1/3,21:47:38:314\n60,-26,-10,17,2017/1/3,21:47:38:314\n"


def written(tmp_path, text, name="band.txt", encoding="utf-8"):
    path = tmp_path / name
    path.write_text(text, encoding=encoding)
    return path


def stamped(seconds, n=501, first=0):
    """`n` rows whose stamps spread over `seconds`."""
    times = [divmod(seconds * k / (n - 1), 60) for k in range(n)]
    return "".join(f"{first + k},0,0,32,2017/1/3,21:{int(m):02}:{int(s):02}:{int(s % 1 * 1000):03}\n"
                   for k, (m, s) in enumerate(times))  # fmt: skip


def test_the_rows_of_table_1(tmp_path):
    recording = read(written(tmp_path, HEADER + ROWS))
    assert recording.t_s.tolist() == [0, 0.02, 0.04]
    assert recording.acc_g.tolist() == [
        [-22 / 32, -5 / 32, 0.5],
        [-22 / 32, -6 / 32, 0.5],
        [-26 / 32, -10 / 32, 17 / 32],
    ]
    assert recording.rate_hz == 50


@pytest.mark.parametrize(
    "text",
    [
        ROWS,
        ROWS.replace(",", "\t"),
        ROWS.replace(",", "  "),
        "No,X,Y,Z,date,time\n" + ROWS,
        "\n" + ROWS.replace("/", "-"),
    ],
    ids=["bare", "tabs", "blanks", "English", "dashes"],
)
@pytest.mark.parametrize("name", ["band.txt", "band.csv", "band.tsv", "BAND.DAT"])
def test_separators_headers_and_endings(tmp_path, text, name):
    assert len(read(written(tmp_path, text, name))) == 3


@pytest.mark.parametrize("encoding", ["gb18030", "utf-8-sig"])
def test_a_chinese_header_in_either_encoding(tmp_path, encoding):
    assert len(read(written(tmp_path, HEADER + ROWS, encoding=encoding))) == 3


def test_scale_and_rate_may_be_declared(tmp_path):
    recording = read(written(tmp_path, ROWS), lsb_per_g=64, rate_hz=25)
    assert recording.acc_g[0, 0] == -22 / 64
    assert recording.t_s[1] == 0.04


def test_a_missing_index_is_missing_time(tmp_path):
    recording = read(written(tmp_path, ROWS.replace("60,-26", "63,-26")))
    assert recording.t_s.tolist() == [0, 0.02, 0.1]


@pytest.mark.parametrize("seconds", [10 - 2.5, 9.98, 10 + 2.5])
def test_stamps_that_jitter_are_no_contradiction(tmp_path, seconds):
    assert np.allclose(np.diff(read(written(tmp_path, stamped(seconds))).t_s), 0.02)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (stamped(20), "stamps span 20.0 s, the samples at 50 Hz 10.0 s; rate_hz=25 would fit"),
        (stamped(5), "rate_hz=100 would fit"),
        (ROWS + ROWS[:35], "time does not rise"),
        (ROWS + "61,-22\n", "line 4: '61,-22'; index, X, Y, Z, date, time are wanted"),
        (ROWS.replace("-22,-6", "-22,n"), "line 2"),
        (ROWS.replace("2017/1/3,21:47:38:314\n60", "2017/1/3,21:47:39:314\n60"), "row 3 is before that of row 2"),
        (ROWS.replace("2017/1/3", "2017/2/30"), "no date and time"),
        (ROWS.replace(",-", ",-11"), "powers of two"),
        (ROWS.split("\n", maxsplit=1)[0], "1 sample; at least 2"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, says):
    with pytest.raises(RecordingError) as error:
        read(written(tmp_path, text))
    assert says in error.value.why


def test_a_wrong_scale_says_which_was_used(tmp_path):
    with pytest.raises(RecordingError, match=r"read with lsb_per_g=4096"):
        read(written(tmp_path, ROWS), lsb_per_g=4096)
