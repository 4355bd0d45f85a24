"""Dates and times of day as seconds after the first of them.

A stamp without a zone is taken as it is: only differences count, so where a recording was made does not matter. A zone
written with each stamp is honoured, so that summer time may end within a recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats


def is_stamp(cell: str) -> bool:
    """Tell whether `cell` is a date with a time of day."""
    try:
        return _parsed(cell).time() is not None and ":" in cell
    except ValueError:
        return False


def seconds_after_first(
    path: Path, lines: Sequence[str], *, first: int, column: int = 0, separator: str | None = ","
) -> Floats:
    """Return the seconds of each line that is not blank, from the ISO 8601 stamps in `column`; shape (rows,).

    `first` is the number of the first of `lines` in the file; RecordingError names the line of a stamp that is none.
    """
    stamps: list[datetime] = []
    for number, line in enumerate(lines, start=first):
        if not line.strip():
            continue
        cells = line.split(separator)
        cell = cells[column] if column < len(cells) else ""
        try:
            stamps.append(_parsed(cell))
        except ValueError as error:
            why = f"line {number}: {cell.strip()[:40]!r} is no date and time; 2022-12-09 10:30:00.010 is wanted"
            raise RecordingError(str(path), why) from error
    if len({stamp.tzinfo is None for stamp in stamps}) > 1:
        raise RecordingError(str(path), "some stamps have a time zone and some have none; write all alike")
    return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps], dtype=np.float64)


def _parsed(cell: str) -> datetime:
    """Parse a stamp; actipy's `… +0100 [Europe/London]` names the zone twice, and the offset is enough."""
    return datetime.fromisoformat(cell.partition("[")[0].strip().strip('"'))
