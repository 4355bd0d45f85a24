"""The walker: true steps, variation, chunks, seeds, gravity."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.gait import Segment, Walker
from device_sim.gait_profiles import GAITS, MOTIONS
from service.errors import ParameterError

ALL = 10**7


def acc_g(schedule, **options):
    return Walker(schedule, **options).read(ALL)


def norm_g(schedule, **options):
    return np.linalg.norm(acc_g(schedule, **options), axis=1)


def amplitude(values, at_hz, rate_hz):
    """Amplitude of the sine at `at_hz`, over a whole number of its periods."""
    n = int(int(len(values) * at_hz / rate_hz) * rate_hz / at_hz)
    turns = np.exp(-2j * np.pi * at_hz * np.arange(n) / rate_hz)
    return 2 * abs(np.mean((values[:n] - values[:n].mean()) * turns))


@pytest.mark.parametrize("activity", GAITS)
@pytest.mark.parametrize("cadence_spm", [None, 50.0, 150.0])
def test_true_steps_are_cadence_times_duration(activity, cadence_spm):
    segment = Segment(activity=activity, duration_s=60, cadence_spm=cadence_spm)
    walker = Walker([segment])
    times_s = walker.step_times_until(60)
    assert len(times_s) == round(cadence_spm or GAITS[activity].cadence_spm)
    assert 0 < times_s[0] < times_s[-1] < 60
    assert walker.true_steps_until(60) == len(times_s)


@pytest.mark.parametrize("activity", ["slow", "normal", "run"])
def test_intervals_vary_as_measured(activity):
    intervals_s = np.diff(Walker(f"{activity}:30min", seed=4).step_times_until(1800))
    assert intervals_s.mean() == pytest.approx(60 / GAITS[activity].cadence_spm, rel=0.01)
    assert intervals_s.std() / intervals_s.mean() == pytest.approx(GAITS[activity].interval_sd, rel=0.15)
    assert intervals_s.min() > 0


def test_truth_counts_up_over_segments_and_not_in_rest():
    walker = Walker("normal:10@120,rest:5,run:10@180")
    assert walker.true_steps_until(-1) == 0
    assert [walker.true_steps_until(t_s) for t_s in (10, 12, 15, 25, 99)] == [20, 20, 20, 50, 50]
    assert walker.true_steps_until(5) == sum(t_s <= 5 for t_s in walker.step_times_until(99)) == 10


@pytest.mark.parametrize("activity", MOTIONS)
def test_what_is_no_step_has_none(activity):
    walker = Walker(f"{activity}:60")
    assert walker.true_steps_until(60) == 0
    assert len(walker.read(ALL)) == 3000


@pytest.mark.parametrize("activity", sorted(set(MOTIONS) - {"rest"}))
def test_motion_moves(activity):
    assert np.ptp(norm_g(f"{activity}:30", noise_g=0)) > 0.05


def test_a_walk_too_short_for_a_step_is_rest():
    assert Walker("normal:0.2").true_steps_until(1) == 0
    assert norm_g("normal:0.2", noise_g=0) == pytest.approx(1)


schedules = st.lists(
    st.sampled_from(["normal:3", "run:2@170", "rest:1", "sit:2.5", "knock:1.3", "stairs_down:4.7", "slow:0.01"]),
    min_size=1,
    max_size=4,
).map(",".join)


@settings(deadline=None)
@given(schedules, st.integers(0, 99), st.sampled_from([12.5, 50.0, 99.7]), st.lists(st.integers(0, 200), max_size=30))
def test_any_chunking_gives_the_same_samples(schedule, seed, rate_hz, sizes):
    walker = Walker(schedule, seed=seed, rate_hz=rate_hz)
    chunks = [walker.read(n) for n in [*sizes, ALL]]
    assert np.array_equal(np.concatenate(chunks), acc_g(schedule, seed=seed, rate_hz=rate_hz))
    assert all(len(chunk) <= n for chunk, n in zip(chunks, sizes, strict=False))
    assert walker.read(1).shape == (0, 3)
    assert sum(map(len, chunks)) == pytest.approx(walker.duration_s * rate_hz, abs=1)


def test_truth_does_not_disturb_the_samples():
    asked, quiet = Walker("normal:20", seed=1), Walker("normal:20", seed=1)
    first = asked.read(100)
    asked.true_steps_until(20)
    assert np.array_equal(np.concatenate([first, asked.read(ALL)]), quiet.read(ALL))


def test_the_seed_decides():
    assert np.array_equal(acc_g("normal:9", seed=7), acc_g("normal:9", seed=7))
    assert not np.array_equal(acc_g("normal:9", seed=7), acc_g("normal:9", seed=8))
    assert Walker("normal:9", seed=7).step_times_until(9) != Walker("normal:9", seed=8).step_times_until(9)


def test_steps_do_not_depend_on_the_rate():
    assert Walker("run:9", rate_hz=25).step_times_until(9) == Walker("run:9", rate_hz=100).step_times_until(9)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda g: np.linalg.norm(g) > 1e-3))
def test_at_rest_the_sensor_reads_gravity_alone(gravity):
    still = acc_g("rest:2", gravity=gravity, noise_g=0)
    assert still == pytest.approx(np.tile(gravity / np.linalg.norm(gravity), (100, 1)))


@settings(deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda g: np.linalg.norm(g) > 1e-3))
def test_the_norm_does_not_depend_on_how_it_is_worn(gravity):
    assert norm_g("normal:4", gravity=gravity, noise_g=0) == pytest.approx(WORN_PLAINLY, rel=0.05, abs=0.1)


WORN_PLAINLY = norm_g("normal:4", noise_g=0)


def test_noise_is_the_sensors():
    still = acc_g("rest:60", noise_g=0.02)
    assert still.std(axis=0) == pytest.approx([0.02] * 3, rel=0.1)
    assert np.corrcoef(still.T)[0, 1] == pytest.approx(0, abs=0.1)


def test_the_arm_swings_once_in_two_steps():
    walking = acc_g("normal:60@120", noise_g=0, strength=0)
    forward = walking[:, 2]
    assert amplitude(forward, 1.0, 50) > 5 * amplitude(forward, 2.0, 50)


def test_without_impacts_and_arm_length_gravity_only_turns():
    swinging = acc_g("normal:30,run:10", noise_g=0, strength=0, arm_m=0)
    assert np.ptp(swinging[:, 2]) > 0.4
    assert np.linalg.norm(swinging, axis=1) == pytest.approx(1)


def test_strength_scales_the_impacts():
    steps_hz = 108 / 60
    weak, strong = (amplitude(norm_g("normal:60@108", strength=s), steps_hz, 50) for s in (0.5, 1.0))
    assert 1.5 < strong / weak < 3


def test_the_crest_is_at_the_step():
    """Truth in time: the impact's crest lies within 0.1 s of the step that made it."""
    rate_hz = 100
    walker = Walker("normal:60", rate_hz=rate_hz, noise_g=0)
    norm = np.linalg.norm(walker.read(ALL), axis=1)
    smooth = np.convolve(norm, np.ones(9) / 9, "same")
    for step_s in walker.step_times_until(60)[2:-2]:
        at = round(step_s * rate_hz)
        crest = at - 20 + int(np.argmax(smooth[at - 20 : at + 21]))
        assert abs(crest - at) <= 0.1 * rate_hz


def test_no_blow_between_activities():
    """A change of activity is no impact: between segments the samples stay near gravity."""
    quiet = [(name, f"{name}:5") for name in (*GAITS, "rest", "sit", "stand", "gesture")]
    for (_, one), (_, other) in itertools.pairwise(quiet):
        samples = norm_g(f"{one},{other}", rate_hz=100, noise_g=0)
        assert abs(samples[499] - samples[500]) < 0.35, (one, other)


def test_a_loop_goes_on_with_other_steps():
    walker = Walker("normal:10@120,rest:5", loop=True, seed=3)
    samples = walker.read(1501)
    assert len(samples) == 1501
    assert walker.true_steps_until(30) == 40
    first, second = (np.array(walker.step_times_until(30)[k : k + 20]) for k in (0, 20))
    assert first == pytest.approx(second - 15, abs=1)
    assert not np.allclose(first, second - 15)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"rate_hz": 0}, "rate_hz"),
        ({"rate_hz": float("nan")}, "rate_hz"),
        ({"gravity": (0, 0, 0)}, "gravity"),
        ({"gravity": (0, 1)}, "gravity"),
        ({"gravity": (0, float("inf"), 1)}, "gravity"),
        ({"noise_g": -1}, "noise_g"),
        ({"strength": float("inf")}, "strength"),
        ({"arm_m": -0.1}, "arm_m"),
        ({"schedule": []}, "schedule"),
    ],
)
def test_a_wearer_must_be_possible(options, name):
    with pytest.raises(ParameterError) as error:
        Walker(**({"schedule": "rest:1"} | options))
    assert error.value.name == name


def test_truth_is_asked_for_a_finite_time():
    with pytest.raises(ParameterError, match="t_s"):
        Walker("rest:1", loop=True).true_steps_until(float("inf"))
