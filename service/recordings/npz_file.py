"""numpy archives: `t` (s), `acc` (n×3, g), `gyro` (n×3, deg/s), `mag` (n×3, µT), `step_t` (s) and a few scalars.

The scalars are `rate_hz`, `true_steps`, `placement`, `activity`, `subject` and `gt_quality`; only `t` and `acc` must
be there. Arrays of Python objects are refused: reading a recording never runs code.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording, median_rate_hz, merge_repeated_stamps

ZIP_MAGIC = b"PK"
UNKNOWN_STEPS = -1
"""What some archives hold where the number of steps was never counted."""


def recognises(head: bytes) -> bool:
    """Tell whether a file that begins with `head` is a zip, as every `.npz` is."""
    return head.startswith(ZIP_MAGIC)


def read_npz(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read an archive; it holds g, so `lsb_per_g` says nothing. RecordingError where it is no recording."""
    arrays = _load(path)
    missing = [name for name in ("t", "acc") if name not in arrays]
    if missing:
        found = ", ".join(sorted(arrays)) or "nothing"
        raise RecordingError(str(path), f"no array {' and '.join(missing)}; it holds {found}")
    gyro_deg_s = _floats(path, arrays, "gyro")
    t_s, (acc_g, gyro_rad_s, mag_ut) = merge_repeated_stamps(
        _required(path, arrays, "t"),
        _required(path, arrays, "acc"),
        None if gyro_deg_s is None else np.deg2rad(gyro_deg_s),
        _floats(path, arrays, "mag"),
    )
    assert acc_g is not None  # noqa: S101  # it was given
    steps = _scalar(arrays, "true_steps")
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=float(_scalar(arrays, "rate_hz") or rate_hz or median_rate_hz(t_s)),
        gyro_rad_s=gyro_rad_s,
        mag_ut=mag_ut,
        step_t_s=_floats(path, arrays, "step_t"),
        true_steps=None if steps is None or steps == UNKNOWN_STEPS else int(steps),
        placement=_scalar(arrays, "placement"),
        activity=_scalar(arrays, "activity"),
        subject=_scalar(arrays, "subject"),
        quality=_scalar(arrays, "gt_quality"),
    )


def _load(path: Path) -> Mapping[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, zipfile.BadZipFile, EOFError, NotImplementedError, AttributeError) as error:
        raise RecordingError(str(path), f"no numpy archive of plain arrays ({error})") from error


def _required(path: Path, arrays: Mapping[str, Any], name: str) -> Floats:
    values = _floats(path, arrays, name)
    assert values is not None  # noqa: S101  # the caller has checked
    return values


def _floats(path: Path, arrays: Mapping[str, Any], name: str) -> Floats | None:
    if name not in arrays:
        return None
    try:
        return np.ascontiguousarray(arrays[name], dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise RecordingError(str(path), f"array {name} does not hold numbers ({error})") from error


def _scalar(arrays: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401  # whatever the archive holds
    value = arrays.get(name)
    return None if value is None or value.shape != () else value.item()
