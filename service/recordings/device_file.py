"""Axivity's `.cwa` and ActiGraph's `.gt3x`, read by the library actfast (extra `devices`).

| file | what it is | public description |
| --- | --- | --- |
| `.cwa` | AX3 and AX6: a header of 1024 bytes, blocks of 512 with 40, 80 or 120 samples | openmovement, `Docs/ax3` |
| `.gt3x` | a zip of `info.txt` and `log.bin`, one record a second | github.com/actigraph/GT3X-File-Format |

An Axivity block is stamped once, and its samples are laid at the nominal rate from there, although the sensor's own
clock is some per cent off: the end of a block may then lie behind the next one's start. Here samples are spread evenly
from one block's stamp to the next one's, as the makers' own software does. actfast skips the newer records of
ActiGraph's acceleration without a word, so a `.gt3x` that holds one is refused rather than read in part. Stamps have no
zone in either file and are taken as they are. Placement and subject come from the file where its owner wrote them.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final
from urllib.parse import parse_qs

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording

if TYPE_CHECKING:
    from actfast import ActfastResult

GAP: Final = 1.5
"""A block that lasts this many times its nominal time is followed by a pause, which its samples must not be spread
over. Ours; Axivity's clocks are at most a tenth off."""

RESERVED_BYTES: Final = (1_600_000_000, 2_400_000_000, 200_000_000)
"""What actfast 1.3 reserves for any `.gt3x`, however short. Where a machine refuses that, actfast ends the process, so
it is asked for here before; none of it is touched."""

LOG: Final = "log.bin"
RECORD: Final = struct.Struct("<BBIH")
"""Of each record in it: a separator, its kind, its second, the bytes of its payload; a byte of check sum ends it."""
SEPARATOR: Final = 0x1E
SKIPPED: Final = {26: "ACTIVITY2", 27: "ACTIVITY3"}
"""Kinds of record with acceleration that actfast 1.3 passes over; pygt3x, which knows them, is under the GPL."""

CWA_MAGIC: Final = b"MD"
ZIP_MAGIC: Final = b"PK"
_PANIC_MODULE: Final = "pyo3_runtime"
_INSTALL: Final = "its reader is not installed; run pip install 'steplink[devices]'"
_NO_SAMPLES: Final = "it holds no acceleration that actfast knows; export it as CSV with the maker's software"


def recognises_cwa(head: bytes) -> bool:
    """Tell whether `head` is the beginning of an Axivity header."""
    return head.startswith(CWA_MAGIC)


def recognises_gt3x(head: bytes) -> bool:
    """Tell whether `head` is the beginning of a zip, as every `.gt3x` is."""
    return head.startswith(ZIP_MAGIC)


def read_device(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read either; scale and rate are the file's, so the arguments say nothing.

    RecordingError where the library is not installed, refuses the file or finds no samples in it.
    """
    found = _load(path)
    tables = [table for table in found["timeseries"].values() if len(table.get("acceleration", ()))]
    if not tables:
        raise RecordingError(str(path), _NO_SAMPLES)
    table = tables[0]
    t_ns = table["datetime"]
    gyro_deg_s = table.get("gyroscope")
    placement, subject = _worn(found["metadata"])
    return Recording(
        path=path,
        t_s=_spread(t_ns),
        acc_g=table["acceleration"].astype(np.float64),
        rate_hz=_nominal_hz(t_ns),
        gyro_rad_s=None if gyro_deg_s is None else np.deg2rad(gyro_deg_s.astype(np.float64)),
        placement=placement,
        subject=subject,
    )


def _load(path: Path) -> ActfastResult:
    try:
        import actfast  # noqa: PLC0415
    except ImportError as error:
        raise RecordingError(str(path), _INSTALL) from error
    if path.suffix.lower() == ".gt3x":
        _check_records(path)
        _check_memory(path)
    try:
        return actfast.read(path)
    except ValueError as error:
        raise RecordingError(str(path), f"actfast cannot read it: {error}") from error
    except BaseException as error:
        # A panic of Rust code is no Exception, and its class has no name that can be imported.
        if type(error).__module__ != _PANIC_MODULE:
            raise
        raise RecordingError(str(path), f"actfast cannot read it, the file is damaged: {error}") from error


def _check_records(path: Path) -> None:
    try:
        with zipfile.ZipFile(path) as archive, archive.open(LOG) as log:
            kind = next((kind for kind in _kinds(log) if kind in SKIPPED), None)
    except (KeyError, OSError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError):
        return  # a damaged archive is actfast's to refuse
    if kind is not None:
        why = f"it holds {SKIPPED[kind]} records, which actfast would leave out without a word"
        raise RecordingError(str(path), f"{why}; export it as CSV with the maker's software")


def _kinds(log: IO[bytes]) -> Iterator[int]:
    """Yield the kind of each record up to the first damaged one."""
    while len(head := log.read(RECORD.size)) == RECORD.size:
        separator, kind, _, size = RECORD.unpack(head)
        if separator != SEPARATOR:
            return
        yield kind
        log.read(size + 1)


def _check_memory(path: Path) -> None:
    try:
        _ = [np.empty(size, dtype=np.uint8) for size in RESERVED_BYTES]
    except MemoryError as error:
        why = f"actfast reserves {sum(RESERVED_BYTES) / 1e9:.1f} GB to read a .gt3x, which this machine refuses"
        raise RecordingError(str(path), f"{why}; export it as CSV with the maker's software") from error


def _nominal_hz(t_ns: NDArray[np.int64]) -> float:
    """Return the rate most samples are laid at, in whole hundredths; 1 where there is none, which is refused later."""
    spacing_ns = float(np.median(np.diff(t_ns))) if len(t_ns) > 1 else 0.0
    return round(1e9 / spacing_ns, 2) if spacing_ns > 0 else 1.0


def _spread(t_ns: NDArray[np.int64]) -> Floats:
    """Return seconds after the first sample, every block's samples even up to the next block, pauses kept."""
    seconds = np.asarray((t_ns - t_ns[0]) / 1e9, dtype=np.float64)
    steps = np.diff(seconds)
    if not len(steps):
        return seconds
    nominal_s = float(np.median(steps))
    starts = np.flatnonzero(np.abs(steps - nominal_s) > 1e-6) + 1
    edges = np.concatenate(([0], starts))
    samples = np.diff(np.append(edges, len(seconds)))
    lasts_s = np.diff(seconds[edges], append=np.inf)
    even = (lasts_s > 0) & (lasts_s < GAP * nominal_s * samples)
    spacing_s = np.where(even, lasts_s / samples, nominal_s)
    place = np.arange(len(seconds)) - np.repeat(edges, samples)
    spread: Floats = np.repeat(seconds[edges], samples) + np.repeat(spacing_s, samples) * place
    return spread


def _worn(metadata: Mapping[str, Mapping[str, str]]) -> tuple[str | None, str | None]:
    """Return placement and subject as written in Axivity's annotation (`_p=left+wrist&_sc=7`) or ActiGraph's info."""
    annotation = parse_qs(metadata.get("session", {}).get("annotation", ""))
    info = metadata.get("info", {})
    placement = (annotation.get("_p") or [f"{info.get('Side', '')} {info.get('Limb', '')}"])[0]
    subject = (annotation.get("_sc") or [info.get("Subject Name", "")])[0]
    return placement.strip().lower() or None, subject.strip() or None
