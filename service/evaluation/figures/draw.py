"""Every figure into a folder, one PNG a name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from service.evaluation.choices import Found
from service.evaluation.figures import agreement, bracelet, phones
from service.evaluation.figures.sources import Sources, sources
from service.evaluation.papers.report import Bar
from service.evaluation.rows import Choice, Row

Draw = Callable[[Path, Sequence[Row]], Path]

SIGNALS: Final[dict[str, Callable[[Path, Sources, Choice], Path]]] = {
    "raw_axes": lambda path, of, _: bracelet.raw_axes(path, of.walk),
    "magnitude": lambda path, of, _: bracelet.magnitude(path, of.walk),
    "filtered": lambda path, of, chosen: bracelet.filtered(path, of.walk, chosen),
    "thresholds_and_steps": lambda path, of, chosen: bracelet.thresholds(path, of.walk, chosen),
    "false_peaks": lambda path, of, chosen: bracelet.false_peaks(path, of.walk, chosen),
    "rest": lambda path, of, chosen: bracelet.rest(path, of.rest, chosen),
    "step_maxima": lambda path, of, _: phones.maxima(path, of),
    "gait_cycle": lambda path, of, _: phones.gait_cycle(path, of.pocket),
    "update_and_reject": lambda path, of, _: phones.regions(path, of.sensed),
}
"""Drawn from signals: the first walk, run and rest among the recordings, or walkers; step maxima from all of them."""

RESULTS: Final[dict[str, Draw]] = {
    "accuracy": agreement.accuracy,
    "timing": agreement.timing,
    "bland_altman": agreement.bland_altman,
    "error_by_cadence": agreement.error_by_cadence,
}
"""Drawn from rows: all but `timing` need recordings that hold steps."""


def write(
    folder: Path, rows: Sequence[Row], found: Sequence[Found], *, lsb_per_g: float, bars: Sequence[Bar] = ()
) -> list[Path]:
    """Draw every figure into `folder` (see `canvas.checked_folder`) and return the files.

    With a paper's `bars`, accuracies stand beside the published ones.
    """
    of, chosen = sources(found, lsb_per_g), bracelet.evaluated(rows)
    written = [draw(folder / f"{name}.png", of, chosen) for name, draw in SIGNALS.items()]
    counted = [row for row in rows if row.error is None]
    possible: dict[str, Draw] = dict(RESULTS) if agreement.walks(counted) else {"timing": agreement.timing}
    if bars and "accuracy" in possible:
        possible["accuracy"] = lambda path, _: agreement.against_published(path, bars)
    return written + [draw(folder / f"{name}.png", counted) for name, draw in possible.items() if counted]
