"""steplink's own counter: a small network tells walking from other motion, and the cadence is summed up, not peaks.

Ours: the documents name the learned recognition of false steps as their next step. One accelerometer, any orientation,
any place on the body, no calibration. `steplink_front` makes integers of the acceleration, `steplink_network` answers
for every 0.48 s whether somebody walks and how fast, `steplink_rhythm` finds the exact cadence by autocorrelation,
`steplink_bouts` makes steps of it. The weights are learnt by `steplink train`; their card is in the guide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from math import exp, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_bouts as bouts
from service.counters import steplink_front as front
from service.counters import steplink_network as network
from service.counters import steplink_rhythm as rhythm
from service.counters.contract import Snapshot, check_snapshot, ordered, parameter, params_hash
from service.counters.streaming import COMPILED_FROM
from service.samples import GRID_HZ, Column, Columns, Gait, Likely, SampleBlock, Sensor, Step, Update, Verdict
from service.signals.compiled import compiled

NAME: Final = "steplink"
VERSION: Final = 1

FILTER_DELAY: Final = 2
"""Samples by which the low-pass at 5 Hz lags."""

STILL_G: Final = 0.05
"""A frame whose magnitude ranges less is rest."""

FRAMES_AT_ONCE: Final = 64
"""Of a long block: more, and what the network computes with leaves the cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SteplinkParams:
    """Parameters; the defaults are the tuned ones."""

    certain: float = parameter(0.9, unit="probability", low=0.5, high=0.999, text="a frame that makes a walk certain")
    possible: float = parameter(0.4, unit="probability", low=0.05, high=0.9, text="a frame that may be of a walk")
    whole: float = parameter(0.7, unit="probability", low=0.06, high=0.99, text="a frame that credits all its steps")
    least_steps: int = parameter(4, unit="steps", low=1, high=12, text="steps that make a walk certain; all count")
    evidence: float = parameter(0.0, unit="logits", low=0, high=100, text="how sure the frames are together")
    pause: int = parameter(2, unit="frames", low=0, high=6, text="frames without walking that do not end a walk")
    patience: int = parameter(23, unit="frames", low=4, high=25, text="frames that wait to be credited, of 0.48 s each")

    def __post_init__(self) -> None:
        """Check that the probabilities rise; ParameterError names what contradicts what."""
        ordered(self, "possible", "whole")
        ordered(self, "possible", "certain")


TUNED: Final = SteplinkParams()


class SteplinkCounter:
    """steplink's counter over the grid; see the contract. `weights` are the shipped ones unless others are given."""

    name = NAME
    version = VERSION
    sensors = (Sensor.ACCELEROMETER,)
    time_error_s = 0.0

    def __init__(self, params: SteplinkParams = TUNED, weights: network.Weights | None = None) -> None:
        self.params = params
        self.latency_s = latency_s(params)
        self._network = network.Stream(shipped() if weights is None else weights)
        self._front = front.fresh()
        self._bouts = _fresh_bouts(params)
        self._rows: list[float] = []
        """Rows of the frame that is not complete."""
        self._rhythm = rhythm.Windows()
        self._trace = [0.0] * 16
        self._made = [0.0] * (8 * front.ROW)

    def update(self, block: SampleBlock) -> Update:
        """Count on over `block`; ValueError where it overlaps."""
        n = len(block)
        if n == 0:
            pending, likely = self._likely()
            return Update(pending=pending, likely=likely, gait=self._gait())
        rows = [] if block.start == self._bouts[bouts.NEXT] else self._open(block)
        if n > COMPILED_FROM:
            trace, found = self._scan_arrays(block.acc_g, n)
        else:
            trace, found = self._scan_lists(block.acc_g, n)
        steps = _steps(rows + found) if rows or found else ()
        pending, likely = self._likely()
        return Update(steps, pending, likely, (block.start - FILTER_DELAY) / GRID_HZ, trace, (), self._gait())

    def finish(self) -> Update:
        """End the stream: what waits is decided with what is there."""
        steps = _steps(self._close())
        bouts.end(self._bouts)
        self._bouts[bouts.NEXT] = -1.0
        return Update(steps=steps)

    def snapshot(self) -> Snapshot:
        """Return the whole state as plain data."""
        state = {
            "front": self._front[front.CONSTANTS :],
            "bouts": self._bouts[bouts.CONSTANTS :],
            "past": self._network.past.tolist(),
            "rows": list(map(float, self._rows)),
            "rhythm": self._rhythm.past.ravel().tolist(),
        }
        return {"counter": self.name, "version": self.version, "params": params_hash(self.params), "state": state}

    def restore(self, state: Snapshot) -> None:
        """Take over a snapshot's state; SnapshotError where it is another counter's."""
        check_snapshot(state, name=self.name, version=self.version, params=self.params)
        kept = state["state"]
        self._front[front.CONSTANTS :] = map(float, kept["front"])
        self._bouts[bouts.CONSTANTS :] = map(float, kept["bouts"])
        self._network.past = np.array(kept["past"], np.float32)
        self._rows = list(map(float, kept["rows"]))
        self._rhythm.past = np.array(kept["rhythm"]).reshape(rhythm.COLUMNS, -1)

    def count(self, block: SampleBlock) -> NDArray[np.float64]:
        """Count a whole recording from a fresh state without making a Step of each; rows as in `steplink_bouts`."""
        if len(block) == 0:
            return np.empty((0, bouts.ROW))
        self._open(block)
        _, found = self._scan_arrays(block.acc_g, len(block))
        rows = found + self._close()
        bouts.end(self._bouts)
        self._bouts[bouts.NEXT] = -1.0
        return np.array(rows).reshape(-1, bouts.ROW)

    def read(self, rows: NDArray[np.float64]) -> tuple[Step, ...]:
        """Return the steps that `count`'s rows say."""
        return _steps(rows.ravel().tolist())

    def _open(self, block: SampleBlock) -> list[float]:
        """Begin a stretch; return the rows of the one that ended."""
        awaited = self._bouts[bouts.NEXT]
        if block.start < awaited:
            raise ValueError(f"block starts at {block.start}, {int(awaited)} was next")
        rows = self._close()
        front.begin(self._front, *(float(column[0]) for column in block.acc_g))
        bouts.begin(self._bouts, float(block.start))
        self._network.past = network.NOTHING
        self._rows = []
        self._rhythm.past = np.zeros_like(self._rhythm.past)
        return rows

    def _close(self) -> list[float]:
        """End the stretch: the network is told that all is still, and what it had not judged is judged."""
        s = self._bouts
        if s[bouts.NEXT] < 0.0:
            return []
        first, seen = int(s[bouts.FIRST]), int(s[bouts.NEXT])
        at = max(first, seen - (seen - first) % bouts.FRAME - network.DELAY * bouts.FRAME)
        left = -(-(seen - first) // bouts.FRAME) * bouts.FRAME
        still = left // front.EVERY - (seen - first) // front.EVERY + network.DELAY * network.FRAME_ROWS
        z, c = self._answers(np.zeros(still * front.ROW))
        skip = len(z) - -(-(seen - at) // bouts.FRAME)
        out = [0.0] * _room(seen - at, s)
        end = 0
        for number in range(skip, len(z)):
            n = min(bouts.FRAME, seen - at)
            end = bouts.frame(s, at, n, z[number], c[number], out, end)
            at += n
        return out[:end]

    def _scan_lists(self, columns: Columns, n: int) -> tuple[list[float], list[float]]:
        if n > len(self._trace):
            self._trace, self._made = [0.0] * n, [0.0] * ((n // front.EVERY + 1) * front.ROW)
        x, y, z = map(_as_list, columns)
        made = front.scan(x, y, z, n, self._front, self._trace, self._made)
        answers = self._answers(self._made[: made * front.ROW])
        out = [0.0] * _room(n, self._bouts)
        end = bouts.advance(self._bouts, self._trace, n, *answers, out)
        return self._trace[:n], out[:end]

    def _scan_arrays(self, columns: Columns, n: int) -> tuple[list[float], list[float]]:
        x, y, z = (np.ascontiguousarray(column, dtype=np.float64) for column in columns)
        trace, made = np.empty(n), np.empty((n // front.EVERY + 1) * front.ROW)
        state = np.array(self._front)
        count = compiled(front.scan)(x, y, z, n, state, trace, made)
        self._front = state.tolist()
        state, out = np.array(self._bouts), np.empty(_room(n, self._bouts))
        answers = [np.asarray(values) for values in self._answers(made[: count * front.ROW])]
        end = compiled(bouts.advance)(state, trace, n, *answers, out)
        self._bouts = state.tolist()
        return trace.tolist(), out[:end].tolist()

    def _answers(self, made: Sequence[float] | NDArray[np.float64]) -> tuple[Sequence[float], Sequence[float]]:
        """Take rows of the front end; return logit and cadence for each frame that they complete."""
        frame = network.FRAME_ROWS * front.ROW
        if len(self._rows) + len(made) < frame:
            self._rows += list(made)
            return (), ()
        rows = np.concatenate((self._rows, made)) if isinstance(made, np.ndarray) else np.array([*self._rows, *made])
        frames = len(rows) // frame
        self._rows = rows[frames * frame :].tolist()
        whole = rows[: frames * frame].reshape(-1, front.ROW)
        if frames <= FRAMES_AT_ONCE:
            return self._judge(whole)
        size = FRAMES_AT_ONCE * network.FRAME_ROWS
        parts = [self._judge(whole[first : first + size]) for first in range(0, len(whole), size)]
        return [z for part, _ in parts for z in part], [c for _, part in parts for c in part]

    def _judge(self, rows: NDArray[np.float64]) -> tuple[list[float], list[float]]:
        """Return logit and cadence for whole frames of rows."""
        logits = self._network.run(rows[:, : front.SENSED]).tolist()
        walking = [z * rhythm.LOGIT for z, _ in logits]
        pace = [rhythm.cadence_hz(z) for _, z in logits]
        seen = self._rhythm.take(rows[:, front.SENSED :])
        low = self._bouts[bouts.LOW]
        perhaps = [i for i, z in enumerate(walking) if z > low]
        if perhaps:
            r = rhythm.correlations(seen if len(seen) == 1 else seen[perhaps])
            for i, exact in zip(perhaps, rhythm.refined_hz([pace[i] for i in perhaps], r), strict=True):
                pace[i] = exact
        return walking, pace

    def _likely(self) -> tuple[int, Sequence[Likely]]:
        found = bouts.likely(self._bouts)
        if not found:
            return 0, ()
        return len(found), [((at - FILTER_DELAY) / GRID_HZ, size, passes) for at, size, passes in found]

    def _gait(self) -> Gait | None:
        s = self._bouts
        if s[bouts.NEXT] < 0.0:
            return None
        at_s = (s[bouts.DECIDED] - FILTER_DELAY) / GRID_HZ
        confidence = 1.0 / (1.0 + exp(-s[bouts.Z]))
        if s[bouts.WALKING] > 0.0:
            return Gait(at_s, Verdict.WALKING, confidence, s[bouts.CADENCE])
        if s[bouts.WAIT] > 0.0:
            return Gait(at_s, Verdict.PERHAPS, confidence, None)
        return Gait(at_s, Verdict.REST if s[bouts.MOVED] < STILL_G else Verdict.OTHER, confidence, None)


def build(params: SteplinkParams = TUNED) -> SteplinkCounter:
    """Return steplink's own counter; its unit is g.

    >>> build().update(SampleBlock(start=0, acc_g=([0.0] * 9, [0.0] * 9, [1.0] * 9))).steps
    ()
    """
    return SteplinkCounter(params)


def latency_s(p: SteplinkParams) -> float:
    """Return the longest time from a step to its confirmation: all that may wait, a frame, and its answer."""
    frames = p.patience + 1 + network.DELAY
    return (frames * bouts.FRAME + FILTER_DELAY) / GRID_HZ


@cache
def shipped() -> network.Weights:
    """Return the weights that come with the package."""
    with resources.files("service.counters").joinpath("steplink_weights.npz").open("rb") as file, np.load(file) as kept:
        return network.weights_of(dict(kept))


def _fresh_bouts(p: SteplinkParams) -> list[float]:
    s = [0.0] * bouts.SIZE
    for at, probability in ((bouts.LOW, p.possible), (bouts.HIGH, p.certain), (bouts.FULL, p.whole)):
        s[at] = log(probability / (1.0 - probability))
    s[bouts.LEAST], s[bouts.POOL], s[bouts.EVIDENCE] = float(p.least_steps), float(p.pause), p.evidence
    s[bouts.WAITING] = float(p.patience)
    s[bouts.NEXT] = -1.0
    bouts.end(s)
    return s


def _room(n: int, s: Sequence[float]) -> int:
    """Return how many floats the rows of n samples may take: four steps a second, and what waits."""
    return bouts.ROW * int((n + (s[bouts.WAIT] + network.DELAY + 2) * bouts.FRAME) / 10 + 8)


def _steps(rows: Sequence[float]) -> tuple[Step, ...]:
    steps = []
    for i in range(0, len(rows), bouts.ROW):
        at, spacing, peak, valley = rows[i : i + bouts.ROW]
        interval_s = spacing / GRID_HZ if spacing > 0.0 else None
        steps.append(Step((at - FILTER_DELAY) / GRID_HZ, peak - valley, interval_s, peak, valley))
    return tuple(steps)


def _as_list(column: Column) -> list[float]:
    return column if isinstance(column, list) else [float(value) for value in column]
