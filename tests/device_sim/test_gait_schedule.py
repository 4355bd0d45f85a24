"""The text of a schedule, and what it refuses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device_sim.gait_profiles import GAITS, MOTIONS
from device_sim.gait_schedule import ACTIVITIES, Segment, parse_schedule
from service.errors import ParameterError


def test_activities_seconds_units_and_cadence():
    slow, rest, run, drive = parse_schedule("slow:20, rest:1.5min,run:10s@170.5,drive:1h")
    assert (slow.activity, slow.duration_s, slow.cadence_spm) == ("slow", 20, None)
    assert (rest.activity, rest.duration_s) == ("rest", 90)
    assert (run.duration_s, run.cadence_spm) == (10, 170.5)
    assert drive.duration_s == 3600


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        ("", "schedule", "'' is not ACTIVITY:SECONDS"),
        ("slow:20,,rest:5", "schedule", "'' is not"),
        ("slow", "schedule", "'slow' is not"),
        ("slow:-3", "schedule", "'slow:-3' is not"),
        ("slow:3days", "schedule", "'slow:3days' is not"),
        ("slow:3@", "schedule", "normal:30@110"),
        ("hop:3", "activity", "known are slow, normal, fast, run"),
        ("slow:0", "duration_s", "above 0"),
        ("type:9@100", "cadence_spm", "type has no steps"),
        ("slow:9@10", "cadence_spm", "20 to 240"),
        ("slow:9@241", "cadence_spm", "20 to 240"),
    ],
)
def test_what_is_wrong_is_named(text, name, says):
    with pytest.raises(ParameterError) as error:
        parse_schedule(text)
    assert error.value.name == name
    assert says in str(error.value)


@pytest.mark.parametrize("duration_s", [float("nan"), float("inf"), -1.0])
def test_a_duration_is_finite_and_positive(duration_s):
    with pytest.raises(ParameterError):
        Segment(activity="rest", duration_s=duration_s)


@given(st.sampled_from(sorted(GAITS)), st.floats(0.1, 1e4), st.none() | st.floats(20, 240))
def test_steps_are_cadence_times_duration(activity, duration_s, cadence_spm):
    segment = Segment(activity=activity, duration_s=duration_s, cadence_spm=cadence_spm)
    expected = (cadence_spm or GAITS[activity].cadence_spm) * duration_s / 60
    assert abs(segment.steps - expected) <= 0.5


def test_what_the_documents_test_is_there():
    """Slow, fast, run, slopes, stairs, a still arm, a pocket; and what must not count."""
    gaits = {"slow", "normal", "fast", "run", "stairs_up", "stairs_down", "uphill", "downhill", "still_arm", "pocket"}
    motions = {"rest", "sit", "stand", "type", "knock"}
    assert gaits <= set(GAITS)
    assert motions <= set(MOTIONS)
    assert set(ACTIVITIES) == set(GAITS) | set(MOTIONS)


@pytest.mark.parametrize("activity", ACTIVITIES)
def test_every_row_says_where_it_was_measured(activity):
    row = GAITS.get(activity) or MOTIONS[activity]
    sources = ("pebble_wrist", "eth202", "negatives_", "nothing: no recording")
    assert any(source in row.measured for source in sources)
