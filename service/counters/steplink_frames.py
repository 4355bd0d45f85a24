"""From rows of the front end to answers: frame by frame to the network, and where somebody may walk to the rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_front as front
from service.counters import steplink_network as network
from service.counters import steplink_rhythm as rhythm

AT_ONCE: Final = 64
"""Of many frames: with more, what the network computes with leaves the cache."""

_FRAME: Final = network.FRAME_ROWS * front.ROW

Answers = tuple[Sequence[float], Sequence[float]]
"""Logit of walking and cadence in Hz, one of each a frame."""


class Frames:
    """What one stream's network and rhythm remember; `low` is the logit above which the rhythm is looked for."""

    def __init__(self, weights: network.Weights, low: float) -> None:
        self.network = network.Stream(weights)
        self.rhythm = rhythm.Windows()
        self.rows: list[float] = []
        """Rows of the frame that is not complete."""
        self._low = low

    def begin(self) -> None:
        """Open a stretch: nothing has been before."""
        self.network.past = network.NOTHING
        self.rhythm.past = rhythm.NOTHING
        self.rows = []

    def snapshot(self) -> dict[str, Any]:
        """Return what is remembered, as plain data."""
        rows = list(map(float, self.rows))
        return {"past": self.network.past.tolist(), "rows": rows, "rhythm": self.rhythm.past.ravel().tolist()}

    def restore(self, kept: dict[str, Any]) -> None:
        """Take over what a snapshot remembers."""
        self.network.past = np.array(kept["past"], np.float32)
        self.rhythm.past = np.array(kept["rhythm"]).reshape(rhythm.COLUMNS, -1)
        self.rows = list(map(float, kept["rows"]))

    def answers(self, made: list[float]) -> Answers:
        """Take rows; return the answer to each frame that they complete."""
        rows = self.rows + made
        frames = len(rows) // _FRAME
        if frames == 0:
            self.rows = rows
            return (), ()
        self.rows = rows[frames * _FRAME :]
        whole = np.array(rows[: frames * _FRAME]).reshape(-1, front.ROW)
        if frames <= AT_ONCE:
            return self._judge(whole)
        size = AT_ONCE * network.FRAME_ROWS
        parts = [self._judge(whole[first : first + size]) for first in range(0, len(whole), size)]
        return [z for part, _ in parts for z in part], [c for _, part in parts for c in part]

    def _judge(self, rows: NDArray[np.float64]) -> tuple[list[float], list[float]]:
        logits = self.network.run(rows[:, : front.SENSED]).tolist()
        walking = [z * rhythm.LOGIT for z, _ in logits]
        pace = [rhythm.cadence_hz(z) for _, z in logits]
        seen = self.rhythm.take(rows[:, front.SENSED :])
        perhaps = [i for i, z in enumerate(walking) if z > self._low]
        if perhaps:
            r = rhythm.correlations(seen if len(seen) == 1 else seen[perhaps])
            for i, exact in zip(perhaps, rhythm.refined_hz([pace[i] for i in perhaps], r), strict=True):
                pace[i] = exact
        return walking, pace
