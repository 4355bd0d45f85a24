"""Choosing the format, and no file that ends a program by anything but a RecordingError."""

import io
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from recordings.device_writers import cwa, gt3x

from service.errors import ParameterError, RecordingError
from service.recordings import Recording, is_recording, read, suffixes
from service.recordings.formats import FORMATS

CSV = b"time_s,x_g,y_g,z_g\n0,0,0,1\n0.02,0,0,1\n"
PAPER = b"58,-22,-5,16,2017/1/3,21:47:38:314\n59,-22,-6,16,2017/1/3,21:47:38:314\n"


def archive():
    file = io.BytesIO()
    np.savez_compressed(file, t=np.arange(9) / 50, acc=np.tile([0, 0, 1.0], (9, 1)), true_steps=1, placement="wrist")
    return file.getvalue()


NPZ = archive()
STILL = np.tile([0, 0, 1.0], (80, 1))
SOUND = {
    ".npz": NPZ,
    ".csv": CSV,
    ".txt": PAPER,
    ".tsv": PAPER,
    ".dat": PAPER,
    ".cwa": cwa(STILL),
    ".gt3x": gt3x(STILL),
}
TEXTS = {
    "paper": PAPER,
    "oxwalk": b"timestamp,x,y,z,annotation\n2022-12-09 10:30:00.00,0,0,1,0\n2022-12-09 10:30:00.01,0,0,1,1\n",
    "bangle": b"Time (ms),X,Y,Z\n80,0,0,8192\n160,0,0,8192\n",
    "clemson": b"0 0 1 0 0 1 0 0 1\n0 0 1 0 0 1 0 0 1\n",
    "oxford": b"5000000000000,3,0.0,0.0,9.8\n5000010000000,3,0.0,0.0,9.8\n",
    "csv": CSV,
}
BESIDE = {
    "steps.txt": b"0 right\n",
    "stepcounter.csv": b"5000000000000,0,0\n5000001000000,1,0\n",
    "notes.txt": b"1 steps\n",
}
"""What some formats need beside them; none of these is a recording itself."""


def read_bytes(content, suffix):
    with tempfile.TemporaryDirectory() as folder:
        for name, beside in BESIDE.items():
            Path(folder, name).write_bytes(beside)
        path = Path(folder, "file" + suffix)
        path.write_bytes(content)
        return read(path)


def test_every_ending_has_a_sound_file():
    assert set(SOUND) == suffixes()
    for suffix, content in SOUND.items():
        assert len(read_bytes(content, suffix)) in (2, 9, 60, 80)


def test_every_format_of_text_has_a_sound_file_that_no_other_takes():
    texts = [known for known in FORMATS if set(known.suffixes) & {".csv", ".txt"}]
    assert {known.name for known in texts} == set(TEXTS)
    for name, content in TEXTS.items():
        assert [known.name for known in texts if known.meant(content)] == [name]
        assert next(known.name for known in texts if known.recognises(content)) == name
        assert len(read_bytes(content, ".txt")) == 2


def test_what_lies_beside_a_recording_is_none(tmp_path):
    for name, content in BESIDE.items():
        (tmp_path / name).write_bytes(content)
        assert not is_recording(tmp_path / name)


def test_names_of_formats_are_unique():
    assert len({known.name for known in FORMATS}) == len(FORMATS)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.xlsx", b"PK", "unknown ending '.xlsx'; known are .csv, .cwa, .dat, .gt3x, .npz, .tsv, .txt"),
        ("a", CSV, "unknown ending ''"),
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b" \n ", "the file is empty"),
        ("a.npz", CSV, "the content is not what the ending '.npz' says (npz)"),
        ("a.csv", NPZ, "the content is not what the ending '.csv' says (paper or oxwalk or bangle or oxford or csv)"),
        ("a.tsv", CSV, "(paper)"),
    ],
)
def test_what_cannot_be_is_named(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError) as error:
        read(tmp_path / name)
    assert says in error.value.why


def test_no_file_and_no_file_but_a_folder(tmp_path):
    (tmp_path / "b.csv").mkdir()
    with pytest.raises(RecordingError, match="No such file"):
        read(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match="no such file"):
        read(tmp_path / "a")
    with pytest.raises(RecordingError, match="directory"):
        read(tmp_path / "b.csv")


@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["lsb_per_g", "rate_hz"])
def test_a_rate_or_scale_must_be_above_zero(tmp_path, name, value):
    with pytest.raises(ParameterError, match=name):
        read(tmp_path / "a.csv", **{name: value})


def harmless(content, suffix):
    try:
        assert isinstance(read_bytes(content, suffix), Recording)
    except RecordingError as error:
        assert error.why


@settings(deadline=None)
@given(st.binary(max_size=300), st.sampled_from(sorted(SOUND)))
def test_any_bytes_are_a_recording_or_an_error(content, suffix):
    harmless(content, suffix)


@settings(deadline=None)
@given(st.sampled_from([*SOUND.items(), *((".txt", text) for text in TEXTS.values())]), st.data())
def test_damage_to_a_sound_file_too(sound, data):
    suffix, content = sound[0], bytearray(sound[1])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
        if not content:
            break
    harmless(bytes(content), suffix)


@settings(deadline=None)
@given(st.text("0123456789.,-+e \n:/#nainf\t", max_size=200))
@example("1e308,0,0,1\n-1e308,0,0,1\n")
def test_text_that_nearly_counts(text):
    harmless(b"time_s,x_g,y_g,z_g\n" + text.encode(), ".csv")
    for sound in TEXTS.values():
        harmless(sound + text.encode(), ".txt")


@pytest.mark.full
def test_every_real_recording_is_read(recordings):
    count = sum(1 for path in recordings.rglob("*.npz") if len(read(path)) > 1)
    assert count >= 993
