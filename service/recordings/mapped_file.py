"""Any table of text whose columns the caller names: what no other format fits.

    t;ax;ay;az                 columns time=t,x=ax,y=ay,z=az
    0;0.12;-0.31;9.79          units m/s2
    20;0.10;-0.28;9.81         time unit ms

Beside them may be named gx, gy, gz (gyroscope), mx, my, mz (magnetometer, µT) and steps: a 1 at each step and else 0,
or the number of steps so far, which never falls.

A column is its name in the header (in any case) or its number from 1; where all are numbers, the file may have no
header. Commas, semicolons (then with decimal commas or points), tabs and blanks part columns. Time may be dates.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from service.errors import ParameterError, RecordingError
from service.recordings.recording import (
    AXES,
    STANDARD_GRAVITY,
    Floats,
    Recording,
    median_rate_hz,
    merge_repeated_stamps,
    spread_stamps,
)
from service.recordings.stamps import is_stamp, seconds_after_first
from service.recordings.text_table import head_lines, header_cells, is_number, numbers, read_lines

Named = TypeVar("Named", bound=StrEnum)


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


class GyroUnit(StrEnum):
    """What rotation is written in."""

    RAD_S = "rad/s"
    DEG_S = "deg/s"


PER_G: Final = {Unit.M_S2: STANDARD_GRAVITY, Unit.G: 1.0, Unit.MG: 1000.0}
PER_S: Final = {TimeUnit.S: 1.0, TimeUnit.MS: 1e3, TimeUnit.US: 1e6, TimeUnit.NS: 1e9}
PER_RAD_S: Final = {GyroUnit.RAD_S: 1.0, GyroUnit.DEG_S: 180 / math.pi}
GYRO: Final = ("gx", "gy", "gz")
MAG: Final = ("mx", "my", "mz")
SUFFIXES: Final = (".csv", ".txt", ".tsv", ".dat")
_SEPARATORS: Final = (";", "\t", ",")
"""In the order they are looked for: a comma may be a decimal one beside the others. Without any of them, blanks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Which columns hold what, by name or by number from 1; `time` None where the rate alone says it.

    Of gyroscope (`gx`…) and magnetometer (`mx`…) all three or none are named.
    """

    x: str
    y: str
    z: str
    time: str | None = None
    gx: str | None = None
    gy: str | None = None
    gz: str | None = None
    mx: str | None = None
    my: str | None = None
    mz: str | None = None
    steps: str | None = None
    unit: Unit = Unit.G
    time_unit: TimeUnit = TimeUnit.S
    gyro_unit: GyroUnit = GyroUnit.RAD_S

    def named(self) -> dict[str, str]:
        """Return the column of each quantity that has one; x, y and z come first."""
        columns = ((name, getattr(self, name)) for name in QUANTITIES)
        return {name: column for name, column in columns if column is not None}


QUANTITIES: Final = (*AXES, *GYRO, *MAG, "steps", "time")


def column_mapping(
    text: str, unit: str | None = None, time_unit: str | None = None, gyro_unit: str | None = None
) -> ColumnMapping:
    """Return what `--columns time=t,x=ax,y=ay,z=az --units UNIT --time-unit UNIT --gyro-units UNIT` ask for.

    ParameterError where a column is missing, unknown or named twice, or a unit is unknown.
    """
    parts = [part.partition("=") for part in text.split(",")]
    found = {name.strip().lower(): column.strip() for name, _, column in parts}
    wrong = [name for name, column in found.items() if name not in QUANTITIES or not column]
    if wrong or len(found) < len(parts) or not found.keys() >= set(AXES):
        why = "x, y, z and time once each are wanted, as in time=t,x=ax,y=ay,z=az; gx, gy, gz, mx, my, mz, steps may be"
        raise ParameterError("columns", text, why)
    for triple in (GYRO, MAG):
        if 0 < len(found.keys() & set(triple)) < len(triple):
            raise ParameterError("columns", text, f"all of {', '.join(triple)} are wanted, or none")
    if len(set(found.values())) < len(found):
        raise ParameterError("columns", text, "two of them are the same column")
    return ColumnMapping(
        **found,
        unit=_known(Unit, "units", unit or Unit.G),
        time_unit=_known(TimeUnit, "time-unit", time_unit or TimeUnit.S),
        gyro_unit=_known(GyroUnit, "gyro-units", gyro_unit or GyroUnit.RAD_S),
    )


def _known(units: type[Named], option: str, text: str) -> Named:
    try:
        return units(text)
    except ValueError as error:
        raise ParameterError(option, text, f"known are {', '.join(units)}") from error


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
    absent = [name for name, at in zip(mapping.named().values(), places, strict=True) if at is None]
    if absent:
        raise RecordingError(str(path), f"line {top + 1}: no column {', '.join(absent)}; there are {', '.join(names)}")
    where = {name: at for name, at in zip(mapping.named(), places, strict=True) if at is not None}
    top += not is_number(lines[top].replace(*_decimal(separator)).split(separator)[where["x"]])
    rows, first = [line.replace(*_decimal(separator)) for line in lines[top:]], top + 1
    measured = [name for name in where if name != "time"]
    table = numbers(
        path, rows, first=first, wanted=[where[name] for name in measured], names=names, separator=separator
    )
    if mapping.time is None:
        t_s = _even(path, len(table), rate_hz)
    else:
        t_s = _seconds(path, rows, first, names, where["time"], separator, mapping.time_unit)
    return _recording(path, t_s, dict(zip(measured, table.T, strict=True)), mapping, rate_hz)


def _recording(
    path: Path, stamps_s: Floats, group: Mapping[str, Floats], mapping: ColumnMapping, rate_hz: float | None
) -> Recording:
    """Return the recording that columns by quantity make, in g, rad/s and µT."""
    acc, gyro, mag = (_triple(group, names) for names in (AXES, GYRO, MAG))
    t_s = spread_stamps(stamps_s, acc, gyro, mag)
    step_t_s = _step_times(path, t_s, group["steps"]) if "steps" in group else None
    t_s, (acc, gyro, mag) = merge_repeated_stamps(t_s, acc, gyro, mag)
    assert acc is not None  # noqa: S101  # its columns were checked
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc / PER_G[mapping.unit],
        rate_hz=rate_hz or median_rate_hz(t_s),
        gyro_rad_s=None if gyro is None else gyro / PER_RAD_S[mapping.gyro_unit],
        mag_ut=mag,
        step_t_s=step_t_s,
        true_steps=None if step_t_s is None else len(step_t_s),
    )


def _triple(group: Mapping[str, Floats], names: Sequence[str]) -> Floats | None:
    return np.column_stack([group[name] for name in names]) if names[0] in group else None


def _step_times(path: Path, t_s: Floats, told: Floats) -> Floats:
    """Return the times of steps, from marks or from the number of steps so far."""
    rises = np.diff(told, prepend=told[0])
    if (rises < 0).any():
        rises = told
        if not np.isin(told, (0.0, 1.0)).all():
            raise RecordingError(str(path), "steps: 1 at a step and else 0 is wanted, or a number that never falls")
    elif (told % 1 != 0).any() or told[-1] - told[0] > len(told):
        raise RecordingError(str(path), "steps: whole numbers are wanted, at most one step a sample")
    return np.repeat(t_s, rises.astype(np.int64))


def _even(path: Path, n: int, rate_hz: float | None) -> Floats:
    if rate_hz is None:
        raise RecordingError(
            str(path), "no column of time is named and no rate declared; one of them is needed (--rate-hz)"
        )
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
    return [_place(names, column.strip().lower()) for column in mapping.named().values()]


def _place(names: Sequence[str], column: str) -> int | None:
    # Digits are always a place: without a header, the first row's values would be taken for names.
    if column.isdecimal():
        return int(column) - 1 if 1 <= int(column) <= len(names) else None
    return names.index(column) if column in names else None
