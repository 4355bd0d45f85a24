"""What a primary refused: judged once all near it is certain, by what it made of the motion."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.samples import Gait, Verdict
from service.tracking.refused import KEPT_S, Refused

REST, OTHER, PERHAPS, WALKING = Verdict


def said(refused, *verdicts, start=1):
    """Say a verdict a second."""
    for at_s, verdict in enumerate(verdicts, start):
        refused.say(Gait(float(at_s), verdict, 0.5, None))
        refused.settle()


def test_a_step_waits_until_all_of_the_primarys_near_it_are_certain():
    refused = Refused(latency_s=3.0)
    said(refused, OTHER)
    refused.count_beside("peaks", 1.5)
    said(refused, OTHER, OTHER, OTHER, OTHER, start=2)
    assert refused.counts == {}  # a step of the primary's at 2.5 may be told at 5.5
    said(refused, OTHER, start=6)
    assert refused.counts == {"peaks": {REST: 0, OTHER: 1, PERHAPS: 0}}


@pytest.mark.parametrize(("own_s", "refusals"), [(None, 1), (0.4, 1), (0.5, 0), (2.5, 0), (2.6, 1)])
def test_a_step_beside_one_of_the_primarys_is_not_refused(own_s, refusals):
    refused = Refused(latency_s=3.0)
    said(refused, PERHAPS)
    refused.count_beside("peaks", 1.5)
    if own_s is not None:
        refused.count(own_s)
    refused.end()
    assert sum(refused.counts.get("peaks", {}).values()) == refusals


def test_a_step_more_inside_a_walk_is_a_difference_and_no_refusal():
    refused = Refused(latency_s=0.0)
    said(refused, WALKING)
    refused.count_beside("peaks", 0.5)
    said(refused, WALKING, WALKING, start=2)
    assert refused.counts == {}


def test_the_verdict_is_that_of_the_steps_own_time():
    refused = Refused(latency_s=1.0)
    said(refused, REST, REST, PERHAPS)
    for at_s in (0.5, 2.0, 2.1, 3.0):
        refused.count_beside("peaks", at_s)
    said(refused, OTHER, OTHER, OTHER, start=4)
    assert refused.counts == {"peaks": {REST: 2, OTHER: 0, PERHAPS: 2}}


def test_of_what_it_did_not_come_to_before_a_gap_the_last_verdict_holds():
    refused = Refused(latency_s=1.0)
    said(refused, OTHER, OTHER)
    refused.count_beside("peaks", 2.9)  # the gap follows; then nothing is known yet, which the primary calls rest
    said(refused, REST, PERHAPS, start=60)
    refused.count_beside("peaks", 60.5)
    said(refused, PERHAPS, PERHAPS, start=62)
    assert refused.counts == {"peaks": {REST: 0, OTHER: 1, PERHAPS: 1}}


def test_a_primary_without_a_verdict_refuses_nothing():
    refused = Refused(latency_s=1.0)
    refused.count_beside("peaks", 0.5)
    refused.settle()
    refused.end()
    assert refused.counts == {}
    said(refused, OTHER)
    refused.count_beside("peaks", 0.5)
    refused.say(None)
    refused.end()
    assert refused.counts == {}


def test_what_it_keeps_does_not_grow():
    refused = Refused(latency_s=3.0)
    for at_s in range(600):
        refused.say(Gait(float(at_s), Verdict.WALKING if at_s % 2 else OTHER, 0.5, None))
        refused.count(float(at_s))
        refused.count_beside("peaks", float(at_s))
        refused.settle()
    state = refused.snapshot()
    assert len(state["own"]) == KEPT_S + 1
    assert len(state["runs"]) <= KEPT_S + 2
    assert len(state["waiting"]) == 4


@settings(max_examples=50)
@given(
    steps=st.lists(st.tuples(st.sampled_from("ab"), st.floats(0, 30), st.floats(0, 9)), max_size=60),
    own=st.lists(st.tuples(st.floats(0, 30), st.floats(0, 3)), max_size=30),
    verdicts=st.lists(st.sampled_from(Verdict), min_size=40, max_size=40),
    every=st.integers(1, 12),
)
def test_when_it_is_asked_changes_nothing(steps, own, verdicts, every):
    """Steps become known some time after they happened; settled once a second or seldom, the same are refused."""

    def judged(every):
        refused = Refused(latency_s=3.0)
        for now in range(1, 41):
            refused.say(Gait(float(now), verdicts[now - 1], 0.5, None))
            for at_s in sorted(at_s for at_s, late_s in own if now - 1 < at_s + late_s <= now):
                refused.count(at_s)
            for name in "ab" if every == 1 else "ba":
                for at_s in [at_s for who, at_s, late_s in steps if who == name and now - 1 < at_s + late_s <= now]:
                    refused.count_beside(name, at_s)
            if now % every == 0:
                refused.settle()
                state, refused = refused.snapshot(), Refused(latency_s=3.0)
                refused.restore(state)
        refused.settle()
        return refused.snapshot()

    assert judged(1) == judged(every)
