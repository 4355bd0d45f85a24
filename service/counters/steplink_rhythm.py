"""The exact cadence of steplink's counter: the network knows it roughly, autocorrelation knows it well.

Once a frame, over the last WINDOW rows of the front end (4.16 s): r_m is the autocorrelation of the magnitude, r_t that
of the three axes together, normalised and unbiased. For 61 factors q from 0.6 to 1.5, T = 1/(c q), c being the
network's cadence, S(q) = (r_m(T) + r_m(2T) + r_t(2T))/3; where S − 2 ln² q is greatest, off both ends and with S above
0.35, c q is the cadence. Twice T, since one foot differs from the other and an arm swings once in two steps.

The rows are integers, so each sum of products is exact and its bits are the same whichever way it is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import as_strided
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
_FACTORS: Final[list[float]] = FACTORS.tolist()
FASTEST_HZ: Final = (SLOWEST_HZ + SPAN_HZ) * _FACTORS[-1]
COSTS: Final = 2.0 * np.log(FACTORS) ** 2
ACCEPTED: Final = 0.35

Floats = NDArray[np.float64]

PERIODS: Final = np.concatenate((1.0 / FACTORS, 2.0 / FACTORS, 2.0 / FACTORS))
"""Lags of r_m(T), r_m(2T), r_t(2T), as shares of the rough period; and where each correlation begins."""
_FIRST: Final = np.repeat((0, 0, LAGS), len(FACTORS))
UNBIASED: Final = WINDOW / (WINDOW - np.arange(LAGS, dtype=np.float64))
_APART: Final = WINDOW + LAGS - 1
"""From one column to the next, the rest being 0: no lag reaches from one into another."""


def cadence_hz(z: float) -> float:
    """Return the network's cadence for its second logit, in units of LOGIT."""
    return SLOWEST_HZ + SPAN_HZ / (1.0 + exp(0.5 - z * LOGIT))


NOTHING: Final = np.zeros((COLUMNS, WINDOW - FRAME_ROWS))
"""What a window begins with before its first frame."""


class Windows:
    """The last WINDOW rows of a stream, kept from frame to frame."""

    def __init__(self) -> None:
        self.seen = np.zeros((1, COLUMNS, WINDOW))

    @property
    def past(self) -> Floats:
        """COLUMNS × (WINDOW − FRAME_ROWS): what the next frame's window begins with."""
        return self.seen[0, :, FRAME_ROWS:]

    @past.setter
    def past(self, columns: Floats) -> None:
        self.seen[0, :, FRAME_ROWS:] = columns

    def take(self, rows: Floats) -> Floats:
        """Return frames × COLUMNS × WINDOW for (frames × FRAME_ROWS) × COLUMNS, to be read before more is taken."""
        if len(rows) == FRAME_ROWS:
            self.seen[0, :, :-FRAME_ROWS] = self.seen[0, :, FRAME_ROWS:]
            self.seen[0, :, -FRAME_ROWS:] = rows.T
            return self.seen
        columns = np.concatenate((self.past, rows.T), axis=1)
        self.past = columns[:, len(rows) :]
        by_column, by_row = columns.strides
        shape = (len(rows) // FRAME_ROWS, COLUMNS, WINDOW)
        return as_strided(columns, shape, (by_row * FRAME_ROWS, by_column, by_row), writeable=False)


def correlations(seen: Floats) -> Floats:
    """Return frames × 2 × LAGS of r_m and r_t for frames × COLUMNS × WINDOW integers."""
    apart = np.zeros((len(seen), COLUMNS, _APART))
    level = np.add.reduce(seen, 2)
    level /= WINDOW
    np.rint(level, out=level)
    np.subtract(seen, level[:, :, None], out=apart[:, :, :WINDOW])
    r = np.empty((len(seen), 2, LAGS))
    for columns, (of_magnitude, of_axes) in zip(apart.reshape(len(seen), -1), r, strict=True):
        of_magnitude[:] = np.correlate(columns[:_APART], columns[:WINDOW], "valid")
        of_axes[:] = np.correlate(columns[_APART:], columns[_APART : WINDOW - _APART], "valid")
    r /= np.maximum(r[:, :, :1], 1.0)
    r *= UNBIASED
    return r


def refined_hz(rough_hz: Sequence[float], r: Floats) -> list[float]:
    """Return the cadence that `correlations` have near each frame's `rough_hz`; that itself where they have none.

    `r` is spent by it.
    """
    lags = (ROWS_HZ / np.array(rough_hz))[:, None] * PERIODS
    whole = np.minimum(lags.astype(np.intp), LAGS - 1)
    lags -= whole
    whole += _FIRST
    if len(r) > 1:
        whole += 2 * LAGS * np.arange(len(r))[:, None]
    rise = np.zeros_like(r)
    np.subtract(r[:, :, 1:], r[:, :, :-1], out=rise[:, :, :-1])
    r[:, :, -1] = 0.0
    lags *= rise.take(whole)
    lags += r.take(whole)
    s = np.add.reduce(lags.reshape(-1, 3, len(FACTORS)), 1)
    s /= 3.0
    best = (s - COSTS).argmax(axis=1).tolist()
    return [
        rough * _FACTORS[k] if 0 < k < len(FACTORS) - 1 and s[i, k] > ACCEPTED else rough
        for i, (rough, k) in enumerate(zip(rough_hz, best, strict=True))
    ]
