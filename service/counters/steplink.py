"""steplink's own counter: a small network tells walking from other motion, and the cadence is summed up, not peaks.

Ours: the documents name the learned recognition of false steps as their next step. One accelerometer, any orientation,
any place on the body, no calibration. `steplink_front` makes integers of the acceleration, `steplink_network` answers
for every 0.48 s whether somebody walks and how fast, `steplink_rhythm` finds the exact cadence by autocorrelation,
`steplink_bouts` makes steps of it. The weights are learnt by `steplink train`; their card is in the guide.

Why it is as it is, each choice measured on development recordings of subjects or sources that had not taught:

| choice | with | without |
| --- | --- | --- |
| frames just above `possible` credit half | phone walks 1.64 % | 1.81 % |
| `evidence` of 10 to 12 logits | phone handling 10 false steps/h | 30 |
| the cadence is looked for from 0.6 to 1.5 times the network's, not 0.75 to 1.33 | oxford_opt 0.5 % | 2.5 % |
| made-up arm motion without a step teaches | rehab 189/h, household 34/h | 362/h, 373/h |
| rattle and other paces are added to what teaches | phone handling 33/h, brajdic_walk 2.1 % | 71/h, 2.7 % |

Tried with a gyroscope and left out, since neither helped: gravity turned along with the angular rate (eth2022 and
eth2023 24.8 % instead of 13.8 %, phone handling 214/h instead of 0, with the same weights), and the gyroscope's
autocorrelation beside the accelerometer's (no change, or 0.2 to 0.6 points worse in its place).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_ahead as ahead
from service.counters import steplink_bouts as bouts
from service.counters import steplink_fast as fast
from service.counters import steplink_front as front
from service.counters import steplink_network as network
from service.counters import steplink_weights
from service.counters.contract import Snapshot, check_snapshot, ordered, parameter, params_hash
from service.counters.steplink_frames import Frames
from service.counters.streaming import COMPILED_FROM
from service.samples import GRID_HZ, Column, Columns, Gait, Likely, SampleBlock, Sensor, Step, Update, Verdict
from service.signals.compiled import Kernel

NAME: Final = "steplink"
VERSION: Final = 2
"""Of the state: 1 did not keep what each frame that waits proved."""

FILTER_DELAY: Final = 2
"""Samples by which the low-pass at 5 Hz lags."""
TIME_ERROR_S: Final = 0.01
"""By how much it lags more: 4 ms at a slow walk's pace, 9 at the fastest run's."""

STILL_G: Final = 0.05
"""A frame whose magnitude ranges less is rest."""

_Said = tuple[list[float], list[float], Sequence[Likely], Gait | None]
"""Of some samples: the filtered signal, rows of steps, likely ones, gait."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SteplinkParams:
    """Parameters; the defaults are the tuned ones."""

    certain: float = parameter(0.85, unit="probability", low=0.5, high=0.999, text="a frame that makes a walk certain")
    possible: float = parameter(0.4, unit="probability", low=0.05, high=0.9, text="a frame that may be of a walk")
    whole: float = parameter(0.7, unit="probability", low=0.06, high=0.99, text="a frame that credits all its steps")
    least_steps: int = parameter(4, unit="steps", low=1, high=12, text="steps that make a walk certain; all count")
    evidence: float = parameter(10.0, unit="logits", low=0, high=100, text="how sure the frames are together")
    pause: int = parameter(2, unit="frames", low=0, high=6, text="frames without walking that do not end a walk")
    patience: int = parameter(23, unit="frames", low=4, high=25, text="frames that wait to be credited, of 0.48 s each")

    def __post_init__(self) -> None:
        """Check that the probabilities rise; ParameterError names what contradicts what."""
        ordered(self, "possible", "whole")
        ordered(self, "possible", "certain")


TUNED: Final = SteplinkParams()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Built:
    """What a snapshot must have been made with."""

    params: SteplinkParams
    weights: str
    """Their digest."""


class SteplinkCounter:
    """steplink's counter over the grid; see the contract. `weights` are those in use unless others are given."""

    name = NAME
    version = VERSION
    sensors = (Sensor.ACCELEROMETER,)
    time_error_s = TIME_ERROR_S

    def __init__(self, params: SteplinkParams = TUNED, weights: network.Weights | None = None) -> None:
        self.params = params
        self.latency_s = latency_s(params)
        used = steplink_weights.in_use() if weights is None else weights
        self._built = _Built(params=params, weights=steplink_weights.digest(used))
        self._front = front.fresh()
        self._bouts = _fresh_bouts(params)
        self._frames = Frames(used, self._bouts[bouts.LOW])
        self._arrays: fast.Arrays | None = None
        """While there are some they hold the state, and `_front`, `_bouts` and the frame's rows are old."""
        self._trace = [0.0] * 16
        self._made = [0.0] * (8 * front.ROW)

    def update(self, block: SampleBlock) -> Update:
        """Count on over `block`; ValueError where it overlaps."""
        n = len(block)
        if n == 0:
            self._settle()
            likely = self._likely()
            return Update(pending=len(likely), likely=likely, gait=self._gait())
        state = self._bouts if self._arrays is None else self._arrays.bouts
        rows = [] if block.start == state[bouts.NEXT] else self._open(block)
        kernel = fast.kernel() if n > COMPILED_FROM else fast.ready()
        trace, found, likely, gait = (
            self._scan(block.acc_g, n) if kernel is None else self._feed(kernel, block.acc_g, n)
        )
        steps = _steps(rows + found) if rows or found else ()
        return Update(steps, len(likely), likely, (block.start - FILTER_DELAY) / GRID_HZ, trace, (), gait)

    def finish(self) -> Update:
        """End the stream: what waits is decided with what is there."""
        steps = _steps(self._close())
        bouts.end(self._bouts)
        self._bouts[bouts.NEXT] = -1.0
        return Update(steps=steps)

    def snapshot(self) -> Snapshot:
        """Return the whole state as plain data."""
        self._settle()
        state = {
            "front": self._front[front.CONSTANTS :],
            "bouts": self._bouts[bouts.CONSTANTS :],
            **self._frames.snapshot(),
        }
        return {"counter": self.name, "version": self.version, "params": params_hash(self._built), "state": state}

    def restore(self, state: Snapshot) -> None:
        """Take over a snapshot's state; SnapshotError where it is another counter's."""
        check_snapshot(state, name=self.name, version=self.version, params=self._built)
        self._settle()
        kept = state["state"]
        self._front[front.CONSTANTS :] = map(float, kept["front"])
        self._bouts[bouts.CONSTANTS :] = map(float, kept["bouts"])
        self._frames.restore(kept)

    def count(self, block: SampleBlock) -> NDArray[np.float64]:
        """Count a whole recording from a fresh state without making a Step of each; rows as in `steplink_bouts`."""
        if len(block) == 0:
            return np.empty((0, bouts.ROW))
        self._open(block)
        kernel, n = fast.kernel(), len(block)
        _, found, _, _ = self._scan(block.acc_g, n) if kernel is None else self._feed(kernel, block.acc_g, n)
        rows = found + self._close()
        bouts.end(self._bouts)
        self._bouts[bouts.NEXT] = -1.0
        return np.array(rows).reshape(-1, bouts.ROW)

    def read(self, rows: NDArray[np.float64]) -> tuple[Step, ...]:
        """Return the steps that `count`'s rows say."""
        return _steps(rows.ravel().tolist())

    def _open(self, block: SampleBlock) -> list[float]:
        """Begin a stretch; return the rows of the one that ended."""
        self._settle()
        awaited = self._bouts[bouts.NEXT]
        if block.start < awaited:
            raise ValueError(f"block starts at {block.start}, {int(awaited)} was next")
        rows = self._close()
        front.begin(self._front, *(float(column[0]) for column in block.acc_g))
        bouts.begin(self._bouts, float(block.start))
        self._frames.begin()
        return rows

    def _close(self) -> list[float]:
        """End the stretch: the network is told that all is still, and what it had not judged is judged."""
        self._settle()
        s = self._bouts
        if s[bouts.NEXT] < 0.0:
            return []
        first, seen = int(s[bouts.FIRST]), int(s[bouts.NEXT])
        at = max(first, seen - (seen - first) % bouts.FRAME - network.DELAY * bouts.FRAME)
        left = -(-(seen - first) // bouts.FRAME) * bouts.FRAME
        still = left // front.EVERY - (seen - first) // front.EVERY + network.DELAY * network.FRAME_ROWS
        z, c = self._frames.answers([0.0] * (still * front.ROW))
        skip = len(z) - -(-(seen - at) // bouts.FRAME)
        out = [0.0] * bouts.room(seen - at, s[bouts.WAIT])
        end = 0
        for number in range(skip, len(z)):
            n = min(bouts.FRAME, seen - at)
            end = bouts.frame(s, at, n, z[number], c[number], out, end)
            at += n
        return out[:end]

    def _scan(self, columns: Columns, n: int) -> _Said:
        """Take n samples plainly."""
        self._settle()
        if n > len(self._trace):
            self._trace, self._made = [0.0] * n, [0.0] * ((n // front.EVERY + 1) * front.ROW)
        x, y, z = map(_as_list, columns)
        made = front.scan(x, y, z, n, self._front, self._trace, self._made)
        answers = self._frames.answers(self._made[: made * front.ROW])
        out = [0.0] * bouts.room(n, self._bouts[bouts.WAIT])
        end = bouts.advance(self._bouts, self._trace, n, *answers, out)
        return self._trace[:n], out[:end], self._likely(), self._gait()

    def _feed(self, kernel: Kernel, columns: Columns, n: int) -> _Said:
        """Take n samples with the compiled kernel."""
        if self._arrays is None:
            self._arrays = fast.Arrays(self._front, self._bouts, self._frames)
        trace, found, likely, told = self._arrays.feed(kernel, columns, n)
        return (
            trace,
            found,
            [_likely(*likely[i : i + ahead.ROW]) for i in range(0, len(likely), ahead.ROW)],
            _gait(*told),
        )

    def _settle(self) -> None:
        """Have the state in lists."""
        if self._arrays is not None:
            self._front, self._bouts, self._frames.rows = self._arrays.lists()
            self._arrays = None

    def _likely(self) -> Sequence[Likely]:
        return [_likely(at, strength) for at, strength in ahead.likely(self._bouts)]

    def _gait(self) -> Gait | None:
        s = self._bouts
        if s[bouts.NEXT] < 0.0:
            return None
        return _gait(*(s[at] for at in bouts.TOLD))


def _likely(at: float, strength: float) -> Likely:
    return (at - FILTER_DELAY) / GRID_HZ, strength, True


def _gait(decided: float, z: float, moved: float, walking: float, cadence_hz: float, waiting: float) -> Gait:
    """Return what the state says of walking; its arguments are `bouts.TOLD`."""
    at_s = (decided - FILTER_DELAY) / GRID_HZ
    confidence = 1.0 / (1.0 + exp(-z))
    if walking > 0.0:
        return Gait(at_s, Verdict.WALKING, confidence, cadence_hz)
    if waiting > 0.0:
        return Gait(at_s, Verdict.PERHAPS, confidence, None)
    return Gait(at_s, Verdict.REST if moved < STILL_G else Verdict.OTHER, confidence, None)


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


def _fresh_bouts(p: SteplinkParams) -> list[float]:
    s = [0.0] * bouts.SIZE
    for at, probability in ((bouts.LOW, p.possible), (bouts.HIGH, p.certain), (bouts.FULL, p.whole)):
        s[at] = log(probability / (1.0 - probability))
    s[bouts.LEAST], s[bouts.POOL], s[bouts.EVIDENCE] = float(p.least_steps), float(p.pause), p.evidence
    s[bouts.WAITING] = float(p.patience)
    s[bouts.NEXT] = -1.0
    bouts.end(s)
    return s


def _steps(rows: Sequence[float]) -> tuple[Step, ...]:
    steps = []
    for i in range(0, len(rows), bouts.ROW):
        at, spacing, peak, valley = rows[i : i + bouts.ROW]
        interval_s = spacing / GRID_HZ if spacing > 0.0 else None
        steps.append(Step((at - FILTER_DELAY) / GRID_HZ, peak - valley, interval_s, peak, valley))
    return tuple(steps)


def _as_list(column: Column) -> list[float]:
    return column if isinstance(column, list) else [float(value) for value in column]
