"""Which real recordings have a paper's conditions, and what the paper's counters make of them."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from service.errors import SteplinkError
from service.evaluation.choices import Found
from service.evaluation.papers.conditions import Figures, Method, Paper, Real
from service.evaluation.papers.results import figures, pairs
from service.evaluation.rows import Choice, Row
from service.recordings import read


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A method on the real recordings of one condition and data set; `hours` is their length."""

    condition: Real
    dataset: str
    method: Method
    recordings: int
    hours: float
    rows: tuple[Row, ...]

    @property
    def steps(self) -> tuple[tuple[int, int], ...]:
        """(true, counted) of each recording."""
        return pairs(self.rows)

    @property
    def claim(self) -> float | None:
        """Published accuracy of the method in this condition, in percent."""
        return self.condition.claims.get(self.method.label)

    @property
    def figures(self) -> Figures:
        """Means, variances and extremes over recordings."""
        return figures(self.steps)

    @property
    def false_per_hour(self) -> float:
        """Counted steps an hour, where there are none."""
        return sum(counted for _, counted in self.steps) / self.hours


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A recording of one of the paper's conditions; `magnitude_only`: all but its first axis is 0 throughout."""

    file: Found
    magnitude_only: bool

    def takes(self, method: Method) -> bool:
        """Tell whether the method finds in it what it is about."""
        return not (method.by_axis and self.magnitude_only)


def methods(paper: Paper) -> list[Method]:
    """Return the methods of the paper's tables, each once, without the other wrist."""
    found: list[Method] = []
    for table in paper.tables:
        found += [method for method in table.methods if method not in found and not method.mirrored]
    return found


def choice(method: Method, preset: str) -> Choice:
    """Return the method as `evaluate` takes it."""
    return Choice(counter=method.counter, preset=preset, overrides=method.params)


def wanted(paper: Paper, found: Sequence[Found], lsb_per_g: float) -> list[Wanted]:
    """Return the files that have one of the paper's conditions and a known number of steps."""
    looked = (_wanted(paper, file, lsb_per_g) for file in found)
    return [file for file in looked if file is not None]


def _wanted(paper: Paper, file: Found, lsb_per_g: float) -> Wanted | None:
    try:
        recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping)
    except SteplinkError:
        return None
    known = recording.true_steps is not None or recording.step_t_s is not None
    if not known or not any(fits(real, recording.placement, recording.activity) for real in paper.real):
        return None
    return Wanted(file=file, magnitude_only=not recording.acc_g[:, 1:].any())


def fits(real: Real, placement: str | None, activity: str | None) -> bool:
    """Tell whether a recording made so is one of the condition."""
    patterns = ((real.placement, placement), (real.activity, activity))
    return all(re.fullmatch(pattern, value or "") for pattern, value in patterns)


def measured(paper: Paper, counted: Sequence[tuple[Method, Row]]) -> list[Measured]:
    """Group counted recordings by condition, data set and method, in the paper's order."""
    groups: dict[tuple[int, str, int], list[Row]] = defaultdict(list)
    order = methods(paper)
    for method, row in counted:
        for number, real in enumerate(paper.real):
            if row.steps is not None and row.true_steps is not None and fits(real, row.placement, row.activity):
                groups[number, row.dataset, order.index(method)].append(row)
    return [_measured(paper.real[number], dataset, order[at], rows) for (number, dataset, at), rows in _sorted(groups)]


def _sorted(
    groups: dict[tuple[int, str, int], list[Row]],
) -> list[tuple[tuple[int, str, int], list[Row]]]:
    return sorted(groups.items(), key=lambda item: item[0])


def _measured(real: Real, dataset: str, method: Method, rows: Sequence[Row]) -> Measured:
    walks = [row for row in rows if row.true_steps] or list(rows)
    return Measured(
        condition=real,
        dataset=dataset,
        method=method,
        recordings=len(walks),
        hours=sum(row.duration_s or 0.0 for row in walks) / 3600,
        rows=tuple(walks),
    )
