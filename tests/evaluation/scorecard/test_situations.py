"""Situations: real recordings by what they are called, walkers where there are none."""

import pytest

from device_sim.gait_schedule import ACTIVITIES
from service.evaluation.choices import choices
from service.evaluation.papers.conditions import Condition, walk
from service.evaluation.scorecard.situations import PEOPLE, SITUATIONS, SYNTHETIC, Situation, real, synthetic, table

ASKED = {
    "slow, 0.8 steps/s", "running", "stairs up", "stairs down", "five-step walks", "start-stop", "hand in pocket",
    "pushing a trolley", "stepping in place",
}  # fmt: skip


def test_everything_asked_for_has_a_row_and_somebody_who_walks_it():
    assert {situation.label for situation in SITUATIONS} >= ASKED
    for situation in SITUATIONS:
        assert situation.activity or situation.walkers
        for part in situation.walkers.parts if situation.walkers else ():
            assert part.activity in ACTIVITIES


@pytest.mark.parametrize(
    ("label", "cadence_spm"), [("slow, 0.8 steps/s", 48.0), ("running", 192.0)]
)  # fmt: skip
def test_the_slowest_and_the_fastest_are_as_asked(label, cadence_spm):
    (situation,) = [each for each in SITUATIONS if each.label == label]
    assert [part.cadence_spm for part in situation.walkers.parts] == [cadence_spm]
    assert situation.walkers.walkers == PEOPLE


@pytest.mark.parametrize(
    ("activity", "label"),
    [
        ("run", "running"), ("jog", "running"), ("walk_steps_down", "stairs down"), ("five_steps", "five-step walks"),
        ("walk_upstairs_hands-in-pockets", "stairs up"), ("walk_hands_in_pocket", "hand in pocket"),
        ("walk_slow", "slow"), ("mixed_indoor", "start-stop"),
    ],
)  # fmt: skip
def test_a_recording_is_found_by_its_activity(row, activity, label):
    (walked,) = real([row(activity=activity), row(activity="walk"), row(activity=activity, true_steps=0)])
    assert (walked.label, walked.source, walked.true) == (label, "walks", 100)


@pytest.mark.full
def test_rows_are_of_a_source_each_real_ones_first(row):
    runs = [row("a", activity="run", steps=110), row("b", activity="jog", steps=80)]
    walkers = Situation(label="running", walkers=Condition(label="r", parts=(walk("run", 20, 180.0),), walkers=2))
    chosen = choices(["double_threshold", "gyro_zero_crossing"], "tuned", [])
    of_walkers = synthetic(walkers, chosen)
    assert {walked.counter for walked in of_walkers} == {"double_threshold", "gyro_zero_crossing"}
    first, second = table([*[w for w in of_walkers if w.counter == "double_threshold"], *real(runs)])
    assert (first.source, first.walks, first.true, first.counted) == ("walks", 2, 200, 190)
    assert (first.error, first.bias, first.worst) == (15.0, -5.0, 20.0)
    assert (second.source, second.walks, second.true) == (SYNTHETIC, 2, 40)


def test_a_situation_without_walkers_has_none():
    assert synthetic(Situation(label="barefoot", activity="x"), choices(["double_threshold"], "tuned", [])) == []
