"""Text with columns of numbers: its lines, its numbers, and an error that names the line and the column.

The formats that are text differ in header, separator and units; what is read from them, and how a bad cell is told,
is the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats


def read_lines(path: Path) -> list[str]:
    """Return the lines of a UTF-8 text, a byte order mark left out; RecordingError where it is no UTF-8."""
    try:
        return path.read_text(encoding="utf-8-sig").split("\n")
    except UnicodeDecodeError as error:
        raise RecordingError(str(path), f"byte {error.start} is no UTF-8; save the file as UTF-8") from error


def head_lines(head: bytes) -> list[str]:
    """Return the whole lines in `head`, the first bytes of a file, that are not blank; none where it is no text."""
    if b"\0" in head:
        return []
    lines = head.decode("utf-8-sig", "replace").split("\n")
    return [line.strip() for line in lines if line.strip()]


def header_cells(line: str, separator: str | None = ",") -> list[str]:
    """Return the names in a header, in lower case, without quotes and blanks around them."""
    return [cell.strip().strip('"').strip().lower() for cell in line.split(separator)]


def numbers(
    path: Path,
    lines: Sequence[str],
    *,
    first: int,
    wanted: Sequence[int],
    names: Sequence[str],
    separator: str | None = ",",
) -> Floats:
    """Return the columns at `wanted`, one row a line that is not blank; shape (rows, len(wanted)).

    `first` is the number of the first of `lines` in the file and `names` are the columns', both for the error.
    `separator` None is any white space. RecordingError where a cell is no finite number, or there are no rows.
    """
    rows = [line for line in lines if line.strip()]
    if not rows:
        raise RecordingError(str(path), "a header and no samples")
    try:
        table = np.loadtxt(rows, delimiter=separator, comments=None, usecols=wanted, ndmin=2, dtype=np.float64)
    except ValueError:
        table = None
    if table is None or not np.isfinite(table).all():
        raise RecordingError(str(path), _bad_cell(lines, first, wanted, names, separator))
    return table


def is_number(cell: str) -> bool:
    """Tell whether `cell` is a finite number."""
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _bad_cell(
    lines: Sequence[str], first: int, wanted: Sequence[int], names: Sequence[str], separator: str | None
) -> str:
    for number, line in enumerate(lines, start=first):
        cells = line.split(separator)
        if not line.strip():
            continue
        for at in wanted:
            if at >= len(cells):
                return f"line {number}: {len(cells)} columns, the header has {len(names)}"
            if not is_number(cells[at]):
                return f"line {number}, column {names[at]}: {cells[at].strip()!r} is no finite number; remove the line"
    return "a number cannot be read; write plain decimals"
