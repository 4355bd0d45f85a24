"""Which formats there are: one line each. A file's suffix says which may apply, its first bytes which one does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from service.errors import ParameterError, RecordingError
from service.recordings import (
    bangle_file,
    clemson_file,
    csv_file,
    device_file,
    mapped_file,
    npz_file,
    oxford_file,
    oxwalk_file,
    paper_file,
)
from service.recordings.mapped_file import ColumnMapping
from service.recordings.recording import Recording

HEAD_BYTES = 4096
"""Enough for the comment lines, the header and the first samples of a text file."""


class Reader(Protocol):
    """Reads one format; `rate_hz` matters where the file says no rate, `lsb_per_g` where it holds counts."""

    def __call__(self, path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:
        """Return the recording at `path`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """One format: the suffixes it goes by, what its first bytes look like, its reader.

    `meant` is the stricter look, at a file that nobody named: is it one at all, perhaps a damaged one?
    """

    name: str
    suffixes: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    meant: Callable[[bytes], bool]
    read: Reader


_TEXT: Final = (".csv", ".txt")

FORMATS: Final = (
    Format(
        name="npz",
        suffixes=(".npz",),
        recognises=npz_file.recognises,
        meant=lambda _: True,
        read=npz_file.read_npz,
    ),
    Format(
        name="cwa",
        suffixes=(".cwa",),
        recognises=device_file.recognises_cwa,
        meant=lambda _: True,
        read=device_file.read_device,
    ),
    Format(
        name="gt3x",
        suffixes=(".gt3x",),
        recognises=device_file.recognises_gt3x,
        meant=lambda _: True,
        read=device_file.read_device,
    ),
    Format(
        name="paper",
        suffixes=mapped_file.SUFFIXES,
        recognises=paper_file.recognises,
        meant=paper_file.recognises,
        read=paper_file.read_paper,
    ),
    Format(
        name="oxwalk",
        suffixes=_TEXT,
        recognises=oxwalk_file.recognises,
        meant=oxwalk_file.recognises,
        read=oxwalk_file.read_oxwalk,
    ),
    Format(
        name="bangle",
        suffixes=_TEXT,
        recognises=bangle_file.recognises,
        meant=bangle_file.recognises,
        read=bangle_file.read_bangle,
    ),
    Format(
        name="clemson",
        suffixes=(".txt",),
        recognises=clemson_file.recognises,
        meant=clemson_file.recognises,
        read=clemson_file.read_clemson,
    ),
    Format(
        name="oxford",
        suffixes=_TEXT,
        recognises=oxford_file.recognises,
        meant=oxford_file.recognises,
        read=oxford_file.read_oxford,
    ),
    Format(
        name="csv",
        suffixes=_TEXT,
        recognises=csv_file.recognises,
        meant=csv_file.names_acceleration,
        read=csv_file.read_csv,
    ),
)


def suffixes() -> frozenset[str]:
    """Return the file name endings `read` knows, in lower case, with the dot."""
    return frozenset(suffix for known in FORMATS for suffix in known.suffixes)


def is_recording(path: Path, mapping: ColumnMapping | None = None) -> bool:
    """Tell whether a file found in a folder is meant as a recording; a text without acceleration is not.

    An empty or unreadable one is: `read` says what is wrong with it. With `mapping`, a text is one that has them.
    """
    possible = _possible(path)
    try:
        head = _head(path)
    except OSError:
        return bool(possible)
    if mapping and path.suffix.lower() in mapped_file.SUFFIXES:
        return not head.strip() or mapped_file.has_columns(head, mapping)
    return any(not head.strip() or known.meant(head) for known in possible)


def read(
    path: str | Path,
    *,
    lsb_per_g: float = paper_file.LSB_PER_G,
    rate_hz: float | None = None,
    mapping: ColumnMapping | None = None,
) -> Recording:
    """Read a recording of any known format.

    `lsb_per_g` scales formats that hold a sensor's counts; `rate_hz` is the rate of a file that does not say its own.
    With `mapping`, every text is a table with those columns, whatever it looks like; other files say themselves what
    they hold. RecordingError says what is wrong with the file, where in it, and what to do; ParameterError refuses a
    rate or a scale that is not above 0.
    """
    for name, value in (("lsb_per_g", lsb_per_g), ("rate_hz", rate_hz)):
        if value is not None and not 0 < value < math.inf:
            raise ParameterError(name, value, "a finite number above 0 is wanted")
    path = Path(path)
    try:
        # Values that overflow are found by the checks, which say where they are.
        with np.errstate(all="ignore"):
            if mapping and path.suffix.lower() in mapped_file.SUFFIXES:
                return mapped_file.read_mapped(path, mapping, rate_hz=rate_hz)
            return _recognised(path).read(path, lsb_per_g=lsb_per_g, rate_hz=rate_hz)
    except OSError as error:
        raise RecordingError(str(path), error.strerror or str(error)) from error


def _possible(path: Path) -> list[Format]:
    return [known for known in FORMATS if path.suffix.lower() in known.suffixes]


def _recognised(path: Path) -> Format:
    possible = _possible(path)
    if not possible:
        if not path.exists():
            raise RecordingError(str(path), "no such file")
        known_ones = ", ".join(sorted(suffixes()))
        raise RecordingError(str(path), f"unknown ending {path.suffix!r}; known are {known_ones}")
    head = _head(path)
    if not head.strip():
        raise RecordingError(str(path), "the file is empty")
    for known in possible:
        if known.recognises(head):
            return known
    expected = " or ".join(known.name for known in possible)
    raise RecordingError(str(path), f"the content is not what the ending {path.suffix!r} says ({expected})")


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)
