"""A recording as a value: the same units whatever the file held, and nothing in it that a counter would choke on.

Whoever holds a Recording need not check it: the shapes agree, every value is finite, time rises, and gravity is about
1 g. What breaks one of these raises a RecordingError that names the sample and says what to do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordingError

Floats = NDArray[np.float64]

AXES = "xyz"
MIN_SAMPLES = 2
NORM_G = (0.3, 3.0)
"""Median norms that can be gravity plus motion; the 993 recordings we measured lie within 0.91…1.86 g."""
STANDARD_GRAVITY = 9.80665
"""m/s² in one g."""
BLOCKS_FROM = 0.1
"""Where a larger share of the samples repeats a stamp, stamps are those of blocks, and no slip of a logger."""
MIN_BLOCKS = 3
"""Fewer say nothing of the time between two samples."""
PAUSE = 1.5
"""A block that lasts this many times as long as usual is followed by a pause, over which nothing is spread."""
COPIED_SHARE = 0.99
_REST_G = (0.85, 1.2)
"""Median norms that make a guess of the unit credible."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Acceleration of one wearer, gravity included, and what is known of the truth.

    `t_s` (n, seconds, rising) stands beside `acc_g` (n×3), `gyro_rad_s` and `mag_ut` (n×3 or None); `rate_hz` is the
    nominal rate. `step_t_s` are the true times of steps in the time of `t_s`, `true_steps` their number; each is None
    where unknown, and the number may be known without the times; `steps_range` is what it may be, the limits included,
    where that is all the wearer knew. `quality` is A where the truth is trusted, B where it is approximate.
    """

    path: Path
    t_s: Floats
    acc_g: Floats
    rate_hz: float
    gyro_rad_s: Floats | None = None
    mag_ut: Floats | None = None
    step_t_s: Floats | None = None
    true_steps: int | None = None
    steps_range: tuple[int, int] | None = None
    placement: str | None = None
    activity: str | None = None
    subject: str | None = None
    quality: str | None = None

    def __post_init__(self) -> None:
        # Values that overflow are found by the checks, which say where they are.
        with np.errstate(all="ignore"):
            self._check_shapes()
            self._check_values()
            self._check_time()
            self._check_truth()
            self._check_scale()

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last, in seconds."""
        return float(self.t_s[-1] - self.t_s[0])

    def _fail(self, why: str) -> RecordingError:
        return RecordingError(str(self.path), why)

    def _sensors(self) -> list[tuple[str, Floats]]:
        named = (("acc", self.acc_g), ("gyro", self.gyro_rad_s), ("mag", self.mag_ut))
        return [(name, values) for name, values in named if values is not None]

    def _check_shapes(self) -> None:
        if self.t_s.ndim != 1:
            raise self._fail(f"time has shape {self.t_s.shape}; one column of seconds is wanted")
        for name, values in self._sensors():
            if values.shape != (len(self.t_s), 3):
                raise self._fail(f"{name} has shape {values.shape}; with {len(self.t_s)} times it must be (n, 3)")
        if len(self) < MIN_SAMPLES:
            raise self._fail(
                f"{len(self)} sample{'s' * (len(self) != 1)}; at least {MIN_SAMPLES} are needed: is the file cut short?"
            )

    def _check_values(self) -> None:
        if not np.isfinite(self.t_s).all():
            raise self._fail(f"time of sample {_first(~np.isfinite(self.t_s))} is not finite; remove the sample")
        for name, values in self._sensors():
            finite = np.isfinite(values)
            if not finite.all():
                row, axis = np.argwhere(~finite)[0]
                why = f"{name} {AXES[axis]} of sample {row} (at {self.t_s[row]:.3f} s) is {values[row, axis]}"
                raise self._fail(f"{why}; remove the sample, the gap is handled")

    def _check_time(self) -> None:
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise self._fail(f"a rate of {self.rate_hz} Hz; it must be above 0")
        still = np.diff(self.t_s) <= 0
        if still.any():
            row = _first(still) + 1
            before, after = self.t_s[row - 1 : row + 1]
            why = f"time does not rise at sample {row} ({before:.6f} s, then {after:.6f} s)"
            raise self._fail(f"{why}; sort the samples, or leave the time out and declare the rate")

    def _check_truth(self) -> None:
        if self.true_steps is not None and self.true_steps < 0:
            raise self._fail(f"{self.true_steps} true steps; leave the number out where it is unknown")
        if self.steps_range is not None and not 0 <= self.steps_range[0] <= self.steps_range[1]:
            raise self._fail(f"{self.steps_range} is no range of steps; the lower number comes first")
        times = self.step_t_s
        if times is not None and (times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) < 0).any()):
            raise self._fail("step times must be finite seconds in rising order")

    def _check_scale(self) -> None:
        norm_g = float(np.median(np.sqrt((self.acc_g**2).sum(axis=1))))
        if not NORM_G[0] <= norm_g <= NORM_G[1]:
            raise self._fail(f"the median norm is {norm_g:.4g} g, gravity should make it about 1; {_fitting(norm_g)}")


def spread_stamps(t_s: Floats, *columns: Floats | None) -> Floats:
    """Return the times of samples whose stamps are those of whole blocks: even from one stamp to the next one.

    So write loggers that round to tenths of a second, or stamp a packet. Times are returned as they are where few are
    repeated, where they do not rise, and where what repeats is the sample too, written twice.
    """
    if t_s.ndim != 1 or not len(t_s) or not np.isfinite(t_s).all():
        return t_s
    new = np.diff(t_s, prepend=-np.inf) != 0
    starts = np.flatnonzero(new)
    if np.mean(~new) < BLOCKS_FROM or len(starts) < MIN_BLOCKS or (np.diff(t_s) < 0).any() or _copied(~new, columns):
        return t_s
    samples = np.diff(starts, append=len(t_s))
    spacing_s = np.diff(t_s[starts]) / samples[:-1]
    usual_s = float(np.median(spacing_s))
    even_s = np.append(np.where(spacing_s > PAUSE * usual_s, usual_s, spacing_s), usual_s)
    place = np.arange(len(t_s)) - np.repeat(starts, samples)
    spread: Floats = t_s + np.repeat(even_s, samples) * place
    return spread


def _copied(repeats: NDArray[np.bool_], columns: Sequence[Floats | None]) -> bool:
    """Tell whether nearly all samples with a repeated stamp are the one before once more."""
    at = np.flatnonzero(repeats)
    held = [column for column in columns if column is not None and len(column) == len(repeats)]
    same = [(column[at] == column[at - 1]).reshape(len(at), -1).all(axis=1) for column in held]
    return bool(held) and float(np.mean(np.all(same, axis=0))) > COPIED_SHARE


def merge_repeated_stamps(t_s: Floats, *columns: Floats | None) -> tuple[Floats, list[Floats | None]]:
    """Drop every sample that bears the very stamp of the one before it, as loggers now and then write.

    Returns the times and the columns in the order given, None staying None; columns of another length stay as they
    are, for the Recording to refuse. Where whole blocks share a stamp their samples are spread instead.
    """
    t_s = spread_stamps(t_s, *columns)
    keep = np.concatenate((np.ones(1, bool), np.diff(t_s) != 0)) if t_s.ndim == 1 and len(t_s) else np.ones(1, bool)
    if keep.all() or any(column is not None and len(column) != len(t_s) for column in columns):
        return t_s, list(columns)
    return t_s[keep], [None if column is None else column[keep] for column in columns]


def median_rate_hz(t_s: Floats) -> float:
    """Return the rate that the median spacing of `t_s` says; 1 where times do not rise, which a Recording refuses.

    Rounded to a millionth: 0.01 s between stamps that are no exact fractions are 100 Hz, not 100.000000000002.
    """
    spacing_s = float(np.median(np.diff(t_s))) if t_s.ndim == 1 and len(t_s) >= MIN_SAMPLES else 0.0
    return round(1.0 / spacing_s, 6) or 1.0 / spacing_s if spacing_s > 0 else 1.0


def _first(mask: NDArray[np.bool_]) -> int:
    return int(np.argmax(mask))


def _fitting(norm: float) -> str:
    """Say which unit or scale would make `norm`, the median in what was taken for g, one g."""
    if norm == 0 or not math.isfinite(norm):
        return "the sensor was off or the columns are not acceleration"
    for unit, per_g in (("m/s²", STANDARD_GRAVITY), ("milli-g", 1000.0)):
        if _REST_G[0] <= norm / per_g <= _REST_G[1]:
            return f"it looks like {unit}: divide by {per_g:g}"
    return f"a scale of about {norm:.3g} counts per g would fit (sensors use powers of two: {_power_of_two(norm):g})"


def _power_of_two(norm: float) -> float:
    return float(2.0 ** round(math.log2(norm)))
