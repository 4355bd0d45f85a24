"""What a simulated bracelet plays: a recording or a synthetic walker, as an even stream of samples in g.

Sample k of a source lies at k / rate_hz seconds after its start, so time and truth need no clock; how fast they are
played is the bracelet's affair.
"""

from __future__ import annotations

import bisect
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from device_sim.gait import Walker
from service.errors import ParameterError
from service.recordings import Recording, evenly_spaced, stated_rate_hz

__all__ = ["RecordingSource", "Samples", "Source", "WalkerSource"]

Samples = NDArray[np.float64]

WalkerSource = Walker
"""A walker is a source as it stands; the name says so where both kinds are chosen from."""


class Source(Protocol):
    """An even stream of acceleration whose true steps may be known."""

    @property
    def rate_hz(self) -> float:
        """Samples per second, the same from start to end."""

    def read(self, n: int) -> Samples:
        """Return the next n×3 samples in g; fewer at the end, then none."""

    def true_steps_until(self, t_s: float) -> int | None:
        """Return the steps taken up to `t_s` seconds after the start; None where nobody knows."""


class RecordingSource:
    """A recording laid on even times by linear interpolation, once or for ever.

    `rate_hz` is the recording's own, in whole hundredths, unless another is asked for. With `loop`, time and truth go
    on where the recording begins again. Where only the number of steps is known, they are all credited at the end of
    each turn.
    """

    def __init__(self, recording: Recording, *, loop: bool = False, rate_hz: float | None = None) -> None:
        self._rate_hz = stated_rate_hz(recording) if rate_hz is None else rate_hz
        if not 0 < self._rate_hz < float("inf"):
            raise ParameterError("rate_hz", rate_hz, "a rate above 0 is wanted")
        self._loop = loop
        self._acc_g = evenly_spaced(recording, recording.acc_g, self._rate_hz)
        self._turn_s = len(self._acc_g) / self._rate_hz
        self._true_steps = recording.true_steps
        self._step_t_s: list[float] | None = None
        if recording.step_t_s is not None:
            self._step_t_s = (recording.step_t_s - recording.t_s[0]).tolist()
            self._true_steps = len(self._step_t_s)
        self._next = 0

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return self._rate_hz

    def read(self, n: int) -> Samples:
        """Return the next n×3 samples in g; fewer at the end, then none, unless it loops."""
        index = np.arange(self._next, self._next + n)
        index = index % len(self._acc_g) if self._loop else index[index < len(self._acc_g)]
        self._next += len(index)
        return self._acc_g[index]

    def true_steps_until(self, t_s: float) -> int | None:
        """Return the steps up to `t_s`; None where the recording has no true number."""
        if self._true_steps is None:
            return None
        turns = int(t_s // self._turn_s) if t_s > 0 else 0
        if not self._loop:
            turns = min(turns, 1)
        within_s = t_s - turns * self._turn_s
        in_turn = 0
        if self._step_t_s is not None and (self._loop or not turns):
            in_turn = bisect.bisect_right(self._step_t_s, within_s)
        return turns * self._true_steps + in_turn
