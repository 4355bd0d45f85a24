"""Any table of text whose columns the caller names: what no other format fits.

    t;ax;ay;az                 columns time=t,x=ax,y=ay,z=az
    0;0.12;-0.31;9.79          units m/s2
    20;0.10;-0.28;9.81         time unit ms

A column is its name in the header (in any case) or its number from 1; where all are numbers, the file may have no
header. Commas, semicolons (then with decimal commas or points), tabs and blanks part columns. Time may be dates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np

from service.errors import ParameterError, RecordingError
from service.recordings.recording import (
    AXES,
    STANDARD_GRAVITY,
    Floats,
    Recording,
    median_rate_hz,
    merge_repeated_stamps,
)
from service.recordings.stamps import is_stamp, seconds_after_first
from service.recordings.text_table import head_lines, header_cells, is_number, numbers, read_lines


class Unit(StrEnum):
    """What acceleration is written in."""

    M_S2 = "m/s2"
    G = "g"
    MG = "mg"


class TimeUnit(StrEnum):
    """What time is written in, where it is a number."""

    S = "s"
    MS = "ms"
    US = "us"
    NS = "ns"


PER_G: Final = {Unit.M_S2: STANDARD_GRAVITY, Unit.G: 1.0, Unit.MG: 1000.0}
PER_S: Final = {TimeUnit.S: 1.0, TimeUnit.MS: 1e3, TimeUnit.US: 1e6, TimeUnit.NS: 1e9}
SUFFIXES: Final = (".csv", ".txt", ".tsv", ".dat")
_SEPARATORS: Final = (";", "\t", ",")
"""In the order they are looked for: a comma may be a decimal one beside the others. Without any of them, blanks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Which columns hold what, by name or by number from 1; `time` None where the rate alone says it."""

    x: str
    y: str
    z: str
    time: str | None = None
    unit: Unit = Unit.G
    time_unit: TimeUnit = TimeUnit.S

    def named(self) -> list[str]:
        """Return the columns of x, y, z and, where there is one, of time."""
        return [self.x, self.y, self.z, *([] if self.time is None else [self.time])]


def column_mapping(text: str, unit: str = "g", time_unit: str = "s") -> ColumnMapping:
    """Return what `--columns time=t,x=ax,y=ay,z=az --units UNIT --time-unit UNIT` ask for.

    ParameterError where a column is missing, unknown or named twice, or a unit is unknown.
    """
    parts = [part.partition("=") for part in text.split(",")]
    found = {name.strip().lower(): column.strip() for name, _, column in parts}
    wrong = [name for name, column in found.items() if name not in {*AXES, "time"} or not column]
    if wrong or len(found) < len(parts) or not found.keys() >= set(AXES):
        raise ParameterError("columns", text, "x, y, z and time once each are wanted, as in time=t,x=ax,y=ay,z=az")
    if len(set(found.values())) < len(found):
        raise ParameterError("columns", text, "two of them are the same column")
    try:
        return ColumnMapping(**found, unit=Unit(unit), time_unit=TimeUnit(time_unit))
    except ValueError as error:
        known = f"units {', '.join(Unit)}; time units {', '.join(TimeUnit)}"
        raise ParameterError("units", f"{unit}, {time_unit}", f"known are {known}") from error


def has_columns(head: bytes, mapping: ColumnMapping) -> bool:
    """Tell whether the first lines of `head` have the columns asked for, and numbers in a row of x, y and z."""
    lines = head_lines(head)
    if not lines:
        return False
    separator = _separator(lines[0])
    places = _places(header_cells(lines[0], separator), mapping)
    row = lines[min(len(lines) - 1, 1)].replace(*_decimal(separator)).split(separator)
    return None not in places and all(at is not None and at < len(row) and is_number(row[at]) for at in places[:3])


def read_mapped(path: Path, mapping: ColumnMapping, *, rate_hz: float | None) -> Recording:
    """Read the columns; `rate_hz` makes the time where no column holds it. RecordingError names line and column."""
    lines = read_lines(path)
    top = next((at for at, line in enumerate(lines) if line.strip()), None)
    if top is None:
        raise RecordingError(str(path), "the file is empty")
    separator = _separator(lines[top])
    names = header_cells(lines[top], separator)
    places = _places(names, mapping)
    absent = [name for name, at in zip(mapping.named(), places, strict=True) if at is None]
    if absent:
        raise RecordingError(str(path), f"line {top + 1}: no column {', '.join(absent)}; there are {', '.join(names)}")
    where = [at for at in places if at is not None]
    top += not is_number(lines[top].replace(*_decimal(separator)).split(separator)[where[0]])
    rows, first = [line.replace(*_decimal(separator)) for line in lines[top:]], top + 1
    acc = numbers(path, rows, first=first, wanted=where[:3], names=names, separator=separator)
    if mapping.time is None:
        t_s = _even(path, len(acc), rate_hz)
    else:
        t_s = _seconds(path, rows, first, names, where[3], separator, mapping.time_unit)
    t_s, (acc_g,) = merge_repeated_stamps(t_s, acc / PER_G[mapping.unit])
    assert acc_g is not None  # noqa: S101  # it was given
    return Recording(path=path, t_s=t_s, acc_g=acc_g, rate_hz=rate_hz or median_rate_hz(t_s))


def _even(path: Path, n: int, rate_hz: float | None) -> Floats:
    if rate_hz is None:
        raise RecordingError(str(path), "no column of time is named and no rate declared; one of them is needed")
    return np.arange(n) / rate_hz


def _seconds(
    path: Path,
    rows: Sequence[str],
    first: int,
    names: Sequence[str],
    at: int,
    separator: str | None,
    unit: TimeUnit,
) -> Floats:
    """Return the times of `rows` in seconds: dates after the first of them, numbers as they are."""
    row = next(line for line in rows if line.strip()).split(separator)
    if at < len(row) and is_stamp(row[at]):
        return seconds_after_first(path, rows, first=first, column=at, separator=separator)
    times = numbers(path, rows, first=first, wanted=[at], names=names, separator=separator)[:, 0]
    after: Floats = (times - times[0]) / PER_S[unit]
    return after


def _separator(line: str) -> str | None:
    return next((mark for mark in _SEPARATORS if mark in line), None)


def _decimal(separator: str | None) -> tuple[str, str]:
    return (",", ".") if separator == ";" else ("", "")


def _places(names: Sequence[str], mapping: ColumnMapping) -> list[int | None]:
    """Return where the columns stand, None for one that is not there."""
    return [_place(names, column.strip().lower()) for column in mapping.named()]


def _place(names: Sequence[str], column: str) -> int | None:
    # Digits are always a place: without a header, the first row's values would be taken for names.
    if column.isdecimal():
        return int(column) - 1 if 1 <= int(column) <= len(names) else None
    return names.index(column) if column in names else None
