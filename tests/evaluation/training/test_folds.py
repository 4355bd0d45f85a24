"""What is held back: every recording once, nobody on both sides, nothing to hold back is an error."""

import pytest
from evaluation.training.recorded import material
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import ParameterError
from service.evaluation.training import folds

people = st.lists(
    st.tuples(st.sampled_from(["dcaiti", "banglejs_walk", "negatives_banglejs", "mine"]), st.sampled_from("abcdefg")),
    min_size=2,
    max_size=40,
)

few = settings(max_examples=25)


def made(people):
    return [material(source, subject, seconds=4.0) for source, subject in people]


def check(found, of):
    held = [place for fold in found for place in fold.held]
    assert sorted(held) == list(range(len(of)))
    for fold in found:
        assert sorted((*fold.held, *fold.taught(of))) == list(range(len(of)))
        assert fold.held
        assert fold.taught(of)


@few
@given(people=people.filter(lambda one: len(set(one)) > 1))
def test_subjects_are_on_one_side_each(people):
    of = made(people)
    if len({folds.person(one) for one in of}) < 2:
        return
    found = folds.by_subject(of)
    check(found, of)
    assert len(found) <= folds.PARTS
    for fold in found:
        learnt = {folds.person(of[place]) for place in fold.taught(of)}
        assert learnt.isdisjoint(folds.person(of[place]) for place in fold.held)


def test_sets_of_one_origin_are_held_back_together():
    of = made([("banglejs_walk", "a"), ("negatives_banglejs", "b"), ("dcaiti", "c")])
    found = folds.by_source(of)
    check(found, of)
    assert [(fold.name, fold.held) for fold in found] == [("banglejs", (0, 1)), ("dcaiti", (2,))]


def test_who_does_not_say_is_one_subject_of_a_source():
    of = made([("mine", "unknown"), ("mine", "Unknown "), ("mine", ""), ("dcaiti", "unknown")])
    assert len({folds.person(one) for one in of}) == 2


def test_own_recordings_of_one_person_are_held_back_one_by_one():
    of = [material(subject="me", recording=f"walk {number}", seconds=4.0) for number in range(3)]
    found = folds.of_own(of)
    check(found, of)
    assert len(found) == 3


@pytest.mark.parametrize("split", [folds.by_source, folds.by_subject, folds.of_own])
def test_a_single_recording_cannot_be_held_back(split):
    with pytest.raises(ParameterError, match="needed"):
        split([material(seconds=4.0)])


@pytest.mark.parametrize("split", [folds.by_source, folds.by_subject])
def test_one_source_of_one_subject_cannot_be_held_back(split):
    with pytest.raises(ParameterError, match="two s"):
        split([material(recording="a", seconds=4.0), material(recording="b", seconds=4.0)])
