"""Counts on real recordings are pinned: one that changed fails with a line that says which, from what, to what.

A change that is meant is taken over by

    STEPLINK_RECOUNT=1 STEPLINK_DATA=… pytest -m full tests/counters/test_golden.py

which writes `golden_counts.csv` anew, with a column for every counter there is; the commit shows the rest.
"""

import os

import pytest
from counters import golden

from service.counters import registry

HOW = "if that is meant: STEPLINK_RECOUNT=1 pytest -m full tests/counters/test_golden.py"


def row(**changes):
    return {"dataset": "a", "recording": "w", "true": "100", "double_threshold": "98"} | changes


def test_a_changed_count_is_a_line_that_says_what_it_was_and_should_be():
    assert golden.differences([row()], [row()]) == []
    assert golden.differences([row()], [row(double_threshold="97")]) == ["± a/w: double_threshold 98 → 97 (true 100)"]
    assert golden.differences([row()], [row(true="99")]) == ["± a/w: true 100 → 99 (true 99)"]
    assert golden.differences([row(fusion="")], [row(fusion="3")]) == ["± a/w: fusion none → 3 (true 100)"]


def test_recordings_that_came_or_went_are_told():
    assert golden.differences([row()], [row(recording="x")]) == ["- a/w: is not listed any more", "+ a/x: is new"]


def test_a_long_difference_is_cut():
    many = [row(recording=str(k)) for k in range(100)]
    lines = golden.differences([], many)
    assert (len(lines), lines[-1]) == (golden.SHOWN + 1, f"… and {100 - golden.SHOWN} more")


def test_every_counter_is_pinned():
    (first, *_) = golden.expected()
    assert list(first) == [*golden.KEYS, *registry.COUNTERS]


@pytest.mark.full
def test_recordings_count_as_they_did(recordings):
    recounted = golden.counted(recordings, list(registry.COUNTERS))
    if os.environ.get("STEPLINK_RECOUNT"):
        golden.write(recounted)
    found = golden.differences(golden.expected(), recounted)
    assert not found, "\n".join([f"{len(found)} counts changed; {HOW}", *found])
