"""The guide's page about training says of each option and default what the command does."""

import argparse
import re
from importlib import resources

import pytest

from service import cli_training
from service.evaluation.training import recipe
from service.evaluation.training.material import UNSTATED
from service.evaluation.training.sources import AUXILIARY

PAGE = resources.files("service").joinpath("guide/training.md").read_text("utf-8")
SHARED = {"--lsb-per-g", "--columns", "--units", "--time-unit", "--gyro-units", "--rate-hz", "--help"}
"""Options that every command has which reads recordings; README tells of them."""


def parser():
    made = argparse.ArgumentParser()
    cli_training.add_options(made)
    return made


def test_every_option_is_told_and_no_other():
    has = {option for action in parser()._actions for option in action.option_strings} - SHARED - {"-h"}
    assert set(re.findall(r"^\| `(--[a-z-]+)", PAGE, re.MULTILINE)) == has


@pytest.mark.parametrize(
    "said",
    [
        f"default {recipe.STEPS}, with `--from` {recipe.TUNING_STEPS}",
        f"default `{cli_training.OUT}`",
        f"{cli_training.DID_NOT_HELP} fine-tuning did not help",
        *sorted(f"`{name}`" for name in (UNSTATED - AUXILIARY) | AUXILIARY),
    ],
)
def test_what_is_said_is_so(said):
    assert said in PAGE


def test_the_help_is_of_the_same_numbers():
    text = parser().format_help()
    assert f"default {recipe.STEPS}, with --from {recipe.TUNING_STEPS}" in re.sub(r"\s+", " ", text)
