"""The bracelet's own step register, as a sensor chip has one beside its samples.

Where the source knows the true steps (a walker, an annotated recording) the register shows them: a counter that never
errs. Where nobody knows, it counts as the simplest chips do: once each time the strength of acceleration rises over
`RISE_G` after it has been under `REST_G`, and at most every `HOLD_S`. It is for comparing, not for counting by.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from device_sim.rated import Rated
from device_sim.source import Samples

RISE_G: Final = 1.2
REST_G: Final = 1.05
HOLD_S: Final = 0.3


class StepRegister:
    """Counts what `source` is read for, since the last `clear`."""

    def __init__(self, source: Rated) -> None:
        self._source = source
        self._counted = 0
        self._before = 0
        self._resting = True
        self._held_s = 0.0
        self._knows = source.true_steps() is not None

    @property
    def steps(self) -> int:
        """Steps since the last clear."""
        return self._total() - self._before

    def clear(self) -> None:
        """Begin at 0."""
        self._before = self._total()

    def take(self, samples: Samples) -> None:
        """Count what has been read, where the source does not know better."""
        if self._knows:
            return
        for strength_g in np.linalg.norm(samples[:, :3], axis=1).tolist():
            self._held_s = max(0.0, self._held_s - 1 / self._source.rate_hz)
            if strength_g < REST_G:
                self._resting = True
            elif strength_g > RISE_G and self._resting and self._held_s <= 0:
                self._counted += 1
                self._resting, self._held_s = False, HOLD_S

    def _total(self) -> int:
        known = self._source.true_steps()
        return self._counted if known is None else known
