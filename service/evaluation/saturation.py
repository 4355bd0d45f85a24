"""Whether a sensor's range ended below what it felt, so that crests are cut off and steps may be missing.

An axis whose range ends gathers samples at the end, each a little off for noise and calibration; each axis, and each of
its ends, has its own. A crest that is whole has few: the top of any smooth one lies within a twentieth of its largest
value for 1/(√2 − 1) = 2.4 times as long as within the next twentieth.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.recordings import Recording

ENDS_FROM_G: Final = 1.47
"""No sensor's range ends below 1.5 g; and a coarse one at rest repeats itself at 1 g."""

BAND: Final = 0.05
"""Samples this near the end, as a share of it, are at it. Ours: two axes of one sensor at ±2 g end at 2.00 and 2.08."""

PILE: Final = 4.0
"""More than so many times the samples of the band below are no crest. Ours, well above 2.4."""

FEWEST: Final = 10
"""Samples that make a pile. Ours: one blow has fewer."""

EQUAL_SAMPLES: Final = 3
"""As many samples in a row, all equal to the largest, are the end of a range without any noise."""


def saturated(recording: Recording) -> bool:
    """Tell whether an axis of the accelerometer was at an end of its range."""
    return any(_at_end(sign * column) for column in recording.acc_g.T for sign in (1.0, -1.0))


def _at_end(towards_g: NDArray[np.float64]) -> bool:
    end_g = towards_g.max()
    if end_g < ENDS_FROM_G:
        return False
    at_end = int(np.count_nonzero(towards_g >= (1 - BAND) * end_g))
    below = int(np.count_nonzero(towards_g >= (1 - 2 * BAND) * end_g)) - at_end
    return (at_end >= FEWEST and at_end > PILE * below) or _longest_run(towards_g == end_g) >= EQUAL_SAMPLES


def _longest_run(mask: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))
