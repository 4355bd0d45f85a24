"""A scorecard's parts, from rows made by hand."""

import json

import pytest

from service.evaluation.families import Family
from service.evaluation.metrics import Matches
from service.evaluation.scorecard import wire
from service.evaluation.scorecard.card import ASKED_DISTURBANCES, Scorecard


def card(*rows, spliced=(), walked=()):
    return Scorecard("double_threshold", "tuned", rows, spliced, walked)


def change(name, *rows):
    (found,) = [each for each in card(*rows).changes if each.disturbance == name]
    return found


def test_rows_without_a_count_are_apart(row):
    made = card(row(), row(steps=None, error="why"))
    assert (len(made.rows), len(made.errors)) == (1, 1)
    assert made.families[Family.WRIST].recordings == 1


def test_a_change_is_of_the_undisturbed_count_not_of_the_truth(row):
    rows = [row("a", steps=80, disturbed={"25 Hz": 84}), row("b", disturbed={"25 Hz": 99}), row("c")]
    found = change("25 Hz", *rows)
    assert (found.recordings, found.changed, found.where, found.above) == (2, 2, "walks/a", 0)
    assert (found.mean, found.largest) == pytest.approx((3.0, 5.0))
    assert found.met


def test_one_large_change_is_too_much_whatever_the_mean(row):
    rows = [row(str(k), disturbed={"±2 g": 100}) for k in range(99)] + [row("x", disturbed={"±2 g": 89})]
    found = change("±2 g", *rows)
    assert found.mean < 1
    assert (found.above, found.met) == (1, False)


def test_a_count_that_comes_from_nothing_is_a_whole_change(row):
    assert change("8 bits", row(steps=0, disturbed={"8 bits": 2})).largest == 100.0
    assert change("8 bits", row(steps=0, disturbed={"8 bits": 0})).largest == 0.0


def test_packets_are_compared_with_the_same_packets_sent_once_and_rest_counts_too(row):
    same = {wire.ONCE: 97, wire.TWICE: 97, "5 % lost": 97}
    assert change(wire.TWICE, row(disturbed=same)).met
    assert change("5 % lost", row(disturbed=same)).mean == 0.0
    rest = row("q", true_steps=0, steps=0, disturbed={wire.ONCE: 0, wire.TWICE: 1})
    found = change(wire.TWICE, row(disturbed=same), rest)
    assert (found.recordings, found.changed, found.met) == (2, 1, False)


def test_a_quiet_recording_whose_rate_is_low_is_counted_as_it_is(row):
    quiet = {"true_steps": 0, "activity": "desk", "duration_s": 1800.0}
    slow, fast = row("a", steps=3, **quiet), row("b", steps=1, disturbed={"25 Hz": 6}, **quiet)
    found = card(slow, fast, row()).disturbed
    assert list(found) == [Family.DRIVING_AND_DESK]
    assert found[Family.DRIVING_AND_DESK]["25 Hz"] == 9.0
    assert found[Family.DRIVING_AND_DESK]["8 bits"] == 4.0


def test_step_times_are_of_all_steps_together_by_set_and_subject(row):
    rows = [
        row("a", matches=Matches(tp=90, fp=10, fn=10), blind=Matches(tp=50, fp=50, fn=50)),
        row("b", subject="s2", matches=Matches(tp=10, fp=0, fn=0), blind=Matches(tp=10, fp=0, fn=0)),
        row("c"),
    ]
    whole, first, second = card(*rows).timed
    assert (whole.subject, whole.recordings, whole.f1, whole.metronome) == ("", 2, pytest.approx(200 / 220), 60 / 110)
    assert (first.subject, first.f1, second.subject, second.f1) == ("s1", 0.9, "s2", 1.0)


def test_every_limit_of_the_disturbances_is_asked():
    assert ASKED_DISTURBANCES == (
        "50 Hz", "25 Hz", "12.5 Hz", "rotated", "±2 g", "8 bits", "25 Hz, 8 bits, rotated", "packets re-sent",
        "5 % lost",
    )  # fmt: skip


def test_json_is_plain_rows_that_say_what_they_are(row):
    rows = [row(within=(90, 110), disturbed={"25 Hz": 100}), row("q", true_steps=0, steps=4, activity="desk")]
    told = json.loads(json.dumps(list(card(*rows).as_json()), allow_nan=False))
    assert {each["part"] for each in told} == {
        "family", "within range", "disturbance", "disturbed family", "recording",
    }  # fmt: skip
    (lost,) = list(card(row(steps=None, error="it lacks a gyroscope")).as_json())
    assert (lost["part"], lost["what"], lost["why"]) == ("not counted", "walks/w", "it lacks a gyroscope")
    (desk,) = [each for each in told if each.get("family") == "driving and desk" and each["part"] == "family"]
    assert (desk["value"], desk["unit"], desk["must"], desk["aim"]) == (240.0, "false steps/h", 8.0, 2.0)
    assert {each["counter"] for each in told} == {"double_threshold"}
