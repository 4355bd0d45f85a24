"""What the swing of the fusion counter's device says about the steps: when it turned, and how long a step takes.

A swinging hand or thigh turns once a step, so its gyroscope's main axis goes from one side of its mean to the other:
between two steps there is one extremum, at whatever phase to the norm's peaks. `fusion` says what is made of that.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

from service.counters.fusion_checks import GYROSCOPE, main_axis, value, variance
from service.counters.fusion_state import FIRST, GRID_HZ, MATCHED, MAX_STEP, MOTION, PERIOD, SWING, State

SPAN: Final = 110
"""Samples looked back on: three turns at 60 steps a minute fit; what lies farther back was another pace."""

TURNED: Final = 0.5
"""Standard deviations from the mean at which the axis is on a side: noise about the mean is no turn."""

EVEN: Final = 1.7
"""An even swing's one half is at most so many times as long as the other; a gesture's are not alike."""

MOST_HZ: Final = 5.0
"""Steps a second of the last filter: a faster swing is none of a step."""

TAKEN: Final = -1
STILL: Final = -2
"""No turn but those that steps were matched with before; no swing at all."""


def look(s: State, previous: int, last: int, to: int) -> int:
    """Return the first turn after the peak `previous` that no step was matched with, up to sample `to`; else why none.

    The time of a step by the swing's last three turns is left in `PERIOD`, 0 where they are not even.
    """
    s[PERIOD] = 0.0
    start = max(last - SPAN, int(s[FIRST]))
    axis = main_axis(s, MOTION, GYROSCOPE, start, last)
    spread = variance(s, MOTION, axis, start, last)
    if spread <= s[SWING]:
        return STILL
    mean = 0.0
    for k in range(start, last + 1):
        mean += value(s, MOTION, axis, k)
    mean /= float(last - start + 1)
    return _turns(s, axis, start, to, mean, TURNED * sqrt(spread), max(previous, int(s[MATCHED]) + 1))


def _turns(s: State, axis: int, start: int, to: int, mean: float, away: float, after: int) -> int:
    """Follow the axis from side to side; return its first turn from sample `after` on."""
    side, found = 0.0, TAKEN
    oldest = older = newest = -1
    for k in range(start, to + 1):
        x = value(s, MOTION, axis, k) - mean
        if (x > away and side <= 0.0) or (x < -away and side >= 0.0):
            if side != 0.0:
                oldest, older, newest = older, newest, k
                if found < 0 and k >= after:
                    found = k
            side = 1.0 if x > 0.0 else -1.0
    if oldest >= 0:
        s[PERIOD] = _even(float(older - oldest), float(newest - older), s[MAX_STEP])
    return found


def _even(one: float, other: float, longest: float) -> float:
    """Return the mean of two halves of a swing, 0 where they are not alike or no step's."""
    mean = 0.5 * (one + other)
    if one > EVEN * other or other > EVEN * one or mean < GRID_HZ / MOST_HZ or mean > longest:
        return 0.0
    return mean
