"""What a simulated bracelet plays: a recording or a synthetic walker, as an even stream of samples.

Sample k of a source lies at k / rate_hz seconds after its start, so time and truth need no clock; how fast they are
played is the bracelet's affair. A sample has x, y, z of each of the source's sensors: g, rad/s, µT.
"""

from __future__ import annotations

import bisect
from collections.abc import Collection
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from device_sim.gait import Walker
from service.errors import ParameterError
from service.recordings import Recording, evenly_spaced, stated_rate_hz
from service.samples import ACCELEROMETER_ONLY, Sensor, Sensors

__all__ = ["RecordingSource", "Samples", "Source", "WalkerSource"]

Samples = NDArray[np.float64]

WalkerSource = Walker
"""A walker is a source as it stands; the name says so where both kinds are chosen from."""


class Source(Protocol):
    """An even stream of samples whose true steps may be known."""

    @property
    def sensors(self) -> Sensors:
        """What a sample holds, in this order."""

    @property
    def rate_hz(self) -> float:
        """Samples per second, the same from start to end."""

    def read(self, n: int) -> Samples:
        """Return the next n samples, three columns a sensor; fewer at the end, then none."""

    def true_steps_until(self, t_s: float) -> int | None:
        """Return the steps taken up to `t_s` seconds after the start; None where nobody knows."""


class RecordingSource:
    """A recording laid on even times by linear interpolation, once or for ever.

    `rate_hz` is the recording's own, in whole hundredths, unless another is asked for. Of the `sensors` asked for,
    those that the recording has are played. With `loop`, time and truth go on where the recording begins again. Where
    only the number of steps is known, they are all credited at the end of each turn.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        loop: bool = False,
        rate_hz: float | None = None,
        sensors: Collection[Sensor] = ACCELEROMETER_ONLY,
    ) -> None:
        self._rate_hz = stated_rate_hz(recording) if rate_hz is None else rate_hz
        if not 0 < self._rate_hz < float("inf"):
            raise ParameterError("rate_hz", rate_hz, "a rate above 0 is wanted")
        self._loop = loop
        columns = zip(Sensor, (recording.acc_g, recording.gyro_rad_s, recording.mag_ut), strict=True)
        played = {sensor: values for sensor, values in columns if values is not None and sensor in sensors}
        self._sensors = tuple(played)
        self._samples = np.hstack([evenly_spaced(recording, values, self._rate_hz) for values in played.values()])
        self._turn_s = len(self._samples) / self._rate_hz
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

    @property
    def sensors(self) -> Sensors:
        """What a sample holds."""
        return self._sensors

    def read(self, n: int) -> Samples:
        """Return the next n samples; fewer at the end, then none, unless it loops."""
        index = np.arange(self._next, self._next + n)
        index = index % len(self._samples) if self._loop else index[index < len(self._samples)]
        self._next += len(index)
        return self._samples[index]

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
