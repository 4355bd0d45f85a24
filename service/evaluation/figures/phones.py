"""Figures of Chen 2015 (8), Jayalath 2013 (1) and Khedr 2017 (9): step maxima, the gait cycle, times of peaks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from service.counters.gyro_zero_crossing import PAPER as GYRO
from service.evaluation.figures.canvas import COLOURS, label, picture
from service.evaluation.figures.sources import Floats, Source, Sources, middle, times_s
from service.samples import GRID_HZ

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WALK_G: Final = 1.2
RUN_G: Final = 2.0
"""Between them lie 99 % of a walk's step maxima, above the second 99 % of a run's (2015, section 1.3.2)."""
CYCLE_S: Final = 6.0
REJECT: Final = 0.5
UPDATE: Final = 0.3
"""Of Δt₁ (5) and of Δt₂ (7) in the document on Khedr 2017."""


def step_maxima_g(source: Source) -> Floats:
    """Return the largest norm of each of as many equal parts as there are true steps, in g."""
    parts = np.array_split(source.norm_g, max(source.true_steps, 1))
    return np.array([part.max() for part in parts if len(part)])


def maxima(path: Path, of: Sources) -> Path:
    """Figure 8 of 2015: how large a step's maximum is, walking and running."""

    def draw(axes: list[Axes]) -> None:
        for source, name, colour in ((of.walk, "walk", COLOURS[0]), (of.run, "run", COLOURS[1])):
            largest = step_maxima_g(source)
            inside = largest > RUN_G if name == "run" else (largest >= WALK_G) & (largest <= RUN_G)
            where = "above 2 g" if name == "run" else "in 1.2…2 g"
            text = f"{name}: {100 * inside.mean():.0f} % {where} ({source.name})"
            bins = np.arange(0.8, max(5.0, largest.max() + 0.2), 0.1).tolist()
            axes[0].hist(
                largest,
                bins=bins,
                weights=np.full(len(largest), 100 / len(largest)),
                color=colour,
                alpha=0.6,
                label=text,
            )
        for level_g in (WALK_G, RUN_G):
            axes[0].axvline(level_g, color="black", ls="--", lw=1)
        label(axes[0], title="Step maxima", x="largest norm of a step / g", y="steps / %", legend=True)

    return picture(path, draw)


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


def regions(path: Path, source: Source) -> Path:
    """Figure 9 of 2017: where a new extremum is rejected, and where it replaces the last one."""
    from scipy import signal  # noqa: PLC0415  # heavy

    part = middle(source, CYCLE_S / 2)
    norm_g = signal.sosfiltfilt(signal.butter(2, 3.0, fs=GRID_HZ, output="sos"), source.norm_g)[part]
    spread = 0.5 * float(norm_g.std())
    peaks, valleys = (signal.find_peaks(sign * norm_g, prominence=spread)[0] for sign in (1, -1))
    extrema = np.sort(np.concatenate([peaks, valleys]))
    t_s = times_s(part)

    def draw(axes: list[Axes]) -> None:
        axes[0].plot(t_s, norm_g, color=COLOURS[0], lw=1.5, label="norm, low-pass 3 Hz")
        for number, (before, last, now) in enumerate(zip(extrema, extrema[1:], extrema[2:], strict=False)):
            waited_s, took_s = (t_s[last] - t_s[before], t_s[now] - t_s[last])
            for begin_s, share_s, low, colour, text in (
                (t_s[last], REJECT * waited_s, 0.0, COLOURS[1], "rejected: 0.5 Δt₁ (5)"),
                (t_s[now], UPDATE * took_s, 0.5, COLOURS[6], "may be replaced: 0.3 Δt₂ (7)"),
            ):
                shown = text if not number else None
                axes[0].axvspan(begin_s, begin_s + share_s, low, low + 0.5, color=colour, alpha=0.25, lw=0, label=shown)
        axes[0].plot(t_s[extrema], norm_g[extrema], "o", color=COLOURS[4], label="peak or valley")
        title = f"Update and reject regions: {source.name}"
        label(axes[0], title=title, x="time / s", y="acceleration / g", legend=True)

    return picture(path, draw)
