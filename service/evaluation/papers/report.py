"""A paper's tables as text and as plain data: its rows and columns, its figures beside ours.

A table of single walks prints true and counted steps, error and accuracy; a table of several walkers a condition prints
means and variances of steps, and mean, variance, minimum and maximum of accuracy, the published line above ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np

from service.evaluation.papers.conditions import Figures, Paper, Table
from service.evaluation.papers.real import Measured
from service.evaluation.papers.results import Result, Timing, claimed
from service.evaluation.rows import Row
from service.evaluation.tables import aligned

MISSING: Final = "not available"
LEGEND: Final = """\
Published: the paper's own figures, where our copy has them. Ours: synthetic walkers of the same conditions, each row of
which says what it was measured on (device_sim/gait_profiles.py, gait_poses.py). Accuracy = 1 − |error|/true, in
percent; variances are the populations'."""

WALK_COLUMNS: Final = ("true", "published", "error", "accuracy", "ours", "error", "accuracy")
MANY_COLUMNS: Final = ("", "true", "var", "counted", "var", "accuracy", "var", "min", "max")


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """An accuracy in percent beside the published one: of a claim on walkers, or on the recordings of a data set."""

    group: str
    method: str
    ours: float
    published: float
    real: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Everything about one paper: synthetic results, real ones (None where none were asked for), times."""

    paper: Paper
    preset: str
    results: Sequence[Result]
    measured: Sequence[Measured] | None = None
    timings: Sequence[Timing] = ()

    @property
    def rows(self) -> list[Row]:
        """Every walk and recording that was counted."""
        made = [row for result in self.results for row in result.rows or ()]
        return made + [row for found in self.measured or () for row in found.rows]

    @property
    def bars(self) -> list[Bar]:
        """Every accuracy that has a published one beside it, by what it is about: the papers' Figure 12."""
        made = [
            Bar(group=claim.about, method=claim.method, ours=ours, published=claim.percent, real=False)
            for claim in self.paper.claims
            if (ours := claimed(claim, self.results)) is not None
        ]
        return made + [
            Bar(
                group=f"{row.condition.label} ({row.dataset})",
                method=row.method.label,
                ours=row.figures.accuracy,
                published=row.claim,
                real=True,
            )
            for row in self.measured or ()
            if row.claim is not None and row.figures.accuracy is not None
        ]

    def text(self) -> str:
        """Return it for a terminal."""
        paper = self.paper
        head = f"{paper.title}\npreset {self.preset}; {_asked(self.results)}"
        tables = [
            _table(table, [result for result in self.results if result.table == number])
            for number, table in enumerate(paper.tables, start=1)
        ]
        parts = [head, *tables, _claims(paper, self.results), *_real(self.measured), *_times(self.timings), LEGEND]
        return "\n\n".join(parts)

    def as_json(self) -> list[dict[str, Any]]:
        """Return it as plain data: a row for each condition and method, synthetic first, then real."""
        made = [
            {
                "paper": self.paper.name,
                "table": self.paper.tables[result.table - 1].title,
                "condition": result.condition.label,
                "method": result.method.label,
                "counter": result.method.counter,
                "preset": self.preset,
                "walkers": result.condition.walkers,
                "published": asdict(result.published),
                "ours": asdict(result.ours),
            }
            for result in self.results
        ]
        return made + [_real_row(self.paper, row, self.preset) for row in self.measured or ()]


def _asked(results: Sequence[Result]) -> str:
    counters = dict.fromkeys(result.method.counter for result in results)
    absent = dict.fromkeys(result.method.counter for result in results if result.rows is None)
    return ", ".join(f"{name} ({MISSING})" if name in absent else name for name in counters)


def _table(table: Table, found: Sequence[Result]) -> str:
    single = all(row.walkers == 1 for row in table.rows)
    lines = _walks(found) if single else _many(found)
    body = aligned(lines, left=2 if single else 3)
    return "\n".join(part for part in (table.title, table.note, body) if part)


def _walks(found: Sequence[Result]) -> list[list[str]]:
    """Lay out a line for each walk and method, and at the end the mean accuracies."""
    lines = [["condition", "method", *WALK_COLUMNS]]
    for result in found:
        published = result.published
        true = published.true if published.true is not None else float(result.condition.steps)
        ours = [MISSING, "", ""] if result.rows is None else _counts(result.ours, result.ours.true)
        cells = [_number(true, 0), *_counts(published, true), *ours]
        lines.append([result.condition.label, result.method.label, *cells])
    for method in dict.fromkeys(result.method.label for result in found):
        of = [result for result in found if result.method.label == method]
        means = [_mean([getattr(result, which).accuracy for result in of]) for which in ("published", "ours")]
        lines.append(["mean", method, "", "", "", _number(means[0]), "", "", _number(means[1])])
    return lines


def _many(found: Sequence[Result]) -> list[list[str]]:
    """Lay out a published and an own line for each condition and method."""
    lines = [["condition", "method", *MANY_COLUMNS]]
    for result in found:
        if result.published != Figures():
            lines.append([result.condition.label, result.method.label, "published", *_statistics(result.published)])
        ours = [MISSING, *[""] * 7] if result.rows is None else _statistics(result.ours)
        lines.append([result.condition.label, result.method.label, "ours", *ours])
    for before, line in reversed(list(pairwise(lines))):
        if before[0] == line[0]:
            line[0] = ""
    return lines


def _counts(of: Figures, true: float | None) -> list[str]:
    if of.counted is None or true is None:
        return ["", "", _number(of.accuracy)]
    return [_number(of.counted, 0), f"{of.counted - true:+.0f}", _number(of.accuracy)]


def _statistics(of: Figures) -> list[str]:
    values = (of.true, of.true_var, of.counted, of.counted_var, of.accuracy, of.accuracy_var, of.low, of.high)
    return [_number(value) for value in values]


def _claims(paper: Paper, results: Sequence[Result]) -> str:
    lines = [["claim of the text", "published", "ours, synthetic", "met?"]]
    for claim in paper.claims:
        ours = claimed(claim, results)
        lines.append(
            [claim.text, _number(claim.percent), MISSING if ours is None else _number(ours), _met(ours, claim.percent)]
        )
    return "\n".join(["Claims", aligned(lines, left=1)])


def _met(ours: float | None, claim: float | None) -> str:
    if ours is None or claim is None:
        return ""
    return "yes" if ours >= claim else f"short by {claim - ours:.2f}"


def _real(measured: Sequence[Measured] | None) -> list[str]:
    """Lay out the real recordings: accuracy where they hold steps, false steps an hour where they hold none."""
    if measured is None:
        return ["Real recordings: none given. Name a PATH, or set STEPLINK_DATA."]
    if not measured:
        return [
            "Real recordings: none there has one of this paper's conditions, its sensors and a true number of steps."
        ]
    columns = ("rec.", "true", "counted", "accuracy", "var", "min", "max", "false/h", "claim", "met?")
    lines = [["condition", "data set", "method", *columns]]
    for row in measured:
        of, claim = row.figures, row.claim
        true, counted = (sum(column) for column in zip(*row.steps, strict=True))
        accuracy = [_number(value) for value in (of.accuracy, of.accuracy_var, of.low, of.high)]
        false = "" if true else f"{row.false_per_hour:.0f}"
        verdict = [_number(claim), _met(of.accuracy, claim)]
        cells = [str(row.recordings), str(true), str(counted), *accuracy, false, *verdict]
        lines.append([row.condition.label, row.dataset, row.method.label, *cells])
    return ["\n".join(["Real recordings of the conditions", aligned(lines, left=3)])]


def _times(timings: Sequence[Timing]) -> list[str]:
    if not timings:
        return []
    lines = [["5,000 samples, s", "published", "plain Python", "times faster", "compiled", "times faster"]]
    for timing in timings:
        plain, fast = timing.plain_s, timing.fast_s
        compiled = ["", ""] if fast is None else [f"{fast:.6f}", f"{timing.published_s / fast:.0f}"]
        cells = [f"{timing.published_s:.3f}", f"{plain:.5f}", f"{timing.published_s / plain:.0f}", *compiled]
        lines.append([timing.counter, *cells])
    return ["\n".join(["Calculation time", aligned(lines, left=1)])]


def _real_row(paper: Paper, row: Measured, preset: str) -> dict[str, Any]:
    return {
        "paper": paper.name,
        "table": "real recordings",
        "condition": row.condition.label,
        "method": row.method.label,
        "counter": row.method.counter,
        "preset": preset,
        "dataset": row.dataset,
        "recordings": row.recordings,
        "claim": row.claim,
        "ours": asdict(row.figures),
        "false_per_hour": None if any(true for true, _ in row.steps) else row.false_per_hour,
    }


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _number(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"
