"""What the bracelet tells as Running Speed and Cadence: the wearer's cadence, and a speed made of it.

Cadence is that of the step register's last seconds. A bracelet knows no stride: speed is cadence times a usual step,
and it runs from a cadence on at which nobody walks. Both are figures to be shown, not measured.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from service.wearables.rsc import Measurement

WINDOW_S: Final = 5.0
RUNNING_SPM: Final = 140
WALK_STEP_M: Final = 0.7
RUN_STEP_M: Final = 1.0


class Pace:
    """Cadence over the last seconds of a step count."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def take(self, at_s: float, steps: int) -> None:
        """Note the register at a device time; where either has begun anew, so does this."""
        if self._seen and (at_s < self._seen[-1][0] or steps < self._seen[-1][1]):
            self._seen.clear()
        self._seen.append((at_s, steps))
        while len(self._seen) > 2 and self._seen[1][0] <= at_s - WINDOW_S:
            self._seen.popleft()

    def measurement(self) -> Measurement:
        """Return what is told now."""
        if len(self._seen) < 2 or self._seen[-1][0] <= self._seen[0][0]:
            return Measurement(speed_m_s=0.0, cadence_spm=0)
        (since_s, before), (at_s, steps) = self._seen[0], self._seen[-1]
        spm = 60 * (steps - before) / (at_s - since_s)
        running = spm >= RUNNING_SPM
        step_m = RUN_STEP_M if running else WALK_STEP_M
        return Measurement(speed_m_s=spm / 60 * step_m, cadence_spm=round(spm), running=running)
