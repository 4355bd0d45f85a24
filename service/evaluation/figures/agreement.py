"""How well and how fast the counters count, drawn from rows: bars, Bland–Altman, error by cadence."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from service.evaluation.figures.canvas import COLOURS, label, picture
from service.evaluation.metrics import accuracy_percent
from service.evaluation.papers.chen2015 import CALCULATION_S
from service.evaluation.papers.results import TIMED_SAMPLES
from service.evaluation.rows import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIMITS_SD: Final = 1.96
"""Limits of agreement: 95 % of differences, were they normal (Bland and Altman 1986)."""


def walks(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return by counter the rows that hold true steps and a count."""
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        if row.true_steps and row.steps is not None and row.duration_s:
            found[row.counter].append(row)
    return dict(found)


def accuracy(path: Path, rows: Sequence[Row]) -> Path:
    """Figure 12 of 2015: mean accuracy by data set and counter; below 0 where twice the steps are counted."""
    by_counter = walks(rows)
    groups = list(dict.fromkeys(row.dataset for found in by_counter.values() for row in found))

    def draw(axes: list[Axes]) -> None:
        width = 0.8 / max(len(by_counter), 1)
        for number, (counter, found) in enumerate(by_counter.items()):
            means = [_mean_accuracy([row for row in found if row.dataset == group]) for group in groups]
            at = np.arange(len(groups)) + (number - (len(by_counter) - 1) / 2) * width
            axes[0].bar(at, np.clip(means, 0, None), width, color=COLOURS[number % len(COLOURS)], label=counter)
        axes[0].set_xticks(range(len(groups)), [_short(group) for group in groups], rotation=20, ha="right")
        axes[0].set_ylim(0, 105)
        label(axes[0], title="Mean accuracy over recordings", y="accuracy / %", legend=True)

    return picture(path, draw)


def timing(path: Path, rows: Sequence[Row]) -> Path:
    """Figure 13 of 2015: seconds for 5,000 samples, ours beside the published."""
    elapsed: dict[str, list[tuple[float, int]]] = defaultdict(list)
    for row in rows:
        if row.elapsed_s is not None and row.samples:
            elapsed[row.counter].append((row.elapsed_s, row.samples))
    names = list(elapsed)
    ours_s = [TIMED_SAMPLES * sum(e for e, _ in elapsed[name]) / sum(n for _, n in elapsed[name]) for name in names]

    def draw(axes: list[Axes]) -> None:
        at = np.arange(len(names))
        axes[0].bar(at - 0.2, ours_s, 0.4, color=COLOURS[0], label="here, counting only")
        published = [(number, CALCULATION_S[name]) for number, name in enumerate(names) if name in CALCULATION_S]
        if published:
            places, seconds = zip(*published, strict=True)
            axes[0].bar(np.array(places) + 0.2, seconds, 0.4, color=COLOURS[3], label="published, MATLAB, 2.27 GHz")
        axes[0].set_yscale("log")
        axes[0].set_xticks(at, names, rotation=20, ha="right")
        label(axes[0], title="Calculation time", y="time for 5,000 samples / s", legend=True)

    return picture(path, draw)


def bland_altman(path: Path, rows: Sequence[Row]) -> Path:
    """Difference against mean of counted and true steps; bias and limits of agreement of each counter."""
    by_counter = walks(rows)

    def draw(axes: list[Axes]) -> None:
        for each, (number, (counter, found)) in zip(axes, enumerate(by_counter.items()), strict=False):
            true, counted = (np.array(column, dtype=np.float64) for column in zip(*_pairs(found), strict=True))
            difference, colour = counted - true, COLOURS[number % len(COLOURS)]
            bias, sd = float(difference.mean()), float(difference.std(ddof=1)) if len(difference) > 1 else 0.0
            each.plot((counted + true) / 2, difference, ".", color=colour, alpha=0.6)
            each.axhline(bias, color=colour, lw=1.2)
            for limit in (bias - LIMITS_SD * sd, bias + LIMITS_SD * sd):
                each.axhline(limit, color=colour, lw=1, ls="--")
            label(each, y="counted − true")
            text = (
                f"{counter}: bias {bias:+.1f} steps, limits {bias - LIMITS_SD * sd:+.1f} … {bias + LIMITS_SD * sd:+.1f}"
            )
            each.set_title(text, fontsize="small", loc="left")
        label(axes[-1], title="Agreement of counted and true steps", x="mean of counted and true / steps")

    return picture(path, draw, panels=max(len(by_counter), 1))


def error_by_cadence(path: Path, rows: Sequence[Row]) -> Path:
    """Error in percent against cadence, true steps over the whole time of a recording."""
    by_counter = walks(rows)

    def draw(axes: list[Axes]) -> None:
        for number, (counter, found) in enumerate(by_counter.items()):
            cadence = [60 * (row.true_steps or 0) / (row.duration_s or 1.0) for row in found]
            error = [100 * (counted - true) / true for true, counted in _pairs(found)]
            colour = COLOURS[number % len(COLOURS)]
            axes[0].plot(cadence, error, ".", color=colour, alpha=0.6, label=counter)
        axes[0].axhline(0, color="black", lw=0.8)
        axes[0].set_yscale("symlog", linthresh=10)
        label(axes[0], title="Error by cadence", x="cadence / steps/min", y="(counted − true)/true / %", legend=True)

    return picture(path, draw)


def _pairs(rows: Sequence[Row]) -> list[tuple[int, int]]:
    return [(row.true_steps or 0, row.steps or 0) for row in rows]


def _mean_accuracy(rows: Sequence[Row]) -> float:
    return float(np.mean([accuracy_percent(counted, true) for true, counted in _pairs(rows)])) if rows else np.nan


def _short(name: str, most: int = 24) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"
