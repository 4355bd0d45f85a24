"""The model card: it is of the weights that ship, and says of data and figures what there is to say."""

import dataclasses
from importlib import resources
from pathlib import Path

import pytest
from evaluation.training.recorded import material

from service.counters import steplink_weights
from service.evaluation.choices import Found
from service.evaluation.training import card, recipe
from service.evaluation.training.validation import Validation, outcome

ABOUT = {"steps": 1234, "seed": 5, "loss": 0.25, "sources": {"device_sim": 24}, "versions": {"jax": "9.8"}}


@pytest.fixture
def text():
    teaching = [material("pebble_wrist", "a"), material("pebble_wrist", "b", true_steps=0), material("mine", "c")]
    unseen = [material("brajdic_walk", "d", placement="hand")]
    apart = [Found(shown="x", path=Path("x"), dataset="oxford_opt_B")]
    held = [outcome(dataclasses.replace(one, steps_range=(30, 40)), 38) for one in teaching]
    return card.text("abc123", ABOUT, teaching, unseen, apart, [Validation(title="Held", outcomes={5: held})])


def rows(text, first):
    """Cells of the table rows that begin with a cell."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith(f"| {first} |")]


def test_the_card_of_the_guide_is_of_the_weights_that_ship():
    page = resources.files("service").joinpath("guide/model.md").read_text("utf-8")
    assert card.said_digest(page) == steplink_weights.digest(steplink_weights.shipped().weights)


def test_it_names_its_weights(text):
    assert card.said_digest(text) == "abc123"
    assert card.said_digest("# Nothing") is None


def test_data_and_licences_are_told(text):
    assert rows(text, "`pebble_wrist`")[0][3:] == ["Apache-2.0", "2", "0.7", "40", "yes"]
    assert rows(text, "`brajdic_walk`")[0][3:] == ["not stated in the copies", "1", "0.3", "40", "no: measured only"]
    assert rows(text, "`oxford_opt_B`")[0][-1] == "no: kept for the end"
    assert "whoever trained answers" in rows(text, "`mine`")[0][3]


def test_the_recipe_is_the_one_that_was_run(text):
    assert "Steps 1234, seed 5, mean loss of the last of them 0.25; jax 9.8." in text
    assert f"up to {recipe.HIGHEST_RATE:g}" in text
    assert sum(float(line[2].rstrip(" %")) for line in rows(text, "`pebble_wrist`")[1:]) > 0
    assert rows(text, "`device_sim`")[-1][1] == "walks"


def test_figures_are_those_that_were_measured(text):
    (walks,) = rows(text, "wrist walks")
    assert walks[3] == "5.0 %"
    assert "Of `pebble_wrist`, whose wearers knew their steps within limits, 2 of 2 counts" in text


def test_what_was_not_measured_is_said_to_be_so():
    made = card.text("abc123", {}, [material()], [], [], [])
    assert "Nothing was measured" in made
    assert "is not recorded in their file" in made


def test_limits_come_from_the_code_and_the_data(text):
    assert "not a medical device" in text
    assert "from 0.6 to 3.8 steps a second" in text
    assert "it is 2.0 to 2.0" in text
    assert "3 people or accounts of 2 sources" in text
