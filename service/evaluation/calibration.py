"""`--calibrate`: what a counter learns before it counts recordings, by its own methods.

`middle` learns from the 300 samples in the middle of each recording, the double threshold's published mode for
recordings; one without a walk there is counted with the parameters as they are. A file is a calibration walk, from
which each counter that can learn does so once, in the way it lists first: the double threshold the window of that walk,
the zero-crossing counter its thresholds. (On the recording that is counted the latter would find what it looks for.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from service.counters import registry
from service.counters.double_threshold import MOVING_SAMPLES
from service.counters.learning import MIDDLE, Lesson, Method
from service.errors import LearningError, ParameterError
from service.evaluation.counting import part, pieces
from service.evaluation.rows import Choice
from service.samples import SampleBlock

EACH_MIDDLE: Final = MIDDLE.name


def from_middle(chosen: Sequence[Choice]) -> list[Choice]:
    """Return `chosen`, those that can to learn from each recording's middle; ParameterError where none can."""
    can = [EACH_MIDDLE in registry.kind(choice.counter).calibrations for choice in chosen]
    if not any(can):
        raise _nobody_learns(EACH_MIDDLE, chosen)
    return [replace(choice, from_middle=able) for choice, able in zip(chosen, can, strict=True)]


def from_walk(chosen: Sequence[Choice], walk: SampleBlock, shown: str) -> list[Choice]:
    """Return `chosen`, those that can taught by `walk`.

    ParameterError where none can or the walk teaches nothing, CounterError where it lacks a sensor.
    """
    ways = [next(iter(registry.kind(choice.counter).calibrations.values()), None) for choice in chosen]
    if not any(ways):
        raise _nobody_learns(shown, chosen)
    try:
        return [choice if way is None else _taught(choice, way, walk) for choice, way in zip(chosen, ways, strict=True)]
    except LearningError as error:
        raise ParameterError("calibrate", shown, str(error)) from error


def taught(choice: Choice, block: SampleBlock) -> Choice:
    """Return `choice` as it counts `block`: with what its middle teaches, where that was asked for and is a walk."""
    if not choice.from_middle:
        return choice
    first = max((len(block) - MOVING_SAMPLES) // 2, 0)
    try:
        return _taught(choice, MIDDLE, part(block, first, first + MOVING_SAMPLES, as_lists=True))
    except LearningError:
        return choice


def _taught(choice: Choice, way: Method, walk: SampleBlock) -> Choice:
    lesson = _lesson(choice, way, walk)
    return replace(choice, overrides={**choice.overrides, **lesson.params}, calibration=f"{way.name}: {lesson.detail}")


def _lesson(choice: Choice, way: Method, walk: SampleBlock) -> Lesson:
    params = registry.parameters(choice.counter, choice.preset, choice.overrides)
    learner = way.learner(params)
    for piece in pieces(walk):
        learner.update(piece)
    return way.conclude(learner.finish(), params)


def _nobody_learns(way: str, chosen: Sequence[Choice]) -> ParameterError:
    can = (kind.name for kind in registry.COUNTERS.values() if kind.calibrations)
    names = ", ".join(choice.counter for choice in chosen)
    return ParameterError("calibrate", way, f"{names} cannot learn so; of all, {', '.join(can)} learn from a walk")
