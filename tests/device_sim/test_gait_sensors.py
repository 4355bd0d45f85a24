"""A walker's angular rate and field: of one attitude with its acceleration, whatever it does and however it is worn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.gait import ACTIVITIES, Walker
from device_sim.gait_poses import POSES
from device_sim.gait_profiles import EARTH_UT, GAITS, SENSOR_NOISE_UT
from service.samples import Sensor


def turned_by(rates_rad_s, vector, rate_hz):
    """Carry a resting vector into the turning sensor's axes: v′ = −ω × v, midpoint rule."""
    seen = [vector]
    for rate in (rates_rad_s[1:] + rates_rad_s[:-1]) / 2:
        half = seen[-1] - np.cross(rate, seen[-1]) / (2 * rate_hz)
        seen.append(seen[-1] - np.cross(rate, half) / rate_hz)
    return np.array(seen)


@settings(max_examples=30)
@given(st.sampled_from(ACTIVITIES), st.integers(0, 9))
def test_the_rate_turns_the_field(activity, seed):
    sensed = Walker(f"{activity}:4", seed=seed, rate_hz=100.0, gravity=(0.2, -0.5, 0.8)).sensed()
    field = turned_by(sensed.gyro_rad_s, sensed.mag_ut[0], 100.0)
    assert np.abs(field - sensed.mag_ut).max() < 0.1 * np.linalg.norm(EARTH_UT)


@given(st.sampled_from(ACTIVITIES), st.sampled_from(sorted(POSES)))
def test_the_field_keeps_its_strength(activity, name):
    pose = POSES[name]
    sensed = Walker(f"{activity}:5", arm_m=pose.arm_m, gaits=pose.gaits, gravity=pose.gravity).sensed()
    strength = np.linalg.norm(sensed.mag_ut, axis=1)
    assert np.abs(strength - np.linalg.norm(EARTH_UT)).max() < 6 * SENSOR_NOISE_UT


def test_sensed_is_what_is_read_and_disturbs_no_reading():
    read = Walker("slow:8,gesture:4,rest:3", seed=5)
    first = read.read(100)
    sensed = read.sensed()
    assert np.array_equal(sensed.acc_g, np.concatenate([first, read.read(10_000)]))
    assert sensed.gyro_rad_s.shape == sensed.mag_ut.shape == sensed.acc_g.shape


def test_gravity_and_field_turn_together():
    """An arm held out at 35° shows both vectors turned by the same angle."""
    sensed = Walker("rest:2,gesture:3", seed=3, noise_g=0.0).sensed()
    still, out = slice(10, 90), slice(155, 200)  # the gesture holds from its first second to its second

    def turned_deg(values):
        before, after = values[still].mean(axis=0), values[out].mean(axis=0)
        return np.degrees(np.arccos(before @ after / np.linalg.norm(before) / np.linalg.norm(after)))

    assert turned_deg(sensed.acc_g) == pytest.approx(35.0, abs=1.0)
    assert 1.0 < turned_deg(sensed.mag_ut) <= 36.0


def test_at_rest_nothing_turns():
    assert np.abs(Walker("rest:10").sensed().gyro_rad_s.mean(axis=0)).max() < 1e-3


@pytest.mark.parametrize("name", sorted(POSES))
def test_every_pose_has_every_gait_and_says_where_it_is_from(name):
    assert set(POSES[name].gaits) == set(GAITS)
    assert POSES[name].measured


def test_a_leg_swings_from_its_first_step_and_an_arm_does_not():
    pocket = POSES["pocket"]
    leg = Walker("normal:10", arm_m=pocket.arm_m, gaits=pocket.gaits).sensed().gyro_rad_s
    arm = Walker("normal:10").sensed().gyro_rad_s
    first = slice(0, 30)  # up to the first step at a quarter of a second, and the half step after it
    assert np.abs(leg[first]).max() > 2 * np.abs(arm[first]).max()


ALL = tuple(Sensor)


@settings(max_examples=20)
@given(st.lists(st.integers(0, 700), max_size=5))
def test_any_chunking_gives_what_is_sensed(sizes):
    walker, whole = (Walker("slow:8,gesture:4,rest:3", seed=5, sensors=ALL) for _ in range(2))
    read = np.concatenate([np.empty((0, 9)), *(walker.read(n) for n in sizes), walker.read(10_000)])
    sensed = whole.sensed()
    assert np.array_equal(read, np.hstack([sensed.acc_g, sensed.gyro_rad_s, sensed.mag_ut]))


def test_a_sensor_more_changes_nothing_in_the_others():
    some = {
        sensors: Walker("normal:5", seed=2, sensors=sensors).read(999) for sensors in (ALL[:1], ALL[:2], ALL[::2], ALL)
    }
    assert np.array_equal(some[ALL][:, :3], some[ALL[:1]])
    assert np.array_equal(some[ALL][:, :6], some[ALL[:2]])
    assert np.array_equal(some[ALL][:, [0, 1, 2, 6, 7, 8]], some[ALL[::2]])


def both_wrists(schedule, **how):
    return (Walker(schedule, seed=4, sensors=ALL, mirrored=mirrored, **how) for mirrored in (False, True))


def test_two_wrists_take_the_same_steps_half_a_stride_apart():
    one, other = both_wrists("normal:20")
    assert one.step_times_until(20) == other.step_times_until(20)
    # A watch outwards on either side is half a turn about the forearm, so equal turns about the side read opposite.
    turns, others = (walker.sensed().gyro_rad_s[100:900, 1] for walker in (one, other))
    assert np.corrcoef(turns, others)[0, 1] > 0.85  # opposite swings in opposite axes
    assert np.abs(turns - others).mean() > 0.05  # and noise of its own


def test_the_other_wrist_is_the_mirror_image_of_a_motion():
    """Left for right, then half a turn about the forearm: what is forward changes sign, what is sideways does not."""
    one, other = (walker.sensed().acc_g[55:95].mean(axis=0) for walker in both_wrists("gesture:4"))
    assert one[0] == pytest.approx(other[0], abs=0.02)  # the default sensor's x points down the arm
    forward, sideways = np.abs(one + other)[1:], np.abs(one - other)[1:]
    assert np.abs(one[1:]).min() > 0.1
    assert sorted(np.minimum(forward, sideways)) == pytest.approx([0, 0], abs=0.02)
    assert (forward < sideways).sum() == 1


@settings(max_examples=15)
@given(st.sampled_from(ACTIVITIES), st.integers(0, 9))
def test_on_the_other_wrist_too_the_rate_turns_the_field(activity, seed):
    sensed = Walker(f"{activity}:4", seed=seed, rate_hz=100.0, mirrored=True).sensed()
    field = turned_by(sensed.gyro_rad_s, sensed.mag_ut[0], 100.0)
    assert np.abs(field - sensed.mag_ut).max() < 0.1 * np.linalg.norm(EARTH_UT)
