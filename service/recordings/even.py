"""A recording as a device would have sent it: samples evenly spaced, at a rate that a device can state.

The emulated bracelet plays these samples and the evaluation counts them, so both see the same numbers.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import Floats, Recording
from service.samples import GRID_HZ

MAX_SAMPLES: Final = 50_000_000
"""About six days at 100 Hz; one wrong stamp must not fill the memory with samples that nobody measured."""


UNEVEN_BY: Final = 0.1
"""A spacing that differs by more than this share of the nominal one is uneven."""
UNEVEN_SHARE: Final = 0.001
"""A recording with more uneven spacings than this was not sampled at one rate."""


def stated_rate_hz(recording: Recording) -> float:
    """Return the rate a device would state for the recording, in whole hundredths of Hz.

    The nominal one; GRID_HZ where the stamps are uneven, so that samples are interpolated once, from where they were
    measured, and not twice.
    """
    uneven = np.abs(np.diff(recording.t_s) * recording.rate_hz - 1) > UNEVEN_BY
    if uneven.mean() > UNEVEN_SHARE:
        return float(GRID_HZ)
    return max(1, round(recording.rate_hz * 100)) / 100


def evenly_spaced(recording: Recording, values: Floats, rate_hz: float) -> Floats:
    """Return `values` (n×3, beside the recording's times) at k / rate_hz seconds after its first sample.

    Linear between neighbours, over holes too; RecordingError where that would be more than MAX_SAMPLES.
    """
    t_s = recording.t_s - recording.t_s[0]
    if t_s[-1] * rate_hz >= MAX_SAMPLES:
        why = f"it spans {t_s[-1] / 86_400:.1f} days at {rate_hz:g} Hz; is a stamp wrong? Else cut it into parts"
        raise RecordingError(str(recording.path), why)
    # A sample that rounding puts a hair behind the last one still belongs to the recording.
    grid_s = np.arange(int(t_s[-1] * rate_hz + 1e-6) + 1) / rate_hz
    return np.column_stack([np.interp(grid_s, t_s, values[:, axis]) for axis in range(3)])
