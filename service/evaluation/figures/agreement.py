"""How well and how fast the counters count, drawn from rows: bars, Bland–Altman, error by cadence."""

from __future__ import annotations

import textwrap
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from service.evaluation.figures.canvas import COLOURS, label, picture
from service.evaluation.metrics import accuracy_percent
from service.evaluation.papers.chen2015 import CALCULATION_S
from service.evaluation.papers.report import Bar
from service.evaluation.papers.results import TIMED_SAMPLES
from service.evaluation.rows import Row
from service.signals.compiled import available

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

OUTLINE: Final[dict[str, Any]] = {"edgecolor": "black", "lw": 1.2}
"""Of a published figure's bar, over ours."""
LEVEL_GROUPS: Final = 6
"""More are named aslant."""
LINE_CHARACTERS: Final = 84
"""Of all names side by side."""
FEW_GROUPS: Final = 4
"""Fewer are drawn no wider."""
BAR_FROM_PERCENT: Final = 1.0
"""A shorter bar cannot be seen: its value is written instead."""
STEPS_OFF: Final = "counted − true / steps"
BAND_SPM: Final = 10.0
"""Cadences are put together in bands as wide, for a median each."""
LINEAR_PERCENT: Final = 10.0
"""Errors up to this are drawn to scale, larger ones by their logarithm."""
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
    """Mean accuracy by data set and counter; what is below 0, where twice the steps are counted, as a number."""
    by_counter = walks(rows)
    groups = list(dict.fromkeys(row.dataset for found in by_counter.values() for row in found))

    def draw(axes: list[Axes]) -> None:
        width = 0.8 / max(len(by_counter), 1)
        slots = _slots([(row.dataset, counter) for counter, found in by_counter.items() for row in found], width)
        for number, (counter, found) in enumerate(by_counter.items()):
            means = {group: _mean_accuracy(of) for group in groups if (of := [r for r in found if r.dataset == group])}
            at = [slots[group, counter] for group in means]
            _bars(axes[0], at, list(means.values()), width, number, counter)
        _name_groups(axes[0], groups)
        label(axes[0], title="Mean accuracy over recordings", y="accuracy / %", legend=True)

    return picture(path, draw)


def against_published(path: Path, bars: Sequence[Bar]) -> Path:
    """Figure 12 of 2015: a paper's accuracies beside ours, on walkers above and on real recordings below."""
    panels = [found for real in (False, True) if (found := [bar for bar in bars if bar.real is real])]
    methods = list(dict.fromkeys(bar.method for bar in bars))

    def draw(axes: list[Axes]) -> None:
        from matplotlib.patches import Patch  # noqa: PLC0415  # heavy, and an extra

        ours = [Patch(color=_colour(number), label=f"{method}, ours") for number, method in enumerate(methods)]
        handles = [*ours, Patch(fill=False, **OUTLINE, label="published")]
        for each, found in zip(axes, panels, strict=True):
            _beside_published(each, found, methods)
        label(axes[0], title="Accuracies and what the paper claims", legend=True, handles=handles)

    return picture(path, draw, panels=len(panels), share_x=False)


def _beside_published(axes: Axes, bars: Sequence[Bar], methods: Sequence[str]) -> None:
    groups = list(dict.fromkeys(bar.group for bar in bars))
    width = 0.8 / len(methods)
    held = {(bar.group, bar.method) for bar in bars}
    slots = _slots([(group, method) for group in groups for method in methods if (group, method) in held], width)
    for number, method in enumerate(methods):
        of = [bar for bar in bars if bar.method == method]
        at = [slots[bar.group, method] for bar in of]
        _bars(axes, at, [bar.ours for bar in of], width, number, f"{method}, ours")
        axes.bar(at, [bar.published for bar in of], width, fill=False, **OUTLINE)
    _name_groups(axes, groups)
    aside = 0.5 + max(0.0, (FEW_GROUPS - len(groups)) / 2)
    axes.set_xlim(-aside, len(groups) - 1 + aside)
    label(axes, y=f"{'recordings' if bars[0].real else 'walkers'}\naccuracy / %")


def _slots(held: Sequence[tuple[str, str]], width: float) -> dict[tuple[str, str], float]:
    """Return where the bar of each (group, method) stands; methods that have none in a group take no room there."""
    groups: dict[str, list[str]] = defaultdict(list)
    for group, method in dict.fromkeys(held):
        groups[group].append(method)
    return {
        (group, method): number + (rank - (len(here) - 1) / 2) * width
        for number, (group, here) in enumerate(groups.items())
        for rank, method in enumerate(here)
    }


def _name_groups(axes: Axes, groups: Sequence[str]) -> None:
    """Name the groups side by side; many of them aslant, where names as long as theirs would run into each other."""
    if len(groups) > LEVEL_GROUPS:
        axes.set_xticks(range(len(groups)), groups, fontsize="x-small", rotation=30, ha="right", rotation_mode="anchor")
    else:
        names = [_wrapped(group, LINE_CHARACTERS // max(len(groups), 1)) for group in groups]
        axes.set_xticks(range(len(groups)), names, fontsize="small")


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


def _bars(axes: Axes, at: Sequence[float], percents: Sequence[float], width: float, number: int, name: str) -> None:
    """Draw bars from 0 to 100; one that ends below 0 has its value written where it would stand."""
    colour = _colour(number)
    axes.bar(at, np.clip(percents, 0, None), width, color=colour, label=name)
    for place, percent in zip(at, percents, strict=True):
        if percent < BAR_FROM_PERCENT:
            text = f"{percent:.0f} %".replace("-", "−")
            axes.text(place, 1, text, color=colour, ha="center", va="bottom", rotation=90, fontsize="small")
    axes.set_ylim(0, 105)


def timing(path: Path, rows: Sequence[Row]) -> Path:
    """Figure 13 of 2015: seconds for 5,000 samples, ours beside the published."""
    elapsed: dict[str, list[tuple[float, int]]] = defaultdict(list)
    for row in rows:
        if row.elapsed_s is not None and row.samples:
            elapsed[row.counter].append((row.elapsed_s, row.samples))
    names = list(elapsed)
    ours_s = [TIMED_SAMPLES * sum(e for e, _ in elapsed[name]) / sum(n for _, n in elapsed[name]) for name in names]

    how = "compiled by numba" if available() else "plain Python, numba is missing"

    def draw(axes: list[Axes]) -> None:
        at = np.arange(len(names))
        axes[0].bar(at - 0.2, ours_s, 0.4, color=COLOURS[0], label=f"here, counting only, {how}")
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
            label(each, y=STEPS_OFF)
            text = (
                f"{counter}: bias {bias:+.1f} steps, limits {bias - LIMITS_SD * sd:+.1f} … {bias + LIMITS_SD * sd:+.1f}"
            )
            each.set_title(text, fontsize="small", loc="left")
        label(axes[-1], title="Agreement of counted and true steps", x="mean of counted and true / steps")

    return picture(path, draw, panels=max(len(by_counter), 1), share_y=True)


def error_by_cadence(path: Path, rows: Sequence[Row]) -> Path:
    """Error in percent against cadence, true steps over the whole time of a recording; a panel for each counter."""
    by_counter = walks(rows)

    def draw(axes: list[Axes]) -> None:
        for each, (number, (counter, found)) in zip(axes, enumerate(by_counter.items()), strict=False):
            cadence_spm = np.array([60 * (row.true_steps or 0) / (row.duration_s or 1.0) for row in found])
            percent = np.array([100 * (counted - true) / true for true, counted in _pairs(found)])
            each.plot(cadence_spm, percent, ".", color=COLOURS[number % len(COLOURS)], alpha=0.4)
            each.plot(
                *medians(cadence_spm, percent), "_", color="black", ms=12, mew=2, label="median of each 10 steps/min"
            )
            each.axhline(0, color="black", lw=0.8)
            each.set_yscale("symlog", linthresh=LINEAR_PERCENT, subs=[3])
            each.yaxis.set_major_formatter("{x:g}")
            each.yaxis.set_minor_formatter("{x:g}")
            each.tick_params(axis="y", which="both", labelsize="small")
            each.set_title(counter, fontsize="small", loc="right")
            label(each, y="error / %", legend=not number)
        label(axes[-1], title="Error by cadence: (counted − true)/true", x="cadence / steps/min")

    return picture(path, draw, panels=max(len(by_counter), 1), share_y=True)


def medians(cadence_spm: Floats, percent: Floats) -> tuple[list[float], list[float]]:
    """Return the middles of the bands of cadence that hold recordings, and the median error in each."""
    band = np.floor(cadence_spm / BAND_SPM)
    held = np.unique(band)
    return [(b + 0.5) * BAND_SPM for b in held.tolist()], [float(np.median(percent[band == b])) for b in held]


def _pairs(rows: Sequence[Row]) -> list[tuple[int, int]]:
    return [(row.true_steps or 0, row.steps or 0) for row in rows]


def _mean_accuracy(rows: Sequence[Row]) -> float:
    return float(np.mean([accuracy_percent(counted, true) for true, counted in _pairs(rows)])) if rows else np.nan


def _wrapped(name: str, width: int) -> str:
    """Break a name into lines, at underscores too."""
    return "\n".join(textwrap.wrap(name.replace("_", "_ "), width)).replace("_ ", "_")
