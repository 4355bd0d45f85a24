"""Peaks of the fusion counter that its filter has not let out yet: known already, since its input waits.

The five filters lag alike because the faster ones' inputs wait for the slowest (`fusion`). What waits is there, so the
filter in force can be run over it ahead of time: the same values will come out, unless another filter takes over; a
peak seen coming is then taken back, and told again once it is one.
"""

from __future__ import annotations

from math import sqrt

from service.counters.fusion_state import (
    A1,
    A2,
    AXES,
    BANK,
    DELAY,
    FILTER,
    FIRST,
    LAGS,
    NEXT,
    RAW,
    TUNED_TO,
    Y1,
    Y2,
    State,
)


def coming_peaks(s: State) -> list[tuple[float, float]]:
    """Return index and height of the peaks of the filtered norm up to where its input ends."""
    bank = BANK + int(s[TUNED_TO] - 1.0) * FILTER
    lag, b0, a1, a2 = int(s[bank]), s[bank + 1], s[bank + 2], s[bank + 3]
    x1, y1, z1, x2, y2, z2 = s[Y1], s[Y1 + 1], s[Y1 + 2], s[Y2], s[Y2 + 1], s[Y2 + 2]
    older, last, first = s[A2], s[A1], int(s[NEXT])
    earliest = int(s[FIRST] + s[DELAY]) + 1
    found: list[tuple[float, float]] = []
    for k in range(first, first + lag):
        p, q, r = (RAW + (k - lag - back) % LAGS * AXES for back in (0, 1, 2))
        x1, x2 = b0 * (s[p] + 2.0 * s[q] + s[r]) - a1 * x1 - a2 * x2, x1
        y1, y2 = b0 * (s[p + 1] + 2.0 * s[q + 1] + s[r + 1]) - a1 * y1 - a2 * y2, y1
        z1, z2 = b0 * (s[p + 2] + 2.0 * s[q + 2] + s[r + 2]) - a1 * z1 - a2 * z2, z1
        norm = sqrt(x1 * x1 + y1 * y1 + z1 * z1)
        if older < last > norm and k > earliest:
            found.append((float(k - 1), last))
        older, last = last, norm
    return found
