"""Axivity's and ActiGraph's files: values, times, pauses, clocks that run fast, and files that are none."""

import builtins
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings.device_writers import cwa, gt3x

from service.errors import RecordingError
from service.recordings import device_file, read

RNG = np.random.default_rng(7)


def walk(n):
    """Return `n` samples about 1 g in steps of 1/256 g, which both formats hold exactly."""
    return np.round(RNG.normal((0, 0, 1), 0.2, (n, 3)) * 256) / 256


def written(tmp_path, content, name):
    path = tmp_path / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("rate_hz", [12.5, 25, 50, 100])
def test_axivity_values_and_times(tmp_path, rate_hz):
    acc_g = walk(240)
    recording = read(written(tmp_path, cwa(acc_g, rate_hz=rate_hz), "a.cwa"))
    assert np.array_equal(recording.acc_g, acc_g)
    assert np.allclose(recording.t_s, np.arange(240) / rate_hz, atol=1e-4)
    assert recording.rate_hz == rate_hz
    assert recording.gyro_rad_s is None


def test_axivity_with_a_gyroscope(tmp_path):
    gyro_dps = np.tile([125.0, -250.0, 0.0], (120, 1))
    recording = read(written(tmp_path, cwa(walk(120), gyro_dps=gyro_dps), "A.CWA"))
    assert np.allclose(recording.gyro_rad_s, np.deg2rad(gyro_dps))


@pytest.mark.parametrize("clock", [0.95, 0.99, 1.0, 1.01, 1.05])
def test_a_sensor_clock_that_is_off_gives_even_times(tmp_path, clock):
    """Blocks are stamped by the device's clock, their samples taken by the sensor's."""
    stamps_s = np.arange(6) * 0.8 / clock
    recording = read(written(tmp_path, cwa(walk(480), stamps_s=stamps_s), "a.cwa"))
    spacing_s = np.diff(recording.t_s)
    assert (spacing_s > 0).all()
    # The last block has no next one to tell its clock.
    assert np.allclose(spacing_s[:399], 0.01 / clock, atol=1e-5)
    assert np.allclose(recording.t_s[::80], stamps_s, atol=1e-4)
    assert recording.rate_hz == 100


def test_a_pause_stays_one(tmp_path):
    recording = read(written(tmp_path, cwa(walk(240), stamps_s=[0, 0.8, 60.0]), "a.cwa"))
    gaps_s = np.diff(recording.t_s)
    assert np.flatnonzero(gaps_s > 0.02).tolist() == [159]
    assert recording.t_s[160] == pytest.approx(60.0)
    assert np.allclose(np.delete(gaps_s, 159), 0.01, atol=1e-4)


def test_what_the_owner_wrote_into_it(tmp_path):
    recording = read(written(tmp_path, cwa(walk(80), annotation="_p=Left+wrist&_sc=12"), "a.cwa"))
    assert (recording.placement, recording.subject) == ("left wrist", "12")
    bare = read(written(tmp_path, cwa(walk(80)), "b.cwa"))
    assert (bare.placement, bare.subject) == (None, None)


@pytest.mark.parametrize("rate_hz", [30, 50, 100])
def test_actigraph_values_and_times(tmp_path, rate_hz):
    acc_g = walk(5 * rate_hz)
    recording = read(written(tmp_path, gt3x(acc_g, rate_hz=rate_hz), "a.gt3x"))
    assert np.array_equal(recording.acc_g, acc_g)
    assert np.allclose(recording.t_s, np.arange(5 * rate_hz) / rate_hz, atol=1e-6)
    assert (recording.rate_hz, recording.placement, recording.subject) == (rate_hz, "left wrist", "P7")


def test_actigraph_seconds_asleep_are_a_hole(tmp_path):
    recording = read(written(tmp_path, gt3x(walk(150), missing_s=(2, 3)), "a.gt3x"))
    assert len(recording) == 90
    assert np.allclose(recording.t_s[58:62], [58 / 30, 59 / 30, 4.0, 4 + 1 / 30], atol=1e-6)


@pytest.mark.parametrize("seconds", [(0, 1, 2), (1,)])
@pytest.mark.parametrize(("kind", "name"), [(26, "ACTIVITY2"), (27, "ACTIVITY3")])
def test_a_file_that_the_library_would_read_in_part_is_refused(tmp_path, seconds, kind, name):
    """Without the check, one such record in the middle is a hole, and nobody is told."""
    with pytest.raises(
        RecordingError, match=f"it holds {name} records, which actfast would leave out.*export it as CSV"
    ):
        read(written(tmp_path, gt3x(walk(90), activity2=seconds, kind=kind), "a.gt3x"))


def test_a_file_without_acceleration_is_no_empty_recording(tmp_path):
    with pytest.raises(RecordingError, match="no acceleration that actfast knows; export it as CSV"):
        read(written(tmp_path, gt3x(walk(90), missing_s=(0, 1, 2)), "a.gt3x"))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.cwa", cwa(walk(80))[:1024], "no acceleration"),
        ("a.cwa", cwa(walk(80))[:1024] + b"\0" * 512, "actfast cannot read it: .*sector magic"),
        ("a.cwa", cwa(walk(80) * 0.1), "the median norm is 0.1"),
        ("a.gt3x", gt3x(walk(30))[:200], "actfast cannot read it"),
        ("a.gt3x", cwa(walk(80)), r"the content is not what the ending '.gt3x' says \(gt3x\)"),
        ("a.cwa", gt3x(walk(30)), r"\(cwa\)"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, name, content, says):
    with pytest.raises(RecordingError, match=says):
        read(written(tmp_path, content, name))


def one_axis_short():
    """Return a file whose block claims two axes of two bytes, its checksum right."""
    content = bytearray(cwa(walk(80)))
    content[1024 + 25] = 0x22
    total = sum(struct.unpack_from("<255H", content, 1024)) & 0xFFFF
    struct.pack_into("<H", content, 1024 + 510, -total & 0xFFFF)
    return bytes(content)


def test_a_file_that_makes_the_library_panic_ends_in_an_error(tmp_path):
    """What Rust raises then is no Exception, and would end a program."""
    with pytest.raises(RecordingError, match="the file is damaged: index out of bounds"):
        read(written(tmp_path, one_axis_short(), "a.cwa"))


def test_an_interrupt_while_reading_stays_one(tmp_path, monkeypatch):
    def interrupted(_path):
        raise KeyboardInterrupt

    monkeypatch.setattr("actfast.read", interrupted)
    with pytest.raises(KeyboardInterrupt):
        read(written(tmp_path, cwa(walk(80)), "a.cwa"))


def test_without_the_library_the_error_says_how_to_get_it(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **more):
        if name == "actfast":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecordingError, match=r"pip install 'steplink\[devices\]'"):
        read(written(tmp_path, cwa(walk(80)), "a.cwa"))


def test_a_machine_without_the_memory_gets_an_error_and_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(device_file, "RESERVED_BYTES", (1 << 62,))
    with pytest.raises(RecordingError, match="which this machine refuses"):
        read(written(tmp_path, gt3x(walk(30)), "a.gt3x"))


SOUND = {"a.cwa": cwa(walk(240)), "a.gt3x": gt3x(walk(60))}


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(sorted(SOUND)), st.data())
def test_damage_ends_in_an_error_or_a_recording(tmp_path_factory, name, data):
    content = bytearray(SOUND[name])
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
    try:
        assert len(read(written(tmp_path_factory.mktemp("damaged"), bytes(content), name))) > 1
    except RecordingError as error:
        assert error.why
