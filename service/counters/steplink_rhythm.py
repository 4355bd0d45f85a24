"""The exact cadence of steplink's counter: the network knows it roughly, autocorrelation knows it well.

Once a frame, over the last WINDOW rows of the front end (4.16 s): r_m is the autocorrelation of the magnitude, r_t that
of the three axes together, normalised and unbiased. For 61 factors q from 0.6 to 1.5, T = 1/(c q), c being the
network's cadence, S(q) = (r_m(T) + r_m(2T) + r_t(2T))/3; where S − 2 ln² q is greatest, off both ends and with S above
0.35, c q is the cadence. Twice T, since one foot differs from the other and an arm swings once in two steps.

The rows are integers, so each sum of products is exact and its bits are the same whichever way it is found.
"""

from __future__ import annotations

from math import exp
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_front as front
from service.counters.steplink_network import FRAME_ROWS, UNIT, WEIGHT_UNIT
from service.samples import GRID_HZ

WINDOW: Final = 104
LAGS: Final = 90
"""Longer lags overlap too little to say anything, and count as 0."""
ROWS_HZ: Final = GRID_HZ / front.EVERY
COLUMNS: Final = front.ROW - front.SENSED

SLOWEST_HZ: Final = 0.6
SPAN_HZ: Final = 3.2
"""The network's cadence is SLOWEST_HZ + SPAN_HZ σ(z − 0.5)."""
LOGIT: Final = 1.0 / (UNIT * WEIGHT_UNIT)

FACTORS: Final = 0.6 * (1.5 / 0.6) ** (np.arange(61) / 60.0)
COSTS: Final = 2.0 * np.log(FACTORS) ** 2
ACCEPTED: Final = 0.35

Floats = NDArray[np.float64]

TRANSFORM: Final = 256
"""Values of the Fourier transform: more than WINDOW + LAGS, so that nothing wraps around."""

_PERIODS: Final = np.concatenate((1.0 / FACTORS, 2.0 / FACTORS, 2.0 / FACTORS))
"""Lags of r_m(T), r_m(2T), r_t(2T), as shares of the rough period; and where each correlation begins."""
_FIRST: Final = np.repeat((0, 0, LAGS), len(FACTORS))
_UNBIASED: Final = WINDOW / (WINDOW - np.arange(LAGS, dtype=np.float64))


def cadence_hz(z: float) -> float:
    """Return the network's cadence for its second logit, in units of LOGIT."""
    return SLOWEST_HZ + SPAN_HZ / (1.0 + exp(0.5 - z * LOGIT))


def windows(columns: Floats) -> Floats:
    """Return frames × COLUMNS × WINDOW; `columns` begin WINDOW − FRAME_ROWS rows before the first frame does."""
    frames = (columns.shape[1] - WINDOW) // FRAME_ROWS + 1
    by_column, by_row = columns.strides
    return np.lib.stride_tricks.as_strided(
        columns, (frames, COLUMNS, WINDOW), (by_row * FRAME_ROWS, by_column, by_row), writeable=False
    )


def correlations(seen: Floats) -> Floats:
    """Return frames × 2 × LAGS of r_m and r_t for frames × COLUMNS × WINDOW integers."""
    level = seen - np.rint(seen.sum(axis=2) / WINDOW)[:, :, None]
    spectrum = np.fft.rfft(level, TRANSFORM)
    power = spectrum.real * spectrum.real + spectrum.imag * spectrum.imag
    power[:, 1] += power[:, 2]
    power[:, 1] += power[:, 3]
    sums = np.rint(np.fft.irfft(power[:, :2], TRANSFORM)[:, :, :LAGS])
    ratio: Floats = sums / np.maximum(sums[:, :, :1], 1.0)
    ratio *= _UNBIASED
    return ratio


def refined_hz(rough_hz: Floats, r: Floats) -> Floats:
    """Return the cadence that `correlations` have near each frame's `rough_hz`; that itself where they have none."""
    lags = (ROWS_HZ / rough_hz)[:, None] * _PERIODS
    whole = np.minimum(lags, LAGS - 2.0).astype(np.intp)
    at = whole + _FIRST
    if len(r) > 1:
        at += 2 * LAGS * np.arange(len(r))[:, None]
    flat = r.ravel()
    before = flat[at]
    values = before + (flat[at + 1] - before) * (lags - whole)
    values[lags >= LAGS - 1] = 0.0
    s = values.reshape(-1, 3, len(FACTORS)).sum(axis=1) / 3.0
    best = (s - COSTS).argmax(axis=1)
    accepted = (best > 0) & (best < len(FACTORS) - 1) & (s[np.arange(len(s)), best] > ACCEPTED)
    return np.where(accepted, rough_hz * FACTORS[best], rough_hz)
