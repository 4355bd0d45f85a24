"""The guide's page of accuracy cannot be out of date in silence: its families are those of the pinned counts."""

import csv
import re
from pathlib import Path

import pytest
from counters import golden

from service.evaluation.families import Outcome, scores
from service.evaluation.scorecard import report

PAGE = Path(__file__).parents[3] / "service" / "guide" / "accuracy.md"
HOW = "rewrite it with the command that it names"


def shown():
    """Return the values of the families' table by (family, counter)."""
    table = PAGE.read_text("utf-8").partition("### Families")[2].partition("###")[0]
    lines = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line.startswith("|")
    ]
    counters = lines[0][2 : lines[0].index("must")]
    return {
        (family, counter): float(value.removesuffix(report.OVER))
        for family, _, *values in lines[2:]
        for counter, value in zip(counters, values, strict=False)
    }


def pinned(recordings, counter):
    """Return the families' values of a counter's golden counts."""
    with (recordings / "index.csv").open(encoding="utf-8") as index:
        listed = {(row["dataset"], row["recording"]): row for row in csv.DictReader(index)}
    outcomes = []
    for row in golden.expected():
        about = listed[row["dataset"], row["recording"]]
        outcomes.append(
            Outcome(
                dataset=row["dataset"],
                true=int(row["true"]),
                counted=int(row[counter]),
                duration_s=float(about["dur_s"]),
                placement=about["placement"],
                activity=about["activity"],
                quality=about["gt_quality"],
            )
        )
    return {(family.value, counter): score.value for family, score in scores(outcomes).items()}


@pytest.mark.full
def test_the_page_has_the_families_of_the_pinned_counts(recordings):
    table = shown()
    for counter in {counter for _, counter in table}:
        for key, value in pinned(recordings, counter).items():
            assert table[key] == pytest.approx(value, rel=0, abs=0.002 * value + (0.51 if value >= 20 else 0.051)), (
                f"{key}: {HOW}"
            )


def test_the_page_has_the_tables_and_figures_that_are_asked_for():
    text = PAGE.read_text("utf-8")
    asked = {
        "Families", "Sources", "Counts within what the truth allows", "Step-free clips between two walks", "Step times",
        "Disturbed walks", "Disturbed, without steps", "Situations",
    }  # fmt: skip
    assert asked <= set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    figures = set(re.findall(r"\]\((accuracy_\w+\.svg)\)", text))
    assert figures == {path.name for path in PAGE.parent.glob("*.svg")}
    counters = {counter for _, counter in shown()}
    assert len(counters) > 1
    for what in (
        *(f"{of}_{counter}" for of in ("activities", "recordings") for counter in counters),
        "cadence",
        "placement",
        "rate",
        "range",
        "bits",
        "loss",
    ):
        assert f"accuracy_{what}.svg" in figures
