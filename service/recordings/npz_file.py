"""numpy archives: `t` (s), `acc` (n×3, g), `gyro` (n×3, deg/s), `mag` (n×3, µT), `step_t` (s) and a few scalars.

The scalars are `rate_hz`, `true_steps`, `steps_min`, `steps_max`, `placement`, `activity`, `subject` and `gt_quality`;
only `t` and `acc` must be there. Arrays of Python objects are refused: reading a recording never runs code.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording, median_rate_hz, merge_repeated_stamps

Array = NDArray[Any]

ZIP_MAGIC = b"PK"
_NUMERIC = "iuf"
"""numpy's kinds of numbers: signed, unsigned, floating."""


def recognises(head: bytes) -> bool:
    """Tell whether a file that begins with `head` is a zip, as every `.npz` is."""
    return head.startswith(ZIP_MAGIC)


def read_npz(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read an archive; it holds g, so `lsb_per_g` says nothing. RecordingError where it is no recording."""
    arrays = _load(path)
    missing = [name for name in ("t", "acc") if name not in arrays]
    if missing:
        found = ", ".join(sorted(arrays)) or "no array"
        raise RecordingError(str(path), f"no array {' and '.join(missing)}; it holds {found}")
    gyro_deg_s = _floats(path, arrays, "gyro")
    t_s, (acc_g, gyro_rad_s, mag_ut) = merge_repeated_stamps(
        _required(path, arrays, "t"),
        _required(path, arrays, "acc"),
        None if gyro_deg_s is None else np.deg2rad(gyro_deg_s),
        _floats(path, arrays, "mag"),
    )
    assert acc_g is not None  # noqa: S101  # it was given
    steps = _number(path, arrays, "true_steps")
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=_number(path, arrays, "rate_hz") or rate_hz or median_rate_hz(t_s),
        gyro_rad_s=gyro_rad_s,
        mag_ut=mag_ut,
        step_t_s=_floats(path, arrays, "step_t"),
        true_steps=None if steps is None else round(steps),
        steps_range=_range(path, arrays),
        placement=_text(arrays, "placement"),
        activity=_text(arrays, "activity"),
        subject=_text(arrays, "subject"),
        quality=_text(arrays, "gt_quality"),
    )


def _load(path: Path) -> Mapping[str, Array]:
    try:
        # numpy leaves a file open that it opened itself and could not read.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            members = {name: archive[name] for name in archive.files}
    except (ValueError, RuntimeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(str(path), f"no numpy archive of plain arrays ({error})") from error
    # A member that is no array comes as bytes.
    return {name: member for name, member in members.items() if isinstance(member, np.ndarray)}


def _required(path: Path, arrays: Mapping[str, Array], name: str) -> Floats:
    values = _floats(path, arrays, name)
    assert values is not None  # noqa: S101  # the caller has checked
    return values


def _floats(path: Path, arrays: Mapping[str, Array], name: str) -> Floats | None:
    array = arrays.get(name)
    if array is None:
        return None
    if array.dtype.kind not in _NUMERIC:
        raise RecordingError(str(path), f"array {name} holds {array.dtype}, not numbers")
    return np.ascontiguousarray(array, dtype=np.float64)


def _number(path: Path, arrays: Mapping[str, Array], name: str) -> float | None:
    values = _floats(path, arrays, name)
    if values is None:
        return None
    if values.size != 1 or not np.isfinite(values).all():
        raise RecordingError(str(path), f"{name} is {values.tolist()}, not one finite number")
    return float(values.reshape(()))


def _range(path: Path, arrays: Mapping[str, Array]) -> tuple[int, int] | None:
    low, high = (_number(path, arrays, name) for name in ("steps_min", "steps_max"))
    return None if low is None or high is None else (round(low), round(high))


def _text(arrays: Mapping[str, Array], name: str) -> str | None:
    array = arrays.get(name)
    return None if array is None or array.shape != () else str(array.item())
