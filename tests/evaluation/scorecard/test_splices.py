"""Step-free clips between two walks: whose, which walk, how they are joined, and which steps are false."""

from pathlib import Path

import numpy as np
import pytest
from evaluation.made import save, still, walk

from service.evaluation.choices import Found, choices
from service.evaluation.families import Family
from service.evaluation.scorecard.splices import (
    JOINT_S,
    Splice,
    Spliced,
    by_family,
    joined,
    spliced,
    splices,
)
from service.samples import GRID_HZ

CHOSEN = choices(["double_threshold", "gyro_zero_crossing"], "tuned", [])
JOINT = round(JOINT_S * GRID_HZ)


def test_a_subjects_clips_of_a_family_go_into_one_splice_and_into_its_own_walk(row):
    quiet = {"true_steps": 0, "activity": "driving", "dataset": "pebble_wrist"}
    rows = [
        row("own", "pebble_wrist", subject="s1"),
        row("other", "pebble_wrist", subject="s2"),
        row("elsewhere", "banglejs_walk", subject="s1"),
        row("q2", subject="s1", **quiet),
        row("q1", subject="s1", **quiet),
        row("q3", subject="s3", **quiet),
    ]
    made = splices([*rows, *rows])  # of two counters
    assert [(splice.subject, [clip.path.stem for clip in splice.clips]) for splice in made] == [
        ("s1", ["q1", "q2"]), ("s3", ["q3"]),
    ]  # fmt: skip
    assert made[0].family is Family.PEBBLE
    assert made[0].walk.path.stem == "own"
    assert made[1].walk.dataset == "pebble_wrist"


def test_a_walk_is_of_the_same_place_and_else_of_the_nearest_rate(row):
    clip = row("q", "negatives_hmp", true_steps=0, rate_hz=32.0, activity="pour_water")
    walks = [
        row("fast", "eth2023_wrist", rate_hz=100.0),
        row("near", "pebble_wrist", rate_hz=25.0),
        row("bag", "brajdic_walk", rate_hz=32.0, placement="bag"),
        row("short", "banglejs_walk", rate_hz=32.0, true_steps=20),
    ]
    assert [splice.walk.path.stem for splice in splices([clip, *walks])] == ["near"]
    assert splices([clip, walks[2]]) == []


def motion(seconds, towards, seed):
    noise = np.random.default_rng(seed).normal(0, 0.05, (round(seconds * GRID_HZ), 3))
    return np.asarray(towards, dtype=float) + noise


def test_a_joint_is_smooth_and_the_clip_begins_as_the_walk_left_it():
    before, after = motion(5, (0, 0, 1), 1), motion(5, (0.6, 0.8, 0), 2)
    clips = [motion(4, (1, 0, 0), 3), motion(4, (0, -1, 0), 4)]
    whole, (first, last) = joined(before, clips, after)
    assert len(whole) == sum(map(len, (before, *clips, after))) + 3 * JOINT
    assert (first, last) == (len(before) + JOINT, len(before) + 8 * GRID_HZ + 2 * JOINT)
    assert np.array_equal(whole[: len(before)], before)
    # Turned as a whole: lengths stay, the mean of the first second is where the walk's last was.
    assert np.linalg.norm(whole[first : first + 4 * GRID_HZ], axis=1) == pytest.approx(np.linalg.norm(clips[0], axis=1))
    assert whole[first : first + GRID_HZ].mean(axis=0) == pytest.approx(before[-GRID_HZ:].mean(axis=0), abs=0.03)
    joint = whole[len(before) : first]
    assert np.abs(np.diff(whole[len(before) - 1 : first + 1], axis=0)).max() < 0.35  # no blow, gravity's turn taken out
    assert np.abs(joint[20:30] - joint[25]).max() < 0.01  # and in its middle the person stands still


@pytest.fixture
def files(tmp_path):
    """A walk, a rest and a walk that is called one without steps."""

    def found(name, recording):
        path = save(recording, tmp_path / f"{name}.npz")
        return Found(shown=name, path=path, dataset="d")

    liar = walk(20, true_steps=0, step_t_s=None)
    return {"walk": found("walk", walk(90)), "rest": found("rest", still(20)), "liar": found("liar", liar)}


def splice(files, *clips):
    return Splice(
        family=Family.PEBBLE, dataset="d", subject="s", clips=tuple(files[clip] for clip in clips), walk=files["walk"]
    )


@pytest.mark.full
def test_steps_in_the_clips_are_false_and_the_walks_are_not(files):
    (quiet,) = spliced(splice(files, "rest", "rest"), CHOSEN, 32.0)
    assert quiet.counter == "double_threshold"  # the other one needs a gyroscope
    assert (quiet.false, quiet.walked, quiet.clips_s) == (0, pytest.approx(120, abs=3), 40.0)
    (loud,) = spliced(splice(files, "rest", "liar"), CHOSEN, 32.0)
    assert loud.false == pytest.approx(40, abs=2)
    assert loud.walked == pytest.approx(120, abs=3)


def test_a_family_has_the_false_steps_of_all_its_hours(files):
    made = [
        Spliced(splice=splice(files, "rest"), counter="c", false=3, walked=60, clips_s=1800.0),
        Spliced(splice=splice(files, "rest", "rest"), counter="c", false=0, walked=60, clips_s=3600.0),
    ]
    family = by_family(made)[Family.PEBBLE]
    assert (family.subjects, family.clips, family.hours, family.false_per_hour) == (2, 3, 1.5, 2.0)


def test_a_file_may_lie_anywhere(row):
    made = splices([row("w"), row("q", true_steps=0, activity="desk")])
    assert made[0].walk.path == Path("walks/w.npz")
