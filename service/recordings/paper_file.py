"""The layout of the double threshold's paper (Wang, Peng, Zhou, Table 1): what its bracelet sent to the phone.

    序号  X轴  Y轴  Z轴  年/月/日   时间
    58    -22   -5   16   2017/1/3  21:47:38:314
    59    -22   -6   16   2017/1/3  21:47:38:314

Index, three counts of the sensor, date, and time ending in `:milliseconds`; commas, tabs or blanks between columns; a
header in any language, or none. The paper prints no scale; the six norms of its Table 1 average 32, so 32 LSB per g
is our reading. A stamp is an arrival, shared by several samples: time is index ÷ rate (the paper's 50 Hz unless
declared otherwise), and stamps only check that rate.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording

LSB_PER_G: Final = 32.0
RATE_HZ: Final = 50.0
STAMP_SLACK_S: Final = 2.0
"""Stamps are arrivals: a packet may come this much late without saying anything of the rate."""
STAMP_SLACK: Final = 0.1
"""By how much the stamps' rate may differ from the declared one."""

_SEPARATOR: Final = re.compile(r"[,;\t ]+")
_NUMBER: Final = r"[-+]?\d+(?:\.\d+)?"
_ROW: Final = re.compile(
    rf"(?P<index>\d{{1,18}}) (?P<x>{_NUMBER}) (?P<y>{_NUMBER}) (?P<z>{_NUMBER}) "
    r"(?P<year>\d{4})[/-](?P<month>\d{1,2})[/-](?P<day>\d{1,2}) "
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[:.](?P<ms>\d{1,3}))?"
)
_ENCODINGS: Final = ("utf-8-sig", "gb18030")
_HEADER_LINES: Final = 2


def recognises(head: bytes) -> bool:
    """Tell whether one of the first lines of `head` is a row of the table."""
    lines = [line for line in head.decode("latin-1").split("\n") if line.strip()]
    return any(_row(line) for line in lines[: _HEADER_LINES + 1])


def read_paper(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:
    """Read the table; `lsb_per_g` counts are 1 g. RecordingError names the line that breaks it."""
    rate_hz = rate_hz or RATE_HZ
    rows = _rows(path)
    index = np.array([int(row["index"]) for row in rows], dtype=np.int64)
    stamps_s = np.array([_stamp_s(path, row) for row in rows])
    counts = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    t_s = (index - index[0]) / rate_hz
    _check_stamps(path, stamps_s - stamps_s[0], t_s, rate_hz)
    try:
        return Recording(path=path, t_s=t_s, acc_g=counts / lsb_per_g, rate_hz=rate_hz)
    except RecordingError as error:
        raise RecordingError(str(path), f"{error.why} (read with lsb_per_g={lsb_per_g:g})") from error


def _row(line: str) -> re.Match[str] | None:
    return _ROW.fullmatch(_SEPARATOR.sub(" ", line.strip()))


def _rows(path: Path) -> list[re.Match[str]]:
    rows: list[re.Match[str]] = []
    for number, line in enumerate(_text(path).split("\n"), start=1):
        row = _row(line)
        if row is not None:
            rows.append(row)
        elif rows and line.strip():
            wanted = "index, X, Y, Z, date, time are wanted, as in 58,-22,-5,16,2017/1/3,21:47:38:314"
            raise RecordingError(str(path), f"line {number}: {line.strip()[:60]!r}; {wanted}")
    if not rows:
        raise RecordingError(str(path), "no row of the paper's table; save the file as UTF-8")
    return rows


def _text(path: Path) -> str:
    raw = path.read_bytes()
    for encoding in _ENCODINGS:
        try:
            return raw.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise RecordingError(str(path), "neither UTF-8 nor GB 18030; save the file as UTF-8")


def _stamp_s(path: Path, row: re.Match[str]) -> float:
    year, month, day, hour, minute, second = (
        int(row[name]) for name in ("year", "month", "day", "hour", "minute", "second")
    )
    try:
        # The paper names no zone; only differences count.
        whole = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError as error:
        raise RecordingError(str(path), f"sample {row['index']}: no date and time ({error})") from error
    return whole.timestamp() + int(row["ms"] or 0) / 1000


def _check_stamps(path: Path, stamps_s: Floats, t_s: Floats, rate_hz: float) -> None:
    back = np.diff(stamps_s) < 0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise RecordingError(str(path), f"the stamp of row {row + 1} is before that of row {row}; sort by index")
    span_s = float(t_s[-1])
    excess_s = abs(float(stamps_s[-1]) - span_s)
    if excess_s > STAMP_SLACK_S + STAMP_SLACK * span_s:
        fits_hz = rate_hz * span_s / float(stamps_s[-1]) if stamps_s[-1] > 0 else 0.0
        raise RecordingError(
            str(path),
            f"stamps span {stamps_s[-1]:.1f} s, the samples at {rate_hz:g} Hz {span_s:.1f} s;"
            f" rate_hz={fits_hz:.3g} would fit",
        )
