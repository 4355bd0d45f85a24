"""Calibrations: a counter's parameters learnt from a walk, block by block while it is walked.

What is learnt is exactly what the counters' own functions (`sampled_window`, `middle_window`, `calibrated`) give on the
same samples. A walk leaves its evidence, a few numbers a step, and a conclusion is drawn from the evidence of one walk
or of several: so walks of several paces are pooled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np

from service.counters import double_threshold, gyro_zero_crossing
from service.counters.double_threshold import MOVING_SAMPLES, DoubleThresholdParams
from service.counters.gyro_zero_crossing import GyroZeroCrossingParams, true_extrema
from service.errors import LearningError
from service.samples import GRID_HZ, SampleBlock, Step

FEWEST_SPACINGS: Final = 4
"""Between the steps of one certain bout; fewer are a stumble, not a pace. Ours."""
FEWEST_SWINGS: Final = 2
"""Of each direction: two strides. Ours."""
UNEVEN: Final = 1.5
"""A walk swings as often to as fro; more than this, and one besides, are not its swings. Ours."""
STANDS_OUT: Final = 2.0
"""A threshold of less than this many times the noise of rest would let rest pass. Ours."""


class Learner(Protocol):
    """Takes a walk in blocks that go on from each other; CounterError where a sensor is missing."""

    @property
    def steps(self) -> int:
        """Steps of the walk so far, as far as they are certain."""

    def update(self, block: SampleBlock) -> None:
        """Take the next samples."""

    def finish(self) -> tuple[float, ...]:
        """End the walk; return its evidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """What evidence teaches: parameters of the counter, and a sentence for people."""

    params: Mapping[str, float | str]
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """One way to calibrate a counter. Both functions take its parameters; `conclude` raises LearningError."""

    name: str
    learner: Callable[[Any], Learner]
    conclude: Callable[[Sequence[float], Any], Lesson]
    by_steps: bool
    """Whether a walk of a set number of steps is possible, beside one of a set time."""
    shortest_s: float


class _Walk:
    """Spacings of valid steps, in samples: published mode (a)."""

    def __init__(self, params: DoubleThresholdParams) -> None:
        self._counter = double_threshold.build(double_threshold.sampling(params))
        self._steps: list[Step] = []

    @property
    def steps(self) -> int:
        return len(self._steps)

    def update(self, block: SampleBlock) -> None:
        self._steps += self._counter.update(block).steps

    def finish(self) -> tuple[float, ...]:
        self._steps += self._counter.finish().steps
        return tuple(step.interval_s * GRID_HZ for step in self._steps if step.interval_s is not None)


class _Middle:
    """Spacings in the middle of what was recorded: published mode (b). The whole recording is kept until the end."""

    def __init__(self, params: DoubleThresholdParams) -> None:
        self._params = params
        self._walk = _Walk(params)
        self._start: int | None = None
        self._axes: tuple[list[float], list[float], list[float]] = ([], [], [])

    @property
    def steps(self) -> int:
        return self._walk.steps

    def update(self, block: SampleBlock) -> None:
        if self._start is None:
            self._start = block.start
        for axis, column in zip(self._axes, block.acc_g, strict=True):
            axis.extend(map(float, column))
        self._walk.update(block)

    def finish(self) -> tuple[float, ...]:
        self._walk.finish()
        first = (len(self._axes[0]) - MOVING_SAMPLES) // 2
        if first < 0:
            raise LearningError(f"shorter than {MOVING_SAMPLES / GRID_HZ:g} s: record on before it is ended")
        x, y, z = (axis[first : first + MOVING_SAMPLES] for axis in self._axes)
        middle = _Walk(self._params)
        middle.update(SampleBlock(start=(self._start or 0) + first, acc_g=(x, y, z)))
        return middle.finish()


class _SlowestWalk:
    """Extrema after every crossing, in rad/s, valleys below zero: the calibration mode, section F."""

    def __init__(self, params: GyroZeroCrossingParams) -> None:
        self._rest_rad_s = params.rest_rad_s
        self._counter = gyro_zero_crossing.build(gyro_zero_crossing.everything(params))
        self._extrema: list[float] = []
        self._known = 0
        self._steps = 0

    @property
    def steps(self) -> int:
        if self._known != len(self._extrema):
            self._known = len(self._extrema)
            self._steps = sum(_swings(self._extrema, self._rest_rad_s))
        return self._steps

    def update(self, block: SampleBlock) -> None:
        self._take(self._counter.update(block).steps)

    def finish(self) -> tuple[float, ...]:
        self._take(self._counter.finish().steps)
        return tuple(self._extrema)

    def _take(self, steps: Sequence[Step]) -> None:
        self._extrema += (step.strength if step.lower is None else -step.strength for step in steps)


def _swings(extrema: Sequence[float], rest_rad_s: float) -> tuple[int, int]:
    """Return how many true peaks and valleys stand out of rest."""
    all_of = np.array(extrema)
    up, down = true_extrema(all_of[all_of > 0.0]), true_extrema(-all_of[all_of < 0.0])
    return int(np.sum(up > rest_rad_s)), int(np.sum(down > rest_rad_s))


def _window(spacings: Sequence[float], params: DoubleThresholdParams) -> Lesson:
    if len(spacings) < FEWEST_SPACINGS:
        raise LearningError("no walk was found: walk evenly, for ten steps or more, with the band where you wear it")
    window, mean = double_threshold.mean_window(spacings, params), sum(spacings) / len(spacings)
    halved = f", halved to {window} since it is above {params.window_limit}" if mean > params.window_limit else ""
    return Lesson(
        params={"window_mode": "fixed", "first_window": window},
        detail=f"{mean:.1f} samples ({mean / GRID_HZ:.2f} s) a step over {len(spacings)} intervals{halved}",
    )


def _thresholds(extrema: Sequence[float], params: GyroZeroCrossingParams) -> Lesson:
    up, down = _swings(extrema, params.rest_rad_s)
    if min(up, down) < FEWEST_SWINGS:
        raise LearningError("no swings to and fro were found: walk with the device where the leg or arm turns it")
    if max(up, down) > UNEVEN * min(up, down) + 1:
        raise LearningError(f"{up} swings one way and {down} the other are no even walk: walk on, evenly and slowly")
    learnt = gyro_zero_crossing.passing(np.array(extrema), params)
    if min(learnt.peak_rad_s, learnt.valley_rad_s) < STANDS_OUT * params.rest_rad_s:
        raise LearningError("the swings hardly stand out of rest: wear the device where the leg or arm turns it")
    return Lesson(
        params={"peak_rad_s": learnt.peak_rad_s, "valley_rad_s": learnt.valley_rad_s},
        detail=f"peaks from {learnt.peak_rad_s:.2g} and valleys from {learnt.valley_rad_s:.2g} rad/s on count, "
        f"learnt from {up} and {down} swings",
    )


WALK: Final = Method(name="walk", learner=_Walk, conclude=_window, by_steps=True, shortest_s=5.0)
MIDDLE: Final = Method(name="middle", learner=_Middle, conclude=_window, by_steps=False, shortest_s=10.0)
SLOWEST_WALK: Final = Method(
    name="slowest_walk", learner=_SlowestWalk, conclude=_thresholds, by_steps=True, shortest_s=5.0
)
