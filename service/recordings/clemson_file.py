"""Clemson's pedometer data: nine columns of g at 15 Hz, the steps in `steps.txt` beside them.

    P001/Regular/P001_Regular.txt      P001/Regular/steps.txt
    0.914 0.102 -0.338 …               102 right
    0.921 0.095 -0.340 …               110 left

Mattfeld, Jesch and Hoover (2017, doi:10.1109/BIBM.2017.8217769): 30 people, each in a regular, a semi-regular and an
irregular gait; Shimmer3 sensors at wrist, hip and ankle (x, y, z each), synchronised and laid on exactly 15 Hz by the
authors. The wrist is read. `steps.txt` gives the line of the sample at which a step ends, from 0 (our reading: the
authors say «line index», and published loaders differ; from 1 would be 67 ms earlier), and the foot. Its `leftshift`
and `rightshift`, a foot that is shifted and does not step, are no steps here, as in later comparisons on this data:
56,668 of 60,801 lines are left (the authors' 60,853 has them in). Two shifts lie behind their recording's end.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording
from service.recordings.text_table import head_lines, is_number, numbers, read_lines

RATE_HZ: Final = 15.0
STEPS_FILE: Final = "steps.txt"

_COLUMNS: Final = tuple(f"{place}_{axis}" for place in ("wrist", "hip", "ankle") for axis in "xyz")
_STEPS: Final = frozenset({"left", "right"})
_NO_STEPS: Final = frozenset({"leftshift", "rightshift"})
_NAME: Final = re.compile(r"(?P<subject>P\d+)_(?P<gait>Regular|Semi-?Regular|Irregular)", re.IGNORECASE)


def recognises(head: bytes) -> bool:
    """Tell whether the first lines of `head` are nine numbers each."""
    rows = [line.split() for line in head_lines(head)[:2]]
    return bool(rows) and all(len(row) == len(_COLUMNS) and all(map(is_number, row)) for row in rows)


def read_clemson(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read one walk; it holds g, so `lsb_per_g` says nothing, and `rate_hz` is 15 unless declared.

    RecordingError where no `steps.txt` lies beside it, for nine columns alone could be anything.
    """
    rate_hz = rate_hz or RATE_HZ
    acc_g = numbers(path, read_lines(path), first=1, wanted=range(3), names=_COLUMNS, separator=None)
    step_t_s = _steps(path, len(acc_g)) / rate_hz
    named = _NAME.fullmatch(path.stem)
    return Recording(
        path=path,
        t_s=np.arange(len(acc_g)) / rate_hz,
        acc_g=acc_g,
        rate_hz=rate_hz,
        step_t_s=step_t_s,
        true_steps=len(step_t_s),
        placement="wrist",
        activity="walk_" + named["gait"].lower().replace("-", "") if named else None,
        subject=named["subject"].upper() if named else None,
        quality="A",
    )


def _steps(path: Path, samples: int) -> Floats:
    """Return the sample of each step, from the file beside `path`, in rising order."""
    beside = path.parent / STEPS_FILE
    if not beside.is_file():
        why = f"nine columns of Clemson's data, and no {STEPS_FILE} beside them; other data needs its columns named"
        raise RecordingError(str(path), why)
    found: list[int] = []
    for number, line in enumerate(read_lines(beside), start=1):
        cells = line.lower().split()
        if not cells:
            continue
        if len(cells) != 2 or not cells[0].isdecimal() or cells[1] not in _STEPS | _NO_STEPS:
            raise RecordingError(str(beside), f"line {number}: {line.strip()[:40]!r}; '102 right' is wanted")
        if cells[1] in _STEPS:
            if int(cells[0]) >= samples:
                raise RecordingError(str(beside), f"line {number}: sample {cells[0]} of {samples}; a file is cut short")
            found.append(int(cells[0]))
    return np.array(sorted(found), dtype=np.float64)
