"""OxWalk's CSV: stamps, acceleration in g, and a 1 at every step; without the last column it is stepcount's CSV.

    timestamp,x,y,z,annotation
    2022-01-01 10:30:00.000,-0.51,0.07,0.85,0
    2022-01-01 10:30:00.010,-0.50,0.08,0.86,1

OxWalk (Small et al. 2022, doi:10.5287/bodleian:KJe7VgMNV): Axivity AX3 at wrist and hip, 100 and 25 Hz, 39 people in
daily life, each step marked at about heel strike from video. Its files are `P01_wrist100.csv` and the like, from which
subject and placement come. `time,x,y,z` with such stamps is what stepcount and actipy of the same group take.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording, median_rate_hz, merge_repeated_stamps, spread_stamps
from service.recordings.stamps import is_stamp, seconds_after_first
from service.recordings.text_table import head_lines, header_cells, numbers, read_lines

ACTIVITY: Final = "free_living"
"""What all of OxWalk is: an unscripted hour of daily life."""

_STAMPS: Final = ("timestamp", "time")
_AXES: Final = ["x", "y", "z"]
_STEPS: Final = "annotation"
_NAME: Final = re.compile(r"(?P<subject>P\d+)_(?P<placement>wrist|hip)(?P<rate_hz>\d+)", re.IGNORECASE)


def recognises(head: bytes) -> bool:
    """Tell whether `head` begins with such a header and a row whose first cell is a date."""
    lines = head_lines(head)
    if len(lines) <= 1:
        return False
    names = header_cells(lines[0])
    return names[0] in _STAMPS and names[1:4] == _AXES and is_stamp(lines[1].split(",")[0])


def read_oxwalk(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read one; it holds g and stamps, so `lsb_per_g` and `rate_hz` say nothing. RecordingError names the line."""
    lines = read_lines(path)
    header = next(at for at, line in enumerate(lines) if line.strip())
    names, rows, first = header_cells(lines[header]), lines[header + 1 :], header + 2
    marked = _STEPS in names
    wanted = [1, 2, 3, *([names.index(_STEPS)] if marked else [])]
    table = numbers(path, rows, first=first, wanted=wanted, names=names)
    stamps_s = spread_stamps(seconds_after_first(path, rows, first=first), table[:, :3])
    step_t_s = _step_times(path, stamps_s, table[:, 3]) if marked else None
    t_s, (acc_g,) = merge_repeated_stamps(stamps_s, table[:, :3])
    assert acc_g is not None  # noqa: S101  # it was given
    named = _NAME.fullmatch(path.stem)
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=float(named["rate_hz"]) if named and float(named["rate_hz"]) else median_rate_hz(t_s),
        step_t_s=step_t_s,
        true_steps=None if step_t_s is None else len(step_t_s),
        placement=named["placement"].lower() if named else None,
        activity=ACTIVITY if named else None,
        subject=named["subject"].upper() if named else None,
        quality="A" if marked else None,
    )


def _step_times(path: Path, stamps_s: Floats, marks: Floats) -> Floats:
    """Return the times of the samples marked 1."""
    wrong = ~np.isin(marks, (0.0, 1.0))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise RecordingError(str(path), f"{_STEPS} of sample {row} is {marks[row]:g}; 1 at a step, else 0, is wanted")
    return np.compress(marks == 1.0, stamps_s)
