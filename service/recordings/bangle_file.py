"""Bangle.js logs: milliseconds, and three counts of 1/8192 g, as the watch's accelerometer recorder writes them.

    Time (ms),X,Y,Z
    80,900,-1300,-8100
    160,760,-1150,-7990

BangleApps `accellog` writes them; newer ones add `Total`, and may be set to write g instead of counts. The data of
dariosalvi78/banglejs-algos-tester and of gfwilliams/step-count (both at 12.5 Hz, worn at the wrist) have this form,
and their file names begin with the number of steps: `100_5.csv` holds 100. In the folder `controlled` they were
counted by the wearer, elsewhere by another device. The watch sends less while it is still: such holes stay in time.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from service.recordings.recording import Floats, Recording, median_rate_hz, merge_repeated_stamps
from service.recordings.text_table import head_lines, header_cells, numbers, read_lines

LSB_PER_G: Final = 8192.0
COUNTS_FROM: Final = 64.0
"""A median norm above it is in counts: a watch measures ±8 g at most, and gravity is 8192 counts."""
MAX_CADENCE_HZ: Final = 5.0
"""No one steps faster: a larger number at the head of a file name, as in `20220104.csv`, is a date or the like."""

_HEADER: Final = ["time (ms)", "x", "y", "z"]
_STEPS: Final = re.compile(r"(?P<steps>\d+)(?:_.*)?")


def recognises(head: bytes) -> bool:
    """Tell whether `head` begins with the recorder's header."""
    lines = head_lines(head)
    return bool(lines) and header_cells(lines[0])[:4] == _HEADER


def read_bangle(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read a log; its scale and its times are its own, so the arguments say nothing. RecordingError names the line."""
    lines = read_lines(path)
    header = next(at for at, line in enumerate(lines) if line.strip())
    names = header_cells(lines[header])
    table = numbers(path, lines[header + 1 :], first=header + 2, wanted=range(4), names=names)
    t_s, (acc,) = merge_repeated_stamps(table[:, 0] / 1000, table[:, 1:])
    assert acc is not None  # noqa: S101  # it was given
    true_steps = _steps(path, float(t_s[-1] - t_s[0]))
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=_in_g(acc),
        rate_hz=median_rate_hz(t_s),
        true_steps=true_steps,
        placement="wrist",
        quality=None if true_steps is None else "A" if path.parent.name == "controlled" else "B",
    )


def _in_g(acc: Floats) -> Floats:
    norm = float(np.median(np.sqrt((acc**2).sum(axis=1))))
    return acc / LSB_PER_G if norm > COUNTS_FROM else acc


def _steps(path: Path, duration_s: float) -> int | None:
    """Return the number of steps at the head of the file's name, None where there is none that can be one."""
    named = _STEPS.fullmatch(path.stem)
    if named is None:
        return None
    steps = int(named["steps"])
    return steps if steps <= MAX_CADENCE_HZ * duration_s else None
