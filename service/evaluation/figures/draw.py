"""Every figure into a folder, one PNG a name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from service.evaluation.choices import Found
from service.evaluation.figures import agreement, bracelet, phones
from service.evaluation.figures.sources import Sources, sources
from service.evaluation.rows import Row

SIGNALS: Final[dict[str, Callable[[Path, Sources], Path]]] = {
    "raw_axes": lambda path, of: bracelet.raw_axes(path, of.walk),
    "magnitude": lambda path, of: bracelet.magnitude(path, of.walk),
    "filtered": lambda path, of: bracelet.filtered(path, of.walk),
    "thresholds_and_steps": lambda path, of: bracelet.thresholds(path, of.walk),
    "false_peaks": lambda path, of: bracelet.false_peaks(path, of.walk),
    "rest": lambda path, of: bracelet.rest(path, of.rest),
    "step_maxima": phones.maxima,
    "gait_cycle": lambda path, of: phones.gait_cycle(path, of.pocket),
    "update_and_reject": lambda path, of: phones.regions(path, of.walk),
}
"""Drawn from signals: the first walk, run and rest among the recordings, or walkers."""

RESULTS: Final[dict[str, Callable[[Path, Sequence[Row]], Path]]] = {
    "accuracy": agreement.accuracy,
    "timing": agreement.timing,
    "bland_altman": agreement.bland_altman,
    "error_by_cadence": agreement.error_by_cadence,
}
"""Drawn from rows: all but `timing` need recordings that hold steps."""


def write(folder: Path, rows: Sequence[Row], found: Sequence[Found], *, lsb_per_g: float) -> list[Path]:
    """Draw every figure into `folder` (see `canvas.checked_folder`) and return the files."""
    of = sources(found, lsb_per_g)
    written = [draw(folder / f"{name}.png", of) for name, draw in SIGNALS.items()]
    counted = [row for row in rows if row.error is None]
    possible = dict(RESULTS) if agreement.walks(counted) else {"timing": agreement.timing}
    return written + [draw(folder / f"{name}.png", counted) for name, draw in possible.items() if counted]
