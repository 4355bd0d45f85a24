"""Figures of Chen 2015 (8), Jayalath 2013 (1) and Khedr 2017 (9): step maxima, the gait cycle, times of peaks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from service.counters.gyro_zero_crossing import PAPER as GYRO
from service.evaluation.figures.canvas import COLOURS, label, picture
from service.evaluation.figures.events import Event, Kind, busiest, events
from service.evaluation.figures.sources import Pool, Source, Sources, middle, times_s
from service.samples import GRID_HZ

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WALK_G: Final = 1.2
RUN_G: Final = 2.0
"""Between them lie 99 % of a walk's step maxima, above the second 99 % of a run's (2015, section 1.3.2)."""
CYCLE_S: Final = 6.0
BIN_G: Final = 0.1
LARGEST_G: Final = 6.0
"""The last bin holds what is larger too."""

_MARKS: Final = {
    Kind.TAKEN: ("o", COLOURS[4], "taken"),
    Kind.REPLACED: ("D", COLOURS[6], "taken, then replaced by a more extreme one (7)(8)"),
    Kind.REJECTED: ("x", COLOURS[1], "rejected, too soon (5)(6)"),
    Kind.PASSED_OVER: ("+", COLOURS[5], "passed over: the last is final, or more extreme"),
}


def maxima(path: Path, of: Sources) -> Path:
    """Figure 8 of 2015: how large a step's maximum is, walking and running."""

    def draw(axes: list[Axes]) -> None:
        bins = np.arange(0.8, LARGEST_G + BIN_G / 2, BIN_G).tolist()
        for pool, name, colour in ((of.walks, "walking", COLOURS[0]), (of.runs, "running", COLOURS[1])):
            shown, weights = (
                np.clip(pool.maxima_g, bins[0], bins[-1]),
                np.full(len(pool.maxima_g), 100 / len(pool.maxima_g)),
            )
            axes[0].hist(shown, bins=bins, weights=weights, color=colour, alpha=0.6, label=_told(pool, name))
        for level_g in (WALK_G, RUN_G):
            axes[0].axvline(level_g, color="black", ls="--", lw=1)
        label(axes[0], title="Step maxima", x="largest norm of a step / g", y="steps / %", legend=True)

    return picture(path, draw)


def _told(pool: Pool, name: str) -> str:
    largest_g = pool.maxima_g
    inside = largest_g > RUN_G if name == "running" else (largest_g >= WALK_G) & (largest_g <= RUN_G)
    where = "above 2 g" if name == "running" else "in 1.2…2 g"
    whose = "synthetic walkers" if pool.synthetic else "recordings"
    return f"{name}: {100 * inside.mean():.0f} % {where} ({len(largest_g)} steps of {pool.pieces} {whose})"


def gait_cycle(path: Path, source: Source) -> Path:
    """Figure 1 of 2013: the thigh's angular rate, low-passed without delay, and its integral, the thigh's angle."""
    from scipy import signal  # noqa: PLC0415  # heavy

    part = middle(source, CYCLE_S)
    assert source.signal.gyro_rad_s is not None  # noqa: S101  # walkers have it
    rate = np.asarray(source.signal.gyro_rad_s[0])
    sections = signal.butter(6, GYRO.cutoff_hz, fs=GRID_HZ, output="sos")
    smooth = signal.sosfiltfilt(sections, rate - rate.mean())
    angle = signal.detrend(np.cumsum(smooth) / GRID_HZ)
    falls = np.flatnonzero((smooth[:-1] >= 0) & (smooth[1:] < 0))
    strikes = falls[(falls >= part.start) & (falls < part.stop)]

    def draw(axes: list[Axes]) -> None:
        t_s = times_s(part)
        axes[0].plot(t_s, rate[part], color=COLOURS[0], lw=0.6, alpha=0.5, label="x axis")
        axes[0].plot(t_s, smooth[part], color=COLOURS[0], lw=1.5, label=f"low-pass {GYRO.cutoff_hz:g} Hz")
        axes[1].plot(t_s, np.degrees(angle[part]), color=COLOURS[1], lw=1.5, label="thigh, integrated")
        for each in axes:
            for strike in strikes:
                each.axvline(strike / GRID_HZ, color="black", ls="--", lw=0.8)
            each.axhline(0, color="black", lw=0.6)
        title = f"Gait cycle, one from dashed line to dashed line: {source.name}"
        label(axes[0], title=title, y="angular rate / rad/s", legend=True)
        label(axes[1], x="time / s", y="angle / °", legend=True)

    return picture(path, draw, panels=2)


def regions(path: Path, sources: Sequence[Source]) -> Path:
    """Figure 9 of 2017: where the fusion counter rejects a new extremum, and where one replaces the last.

    Of all sources, the stretch in which that happens most.
    """
    seen = [(source, events(source)) for source in sources]
    stretches = [busiest(watched, round(CYCLE_S * GRID_HZ)) for _, watched in seen]
    (source, watched), (part, _) = max(zip(seen, stretches, strict=True), key=lambda each: each[1][1])
    inside = [event for event in watched.events if part.start <= event.at < part.stop]

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(times_s(part), watched.norm_g[part], color=COLOURS[0], lw=1.5, label="filtered norm")
        _regions(axes[0], inside, part)
        for kind, (marker, colour, text) in _MARKS.items():
            of = [event for event in inside if event.kind is kind]
            at_s, norm_g = [event.at / GRID_HZ for event in of], [event.norm_g for event in of]
            axes[0].plot(at_s, norm_g, marker, color=colour, ms=6, mew=1.8, label=f"{text} ({len(of)})", ls="none")
        title = f"Update and reject regions, fusion, preset paper: {source.name}"
        label(axes[0], title=title, x="time / s", y="acceleration / g", legend=True, columns=2)

    return picture(path, draw)


def _regions(axes: Axes, inside: Sequence[Event], part: slice) -> None:
    """Shade, after each event that stood, where another is rejected (below) and where it may be replaced (above)."""
    last_s = (part.stop - 1) / GRID_HZ
    drawn: set[str] = set()
    for event in inside:
        for span, low, colour, text in (
            (event.reject, 0.0, COLOURS[1], "a new one is rejected: th_s = 0.5 Δt₁ (5)"),
            (event.update, 0.5, COLOURS[6], "may be replaced: th_e = 0.3 Δt₂ (7)"),
        ):
            if span is not None:
                first_s, to_s = (min(at / GRID_HZ, last_s) for at in span)
                shown = None if text in drawn else text
                drawn.add(text)
                axes.axvspan(first_s, to_s, low, low + 0.5, color=colour, alpha=0.2, lw=0, label=shown)
