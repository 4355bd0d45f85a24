"""Which family a recording belongs to, and what a family's score is."""

import csv
import doctest

import pytest

from service.evaluation import families
from service.evaluation.families import LIMITS, WALKS, Family, Outcome, family, scores, within_range


def outcome(dataset="a", true=100, counted=90, duration_s=3600.0, **more):
    return Outcome(dataset=dataset, true=true, counted=counted, duration_s=duration_s, **more)


def test_the_examples_of_the_docstrings():
    assert doctest.testmod(families).failed == 0


@pytest.mark.parametrize(
    ("dataset", "placement", "activity", "quality", "true", "expected"),
    [
        ("eth2022_wrist", "wrist", "five_steps", "A", 5, Family.WRIST),
        ("pebble_wrist", "wrist", "walk", "B", 100, Family.WRIST),
        ("dcaiti", "hand_or_pocket_unknown", "mixed_indoor", "A", 150, Family.PHONE),
        ("oxford_opt", "neck_pouch", "walk_hard_floor", "A", 285, Family.PHONE),
        ("pebble_wrist", "wrist", "driving", "B", 0, Family.PEBBLE),
        ("negatives_banglejs", "wrist", "driving", "A", 0, Family.DRIVING_AND_DESK),
        ("negatives_banglejs", "wrist", "sitting_arm_movement", "A", 0, Family.DRIVING_AND_DESK),
        ("negatives_hmp", "wrist", "pour_water", "A", 0, Family.HOUSEHOLD),
        ("negatives_hmp", "wrist", "sitdown_chair", "B", 0, Family.TRANSITIONS),
        ("negatives_spar_watch", "wrist", "shoulder_exercise_ROW", "A", 0, Family.EXERCISE),
        ("brajdic_handling", "backpack", "standing and handling", "B", 0, Family.HANDLING),
        ("mine", "wrist", "standup_chair", None, 0, Family.TRANSITIONS),
        ("mine", "wrist", "brush_teeth", None, 0, Family.HOUSEHOLD),
        ("mine", "left wrist", "desk-working", None, 0, Family.DRIVING_AND_DESK),
        ("mine", "wrist", "arm at_rest", None, 0, Family.DRIVING_AND_DESK),
        ("mine", "wrist", "repeated forest npc", None, 0, None),
        ("mine", None, None, None, 0, None),
        ("mine", "ankle", "walk", "A", 100, None),
        ("mine", "wrist", "walk", "A", None, None),
    ],
)
def test_a_recording_has_the_family_of_what_was_done(dataset, placement, activity, quality, true, expected):
    assert family(dataset, placement, activity, quality, true) is expected


def test_false_steps_are_all_steps_over_all_hours_and_the_sources_weigh_alike():
    desk = {"activity": "desk", "true": 0}
    long, short = outcome("a", counted=8, duration_s=3 * 3600, **desk), outcome("b", counted=8, duration_s=3600, **desk)
    score = scores([long, short])[Family.DRIVING_AND_DESK]
    assert (score.value, score.recordings, score.hours) == (4.0, 2, 4.0)
    assert score.by_source == pytest.approx({"a": 8 / 3, "b": 8.0})
    assert score.over_sources == pytest.approx((8 / 3 + 8) / 2)
    assert score.met


def test_an_error_is_absolute_and_a_limit_is_kept_or_not():
    wrist = {"placement": "wrist"}
    score = scores([outcome(counted=94, **wrist), outcome(counted=106, **wrist)])[Family.WRIST]
    assert score.value == pytest.approx(6.0)
    assert score.met is False
    assert scores([outcome(counted=105.5, **wrist)])[Family.WRIST].met


def test_what_nothing_is_asked_of_is_neither_met_nor_missed():
    score = scores([outcome(activity="standup", true=0)])[Family.TRANSITIONS]
    assert (score.limit, score.met) == (None, None)


def test_families_without_recordings_are_left_out_and_the_others_in_order():
    found = scores([outcome(activity="handling", true=0), outcome(placement="bag"), outcome(placement="wrist")])
    assert list(found) == [Family.WRIST, Family.PHONE, Family.HANDLING]


def test_every_family_but_the_transitions_has_a_limit_whose_aim_is_below_its_must():
    assert set(Family) - set(LIMITS) == {Family.TRANSITIONS}
    assert all(limit.aim < limit.must for limit in LIMITS.values())


def test_a_share_within_its_range_is_of_those_that_have_one():
    counted = [outcome(counted=n, within=(80, 120)) for n in (79, 80, 120, 121)]
    assert within_range([*counted, outcome("b")])["a"].percent == 50.0
    assert "b" not in within_range([outcome("b")])


@pytest.mark.full
def test_every_development_recording_has_a_family(recordings):
    with (recordings / "index.csv").open() as index:
        rows = [row for row in csv.DictReader(index) if row["split"] == "dev"]
    found = {
        (row["dataset"], of)
        for row in rows
        for of in [
            family(*(row[name] for name in ("dataset", "placement", "activity", "gt_quality")), int(row["true_steps"]))
        ]
    }
    assert None not in {of for _, of in found}
    assert {of for _, of in found} == set(Family)
    assert {of in WALKS for dataset, of in found if dataset == "pebble_wrist"} == {True, False}
