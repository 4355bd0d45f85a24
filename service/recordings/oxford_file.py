"""The Oxford step counter's data set: a phone's acceleration, and switches in both shoes.

    Pixel_Jamie_Hard_InHand_1/accelerometer.csv       Pixel_Jamie_Hard_InHand_1/stepcounter.csv
    5000000000000,3,-1.82,2.51,9.53                   5000200000000,1,0

No headers. The first holds nanoseconds since the phone's boot, Android's accuracy and x, y, z in m/s²; the second
nanoseconds and the switches of both feet, about eleven times a second: a step is where one goes from 0 to 1. Patients
wore no switches; their number of steps is in `notes.txt`. The files of `validation/` hold all in one:

    user1_hand_1506421989895.csv: nanoseconds, x, y, z in m/s², steps by the app, by the switches, by the phone

Source: Oxford-step-counter/DataSet on GitHub (Salvi et al. 2018, doi:10.1109/EMBC.2018.8513319), CC BY 4.0.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import STANDARD_GRAVITY, Floats, Recording, median_rate_hz, merge_repeated_stamps
from service.recordings.text_table import head_lines, numbers, read_lines

MAX_FEET_APART: Final = 3
"""Feet alternate: larger differences in their steps are a switch that bounces or sticks."""
MAX_BOUNCES: Final = 4
MAX_MISSED: Final = 2
"""More strides under half, or more left out of longer ones, than these make the truth approximate. Ours: it parts the
35 walks of `optimisation/` whose steps we trust from the 13 whose switches needed repair."""

_STAMP: Final = r"\d{6,19}"
_NUMBER: Final = r"-?\d+(?:\.\d+)?(?:[eE]-?\d+)?"
_FOLDER_ROW: Final = re.compile(rf"{_STAMP},-?\d,{_NUMBER},{_NUMBER},{_NUMBER}")
_VALIDATION_ROW: Final = re.compile(rf"{_STAMP},{_NUMBER},{_NUMBER},{_NUMBER},\d+,\d+,\d+")
_COLUMNS: Final = ("nanoseconds", "accuracy", "x", "y", "z")
_SWITCH_COLUMNS: Final = ("nanoseconds", "left", "right")
_VALIDATION_COLUMNS: Final = ("nanoseconds", "x", "y", "z", "app steps", "true steps", "phone steps")
_FOLDER: Final = re.compile(r"[A-Za-z0-9]+_(?P<who>[A-Za-z]+)_(?P<floor>[A-Za-z]+)_(?P<place>[A-Za-z]+)_\d+")
_FILE: Final = re.compile(r"(?P<who>user\d+)_(?P<place>[a-z]+)_\d+")
_NOTED: Final = re.compile(r"(?P<before>\d+)\s*steps|steps\s*(?P<after>\d+)", re.IGNORECASE)
_PLACES: Final = {
    "inhand": "hand", "hand": "hand", "swingingarm": "hand_swinging", "armband": "armband", "bag": "bag",
    "backpocket": "back_pocket", "frontpocket": "front_pocket", "neckpouch": "neck_pouch", "purse": "bag",
}  # fmt: skip


def recognises(head: bytes) -> bool:
    """Tell whether the first line of `head` is a row of either form."""
    lines = head_lines(head)
    return bool(lines) and bool(_FOLDER_ROW.fullmatch(lines[0]) or _VALIDATION_ROW.fullmatch(lines[0]))


def read_oxford(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read either form; units and times are its own, so the arguments say nothing. RecordingError names the line."""
    lines = read_lines(path)
    first_row = next(line for line in lines if line.strip())
    if first_row.count(",") == len(_COLUMNS) - 1:
        return _walk(path, numbers(path, lines, first=1, wanted=(0, 2, 3, 4), names=_COLUMNS))
    return _validation(path, numbers(path, lines, first=1, wanted=(0, 1, 2, 3, 5), names=_VALIDATION_COLUMNS))


def _walk(path: Path, table: Floats) -> Recording:
    folder = path.parent
    named = _FOLDER.fullmatch(folder.name)
    t_s, acc_g = _measured(table)
    step_t_s, true_steps, quality = _truth(folder, float(table[0, 0]))
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=median_rate_hz(t_s),
        step_t_s=step_t_s,
        true_steps=true_steps,
        placement=_PLACES.get(named["place"].lower()) if named else None,
        activity=f"walk_{named['floor'].lower()}_floor" if named else None,
        subject=named["who"] if named else None,
        quality=quality,
    )


def _validation(path: Path, table: Floats) -> Recording:
    named = _FILE.fullmatch(path.stem)
    t_s, acc_g = _measured(table)
    rises = np.diff(table[:, 4], prepend=table[0, 4])
    if not np.isin(rises, (0, 1, 2)).all():
        row = int(np.argmin(np.isin(rises, (0, 1, 2)))) + 1
        raise RecordingError(
            str(path), f"the true steps change by {rises[row - 1]:g} in row {row}; 0, 1 or 2 is wanted"
        )
    step_t_s = np.repeat((table[:, 0] - table[0, 0]) / 1e9, rises.astype(np.int64))
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=median_rate_hz(t_s),
        step_t_s=step_t_s,
        true_steps=len(step_t_s),
        placement=_PLACES.get(named["place"]) if named else None,
        subject=named["who"] if named else None,
        quality="A",
    )


def _measured(table: Floats) -> tuple[Floats, Floats]:
    """Return seconds after the first sample and acceleration in g, from columns of nanoseconds and m/s²."""
    t_s, (acc_g,) = merge_repeated_stamps((table[:, 0] - table[0, 0]) / 1e9, table[:, 1:4] / STANDARD_GRAVITY)
    assert acc_g is not None  # noqa: S101  # it was given
    return t_s, acc_g


def _truth(folder: Path, zero_ns: float) -> tuple[Floats | None, int | None, str | None]:
    """Return step times, their number and its quality; times only where both switches can be trusted."""
    switches = folder / "stepcounter.csv"
    feet: list[Floats] = []
    if switches.is_file():
        table = numbers(
            switches, read_lines(switches), first=1, wanted=range(3), names=("nanoseconds", "left", "right")
        )
        after_s = (table[1:, 0] - zero_ns) / 1e9
        feet = [after_s[np.diff(table[:, foot]) > 0] for foot in (1, 2)]
    if not feet or min(map(len, feet)) < MAX_FEET_APART:
        noted = _noted(folder / "notes.txt")
        return None, noted, None if noted is None else "B"
    step_t_s = np.sort(np.concatenate(feet))
    return (step_t_s, len(step_t_s), "A") if _trusted(*feet) else (None, len(step_t_s), "B")


def _trusted(left_s: Floats, right_s: Floats) -> bool:
    strides = np.concatenate([np.diff(foot) / np.median(np.diff(foot)) for foot in (left_s, right_s)])
    bounces = (strides < 0.5).sum()
    missed = np.maximum(np.round(strides) - 1, 0).sum()
    apart = abs(len(left_s) - len(right_s))
    return bool(apart <= MAX_FEET_APART and bounces <= MAX_BOUNCES and missed <= MAX_MISSED)


def _noted(notes: Path) -> int | None:
    found = _NOTED.search("\n".join(read_lines(notes))) if notes.is_file() else None
    return int(found["before"] or found["after"]) if found else None
