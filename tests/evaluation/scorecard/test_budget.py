"""What dominates the error, and how it goes with levels."""

import pytest

from service.evaluation.families import Family
from service.evaluation.scorecard import budget, wire


def test_a_share_is_of_the_familys_error_the_largest_first(row):
    rows = [row("a", steps=90), row("b", steps=130), row("c"), row("q", true_steps=0, steps=7, activity="desk")]
    assert [(part.family, part.name, part.share) for part in budget.by_recording(rows)] == [
        (Family.WRIST, "walks/b", 75.0), (Family.WRIST, "walks/a", 25.0), (Family.DRIVING_AND_DESK, "walks/q", 100.0),
    ]  # fmt: skip


def test_activities_are_put_together_and_a_phones_with_where_it_was(row):
    bag = {"placement": "bag", "steps": 90}
    rows = [row("a", **bag), row("b", **bag), row("c", placement="front_pocket", steps=80), row("d")]
    assert [(part.name, part.recordings, part.share) for part in budget.by_activity(rows)] == [
        ("walks: walk, bag", 2, 50.0), ("walks: walk, front pocket", 1, 50.0),
    ]  # fmt: skip


def test_cadence_is_in_bands_in_order(row):
    rows = [row(true_steps=n, steps=n + 12) for n in (60, 90, 120, 180)]
    assert [(level.name, round(level.error, 1)) for level in budget.by_cadence(rows)] == [
        ("under 1.4 steps/s", 20.0), ("1.4 to 1.6 steps/s", 13.3), ("2 to 2.2 steps/s", 10.0),
        ("2.2 steps/s and more", 6.7),
    ]  # fmt: skip


def test_levels_are_of_walks_only(row):
    rows = [row(steps=90), row(placement="bag"), row(true_steps=0, steps=9)]
    assert [(level.name, level.recordings) for level in budget.by_placement(rows)] == [("bag", 1), ("wrist", 1)]
    assert [level.error for level in budget.by_saturation([*rows, row(saturated=True, steps=0)])] == [5.0, 100.0]
    assert [level.name for level in budget.by_native_rate([row(rate_hz=100.0), row(rate_hz=12.5)])] == [
        "12.5 Hz", "100 Hz",
    ]  # fmt: skip


def test_a_sweep_compares_the_same_walks_at_every_level(row):
    whole = {"50 Hz": 99, "25 Hz": 95, "12.5 Hz": 80}
    rows = [row(disturbed=whole), row(disturbed={"12.5 Hz": 0}), row(true_steps=0, steps=9, disturbed=whole)]
    assert [(level.name, level.recordings, level.error) for level in budget.sweep(rows, "rate")] == [
        ("as recorded", 1, 0.0), ("50 Hz", 1, 1.0), ("25 Hz", 1, 5.0), ("12.5 Hz", 1, 20.0),
    ]  # fmt: skip
    assert budget.sweep([row()], "bits") == []


def test_loss_starts_from_packets_sent_once(row):
    sent = {wire.ONCE: 98, "1 % lost": 97, "5 % lost": 96, "10 % lost": 90}
    assert [level.error for level in budget.sweep([row(disturbed=sent)], wire.AXIS)] == [2.0, 3.0, 4.0, 10.0]


@pytest.mark.parametrize("ranking", [budget.by_recording, budget.by_activity])
def test_where_nothing_is_wrong_nothing_dominates(row, ranking):
    assert ranking([row(), row(true_steps=0, steps=0, activity="desk")]) == []
