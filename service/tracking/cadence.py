"""Cadence as a person reads it: steps a minute over the last few steps, nothing once they have stopped."""

from __future__ import annotations

_STEPS = 5
"""Steps averaged: two strides and a half, so that left and right weigh alike."""
_LONGEST_S = 2.0
"""A longer interval parts two bouts: slower than 30 steps a minute is no walk."""
_EXPIRES_S = 4.0
"""Steps are confirmed up to some seconds late; after this without one nobody walks."""


class Cadence:
    """Steps a minute, from the times of confirmed steps in order."""

    def __init__(self) -> None:
        self._times: list[float] = []

    def add(self, at_s: float) -> None:
        """Take a confirmed step at device time `at_s`."""
        if self._times and not 0 < at_s - self._times[-1] <= _LONGEST_S:
            self._times.clear()
        self._times = [*self._times[-_STEPS:], at_s]

    def spm(self, now_s: float) -> float | None:
        """Return the cadence at device time `now_s`; None where fewer than two steps are near."""
        times = self._times
        if len(times) < 2 or now_s - times[-1] > _EXPIRES_S:
            return None
        return 60 * (len(times) - 1) / (times[-1] - times[0])

    def snapshot(self) -> list[float]:
        """Return the state as plain data."""
        return list(self._times)

    def restore(self, state: list[float]) -> None:
        """Take over a snapshot's state."""
        self._times = list(state)
