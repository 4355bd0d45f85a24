"""Figures of Wang 2018 (2, 3, 4, 6, 7 and its thresholds): what the double threshold sees of a wrist."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from service.counters import registry
from service.evaluation.figures.canvas import COLOURS, label, picture
from service.evaluation.figures.sources import Floats, Source, middle, times_s
from service.evaluation.rows import Choice, Row
from service.samples import GRID_HZ, Band, Step

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIME: Final = "time / s"


NAME: Final = "double_threshold"
PUBLISHED: Final = Choice(counter=NAME, preset="paper", overrides={})


def evaluated(rows: Sequence[Row]) -> Choice:
    """Return how the double threshold was evaluated, so that it is drawn the same; as published where it was not."""
    for row in rows:
        if row.counter == NAME:
            overrides = {key: row.params[key] for key in row.changed}
            return Choice(counter=NAME, preset=row.preset, overrides=overrides)
    return PUBLISHED


@dataclass(frozen=True, slots=True, kw_only=True)
class Counted:
    """The double threshold's view of a source, times in s after its first sample: |X| filtered, thresholds, steps."""

    t_s: Floats
    filtered_g: Floats
    bands: Sequence[Band]
    steps: Sequence[Step]
    magnitude_g: Floats
    rest_g: float
    axes: str
    told: str


def counted(source: Source, chosen: Choice = PUBLISHED) -> Counted:
    """Count the source with the double threshold as it is `chosen`."""
    counter = registry.make(NAME, chosen.preset, chosen.overrides)
    update, rest = counter.update(source.signal), counter.finish()
    start_s = source.signal.start / GRID_HZ
    filtered_g = np.asarray(update.trace)
    t_s = update.trace_from_s - start_s + np.arange(len(filtered_g)) / GRID_HZ
    params = registry.parameters(NAME, chosen.preset, chosen.overrides)
    two = params.axes == "xz"
    return Counted(
        t_s=t_s,
        filtered_g=filtered_g,
        bands=update.bands + rest.bands,
        steps=update.steps + rest.steps,
        magnitude_g=_two_axes_g(source) if two else source.norm_g,
        rest_g=params.rest_raw / params.lsb_per_g,
        axes="√(X² + Z²)" if two else "norm",
        told=" ".join([f"{NAME}, preset {chosen.preset}", *(f"{k}={v}" for k, v in chosen.overrides.items())]),
    )


def _two_axes_g(source: Source) -> Floats:
    two_g: Floats = np.sqrt((source.acc_g[:, [0, 2]] ** 2).sum(axis=1))
    return two_g


def raw_axes(path: Path, source: Source) -> Path:
    """Figure 2: the three axes."""
    part = middle(source)

    def draw(axes: list[Axes]) -> None:
        for each, column, name, colour in zip(axes, source.acc_g[part].T, "XYZ", COLOURS, strict=False):
            each.plot(times_s(part), column, color=colour, lw=1)
            label(each, y=f"{name} / g")
        label(axes[0], title=f"Acceleration on three axes: {source.name}")
        label(axes[-1], x=TIME)

    return picture(path, draw, panels=3)


def magnitude(path: Path, source: Source) -> Path:
    """Figure 3: magnitude on two axes, the norm beside it."""
    part = middle(source)
    two_g = _two_axes_g(source)[part]

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(times_s(part), two_g, color=COLOURS[0], lw=1, label="√(X² + Z²), two axes (4)")
        axes[0].plot(times_s(part), source.norm_g[part], color=COLOURS[1], lw=1, label="norm, three axes")
        label(axes[0], title=f"Magnitude: {source.name}", x=TIME, y="acceleration / g", legend=True)

    return picture(path, draw)


def filtered(path: Path, source: Source, chosen: Choice = PUBLISHED) -> Path:
    """Figure 4: the magnitude before and after the five-point mean, at the times of its samples."""
    part, seen = middle(source), counted(source, chosen)
    shown = _shown(seen.t_s, part)

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(times_s(part), seen.magnitude_g[part], color=COLOURS[0], lw=0.7, alpha=0.6, label=seen.axes)
        axes[0].plot(seen.t_s[shown], seen.filtered_g[shown], color=COLOURS[1], lw=1.4, label="five-point mean (5)")
        label(
            axes[0], title=f"Filtered magnitude: {source.name}\n{seen.told}", x=TIME, y="acceleration / g", legend=True
        )

    return picture(path, draw)


def thresholds(path: Path, source: Source, chosen: Choice = PUBLISHED) -> Path:
    """Both thresholds, window by window, and the steps (9)(10)."""
    part, seen = middle(source), counted(source, chosen)
    shown = _shown(seen.t_s, part)

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(seen.t_s[shown], seen.filtered_g[shown], color=COLOURS[0], lw=1.2, label="five-point mean")
        _bands(axes[0], source, part, seen.bands)
        _steps(axes[0], source, part, seen.steps)
        title = f"Thresholds and steps: {source.name}\n{seen.told}"
        label(axes[0], title=title, x=TIME, y=f"{seen.axes} / g", legend=True)

    return picture(path, draw)


def false_peaks(path: Path, source: Source, chosen: Choice = PUBLISHED) -> Path:
    """Figure 6: peaks that are not counted, for their height, valley or spacing, beside those that are."""
    part, seen = middle(source), counted(source, chosen)
    shown = _shown(seen.t_s, part)
    t_s, values = seen.t_s[shown], seen.filtered_g[shown]
    top = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])) + 1
    at_s = np.array([step.at_s for step in seen.steps]) - source.signal.start / GRID_HZ
    is_step = np.array([bool(len(at_s)) and np.abs(at_s - t).min() < 0.5 / GRID_HZ for t in t_s[top]], dtype=bool)

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(t_s, values, color=COLOURS[0], lw=1.2)
        axes[0].plot(t_s[top[is_step]], values[top[is_step]], "o", color=COLOURS[2], label="peak, counted")
        axes[0].plot(t_s[top[~is_step]], values[top[~is_step]], "x", color=COLOURS[1], label="peak, not counted")
        title = f"False peaks: {source.name}\n{seen.told}"
        label(axes[0], title=title, x=TIME, y=f"five-point mean of {seen.axes} / g", legend=True)

    return picture(path, draw)


def rest(path: Path, source: Source, chosen: Choice = PUBLISHED) -> Path:
    """Figure 7: nobody moves; so little between peak and valley is rest, one raw unit in the paper."""
    part, seen = middle(source), counted(source, chosen)
    half_g = seen.rest_g / 2
    shown = _shown(seen.t_s, part)
    middle_g = float(np.median(seen.filtered_g[shown]))

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(seen.t_s[shown], seen.filtered_g[shown], color=COLOURS[0], lw=1, label="five-point mean")
        text = f"rest: {seen.rest_g:.3f} g"
        axes[0].axhspan(middle_g - half_g, middle_g + half_g, color=COLOURS[3], alpha=0.3, label=text)
        reach_g = max(0.15, 1.2 * half_g)
        axes[0].set_ylim(middle_g - reach_g, middle_g + reach_g)
        title = f"At rest: {source.name}\n{seen.told}"
        label(axes[0], title=title, x=TIME, y=f"{seen.axes} / g", legend=True)

    return picture(path, draw)


def _shown(t_s: Floats, part: slice) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (t_s >= part.start / GRID_HZ) & (t_s <= (part.stop - 1) / GRID_HZ)
    return inside


def _bands(axes: Axes, source: Source, part: slice, bands: Sequence[Band]) -> None:
    start_s, first_s, last_s = source.signal.start / GRID_HZ, part.start / GRID_HZ, part.stop / GRID_HZ
    inside = [band for band in bands if band.to_s - start_s > first_s and band.from_s - start_s < last_s]
    for name, colour in (("upper", COLOURS[1]), ("lower", COLOURS[2])):
        t_s = [at - start_s for band in inside for at in (band.from_s, band.to_s)]
        level_g = [getattr(band, name) for band in inside for _ in range(2)]
        text = "upper threshold (9)" if name == "upper" else "lower threshold (10)"
        axes.plot(np.clip(t_s, first_s, last_s), level_g, color=colour, lw=1.4, label=text)


def _steps(axes: Axes, source: Source, part: slice, steps: Sequence[Step]) -> None:
    start_s = source.signal.start / GRID_HZ
    inside = [step for step in steps if part.start / GRID_HZ <= step.at_s - start_s <= part.stop / GRID_HZ]
    at_s, peaks_g = [step.at_s - start_s for step in inside], [step.peak or 0.0 for step in inside]
    axes.plot(at_s, peaks_g, "o", color=COLOURS[4], label=f"step ({len(inside)})")
