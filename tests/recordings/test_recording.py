"""A Recording refuses what a counter would choke on, and says what and where."""

from pathlib import Path

import numpy as np
import pytest

from service.errors import RecordingError
from service.recordings import Recording
from service.recordings.recording import median_rate_hz, merge_repeated_stamps, spread_stamps


def made(**changes):
    acc_g = np.tile([0.0, 0.0, 1.0], (10, 1))
    given = {"path": Path("walk.npz"), "t_s": np.arange(10) / 50, "acc_g": acc_g, "rate_hz": 50.0}
    return Recording(**(given | changes))


def changed(row, axis, value):
    acc_g = np.tile([0.0, 0.0, 1.0], (10, 1))
    acc_g[row, axis] = value
    return acc_g


def test_a_sound_recording_knows_its_length():
    recording = made()
    assert len(recording) == 10
    assert recording.duration_s == pytest.approx(0.18)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"acc_g": changed(3, 1, np.nan)}, "acc y of sample 3 (at 0.060 s) is nan"),
        ({"acc_g": changed(9, 2, np.inf)}, "acc z of sample 9"),
        ({"gyro_rad_s": changed(2, 0, -np.inf)}, "gyro x of sample 2"),
        ({"mag_ut": changed(0, 0, np.nan)}, "mag x of sample 0"),
        ({"acc_g": np.ones((10, 2))}, "acc has shape (10, 2)"),
        ({"acc_g": np.ones((9, 3))}, "with 10 times it must be (n, 3)"),
        ({"gyro_rad_s": np.ones(10)}, "gyro has shape (10,)"),
        ({"t_s": np.zeros((10, 1))}, "time has shape (10, 1)"),
        ({"t_s": np.zeros(1), "acc_g": np.ones((1, 3))}, "1 sample; at least 2"),
        ({"t_s": np.array([0, 1, 2, 3, 3, 5, 6, 7, 8, 9.0])}, "time does not rise at sample 4"),
        ({"t_s": np.array([0, 1, 2, 1, 4, 5, 6, 7, 8, 9.0])}, "time does not rise at sample 3"),
        ({"t_s": np.array([0, np.nan, 2, 3, 4, 5, 6, 7, 8, 9.0])}, "time of sample 1 is not finite"),
        ({"rate_hz": 0.0}, "a rate of 0.0 Hz"),
        ({"rate_hz": np.nan}, "a rate of nan Hz"),
        ({"true_steps": -1}, "-1 true steps"),
        ({"steps_range": (120, 80)}, "the lower number comes first"),
        ({"step_t_s": np.array([2.0, 1.0])}, "rising order"),
        ({"step_t_s": np.array([np.nan])}, "finite seconds"),
    ],
)
def test_what_is_wrong_is_named(changes, says):
    with pytest.raises(RecordingError) as error:
        made(**changes)
    assert says in error.value.why
    assert error.value.path == "walk.npz"


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (9.80665, "m/s²: divide by 9.80665"),
        (1000.0, "milli-g: divide by 1000"),
        (4000.0, "about 4e+03 counts per g would fit (sensors use powers of two: 4096)"),
        (0.01, "powers of two: 0.0078125"),
        (0.0, "the sensor was off"),
        (1e300, "the sensor was off"),
    ],
)
def test_an_implausible_scale_is_refused_with_one_that_fits(factor, says):
    with pytest.raises(RecordingError, match="gravity should make it about 1") as error:
        made(acc_g=changed(0, 0, 0.0) * factor)
    assert says in error.value.why


@pytest.mark.parametrize("norm_g", [0.31, 1.0, 2.99])
def test_motion_may_move_the_median(norm_g):
    assert len(made(acc_g=changed(0, 0, 0.0) * norm_g)) == 10


def test_repeated_stamps_keep_the_first_sample():
    stamps_s = np.array([0.0, 1.0, 1.0, *range(2, 20)])
    t_s, (kept, none) = merge_repeated_stamps(stamps_s, np.arange(21.0), None)
    assert t_s.tolist() == list(range(20))
    assert kept.tolist() == [0, 1, *range(3, 21)]
    assert none is None


@pytest.mark.parametrize("round_to_s", [0.05, 0.1, 1.0])
def test_stamps_of_blocks_are_spread_over_their_samples(round_to_s):
    true_s = np.arange(1000) / 100
    stamps_s = np.round(np.floor(true_s / round_to_s + 1e-6) * round_to_s, 3)
    t_s, (kept,) = merge_repeated_stamps(stamps_s, true_s)
    assert np.allclose(t_s, true_s, atol=1e-9)
    assert np.array_equal(kept, true_s)
    assert median_rate_hz(t_s) == 100


def test_a_pause_between_blocks_stays_one():
    stamps_s = np.repeat([0.0, 0.1, 0.2, 7.0, 7.1], 5)
    t_s, _ = merge_repeated_stamps(stamps_s, np.arange(25.0))
    assert t_s[10:16] == pytest.approx([0.2, 0.22, 0.24, 0.26, 0.28, 7.0])
    assert t_s[-1] == pytest.approx(7.18)


def test_samples_written_twice_are_taken_once():
    stamps_s, values = np.repeat(np.arange(50) / 50, 2), np.repeat(np.arange(50.0), 2)
    t_s, (kept,) = merge_repeated_stamps(stamps_s, values)
    assert t_s.tolist() == (np.arange(50) / 50).tolist()
    assert kept.tolist() == list(range(50))


@pytest.mark.parametrize("stamps_s", [[0, 0, 0, 0], [0, 0, 2, 2, 1, 1], [0, 0, np.nan, 1, 1]], ids=str)
def test_what_says_no_time_or_falls_is_not_spread(stamps_s):
    stamps_s = np.array(stamps_s, dtype=float)
    assert spread_stamps(stamps_s, np.arange(float(len(stamps_s)))) is stamps_s


def test_columns_of_another_length_are_left_to_the_check():
    t_s, (column,) = merge_repeated_stamps(np.array([0.0, 0.0]), np.arange(3.0))
    assert len(t_s) == 2
    assert len(column) == 3


@pytest.mark.parametrize(("t_s", "rate_hz"), [([0, 0.02, 0.04, 0.9], 50), ([], 1), ([0], 1), ([1, 0], 1)], ids=str)
def test_the_median_spacing_says_the_rate(t_s, rate_hz):
    assert median_rate_hz(np.array(t_s, dtype=float)) == pytest.approx(rate_hz)


def test_a_rate_is_no_longer_than_it_needs_to_be():
    assert median_rate_hz(np.arange(1000) / 100 + 1.6e9) == pytest.approx(100, abs=1e-4)
    assert median_rate_hz(np.arange(1000) / 100) == 100
    assert median_rate_hz(np.array([0, 1e9])) == 1e-9
