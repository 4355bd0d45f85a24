"""A paper's conditions counted: for each row and method the steps of every walker, and the figures a table prints.

Variances are the populations', as the papers' are (Table II of 2013: 10.70 of 11 steps by ten people vary by 0.21).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from service.counters import registry
from service.evaluation.counting import count
from service.evaluation.metrics import accuracy_percent
from service.evaluation.papers.conditions import Claim, Condition, Figures, Method, Paper, Table
from service.evaluation.papers.people import block
from service.evaluation.rows import Row
from service.samples import GRID_HZ, Columns, SampleBlock

TIMED_SAMPLES: Final = 5000
"""Figure 13 of 2015."""
BEST_OF: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What one method counted of one condition: a row for each walker; None where there is no such counter.

    `table` is the table's number in its paper, from 1.
    """

    table: int
    condition: Condition
    method: Method
    rows: tuple[Row, ...] | None

    @property
    def ours(self) -> Figures:
        """Our figures; empty where nothing was counted."""
        return Figures() if self.rows is None else figures(pairs(self.rows))

    @property
    def published(self) -> Figures:
        """The paper's figures; empty where it prints none."""
        return self.condition.published.get(self.method.label, Figures())


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Seconds for TIMED_SAMPLES: published, in plain Python, and compiled (None without numba)."""

    counter: str
    published_s: float
    plain_s: float
    fast_s: float | None


def figures(steps: Sequence[tuple[int, int]]) -> Figures:
    """Return means, variances and extremes of (true, counted) over walkers; no accuracy where there are no steps.

    >>> f = figures([(10, 10), (10, 9)])
    >>> f.counted, f.counted_var, f.accuracy, f.accuracy_var, f.low, f.high
    (9.5, 0.25, 95.0, 25.0, 90.0, 100.0)
    """
    true, counted = (np.array(column, dtype=np.float64) for column in zip(*steps, strict=True))
    accuracy = np.array([accuracy_percent(c, t) for t, c in steps if t])
    some = len(accuracy) == len(steps)
    return Figures(
        true=float(true.mean()),
        counted=float(counted.mean()),
        true_var=float(true.var()),
        counted_var=float(counted.var()),
        accuracy=float(accuracy.mean()) if some else None,
        accuracy_var=float(accuracy.var()) if some else None,
        low=float(accuracy.min()) if some else None,
        high=float(accuracy.max()) if some else None,
    )


def pairs(rows: Iterable[Row]) -> tuple[tuple[int, int], ...]:
    """Return (true, counted) of each row."""
    return tuple((row.true_steps or 0, row.steps or 0) for row in rows)


def walkers(paper: Paper) -> int:
    """Return how many walks `results` counts."""
    return sum(row.walkers * len(table.methods) for table in paper.tables for row in table.rows)


def results(paper: Paper, preset: str = "paper") -> Iterator[Result | None]:
    """Yield the paper's results in order, and None after every walk, so that a caller may show how far it is.

    The single walks of a table are by as many people.
    """
    for number, table in enumerate(paper.tables, start=1):
        for at, condition in enumerate(table.rows):
            people = [at] if condition.walkers == 1 else range(condition.walkers)
            for method in table.methods:
                if method.counter not in registry.COUNTERS:
                    yield Result(table=number, condition=condition, method=method, rows=None)
                    continue
                rows = []
                for k in people:
                    rows.append(_counted(paper, table, condition, method, k, preset))
                    yield None
                yield Result(table=number, condition=condition, method=method, rows=tuple(rows))


def claimed(claim: Claim, found: Sequence[Result]) -> float | None:
    """Return our accuracy for a claim, in percent; None where its counter is missing."""
    values = [
        result.ours
        for result in found
        if result.table in claim.tables and claim.rows in result.condition.label and claim.method == result.method.label
    ]
    if claim.of == "least":
        return min((f.low for f in values if f.low is not None), default=None)
    accuracies = [f.accuracy for f in values if f.accuracy is not None]
    if not accuracies:
        return None
    return min(accuracies) if claim.of == "least mean" else float(np.mean(accuracies))


def timings(paper: Paper, preset: str = "paper") -> list[Timing]:
    """Return how long the paper's counters take for TIMED_SAMPLES of its first table's first walker, best of five."""
    first = paper.tables[0].rows[0]
    walked = block(first, 0)
    piece = SampleBlock(start=0, acc_g=_cut(walked.acc_g), gyro_rad_s=None, mag_ut=None)
    found = []
    for counter, published_s in paper.elapsed_s.items():
        if counter in registry.COUNTERS:
            plain_s, fast_s = (_best_s(piece, counter, preset, fast=fast) for fast in (False, True))
            fast = fast_s if _compiles() else None
            found.append(Timing(counter=counter, published_s=published_s, plain_s=plain_s, fast_s=fast))
    return found


def _compiles() -> bool:
    from service.signals.compiled import available  # noqa: PLC0415

    return available()


def _best_s(piece: SampleBlock, counter: str, preset: str, *, fast: bool) -> float:
    return min(count(piece, counter, preset, fast=fast and _compiles()).elapsed_s for _ in range(BEST_OF))


def _cut(columns: Columns) -> Columns:
    x, y, z = (np.resize(np.asarray(column), TIMED_SAMPLES) for column in columns)
    return x, y, z


def _counted(paper: Paper, table: Table, condition: Condition, method: Method, k: int, preset: str) -> Row:
    walked = block(condition, k, mirrored=method.mirrored, noise_g=table.noise_g)
    overrides = dict(method.params)
    if paper.prepare is not None:
        slowest = None if paper.calibration is None else block(paper.calibration, k)
        overrides |= paper.prepare(walked, slowest, registry.parameters(method.counter, preset, overrides))
    counted = count(walked, method.counter, preset, overrides)
    return Row(
        path=f"{paper.name}/{condition.label}/{k}",
        dataset=table.title,
        counter=method.counter,
        preset=preset,
        params=asdict(registry.parameters(method.counter, preset, overrides)),
        placement=condition.pose,
        activity=condition.label,
        rate_hz=float(GRID_HZ),
        true_steps=condition.steps,
        steps=counted.steps,
        duration_s=counted.samples / GRID_HZ,
        samples=counted.samples,
        elapsed_s=counted.elapsed_s,
    )
