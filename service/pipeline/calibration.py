"""A calibration: one recording of a device's stream, and what a counter learnt of it.

It is fed every notice of the device's session and needs no clock: a walk of N steps ends when N are counted, a timed
one when so much device time is recorded. Whatever breaks the recording ends it as failed, with a sentence that says
what to do, for a window learnt of half a walk would be wrong in silence.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from service.counters import registry
from service.counters.learning import Lesson, Method
from service.errors import CounterError, LearningError, NotNowError, ParameterError
from service.events import Gap, Gridded, Rebooted
from service.pipeline.lifecycle import State as LinkState
from service.pipeline.lineup import CounterChoice
from service.pipeline.notices import Notice, StateChanged
from service.samples import GRID_HZ, SampleBlock

LONGEST_S: Final = 600.0
"""Of a recording: ten minutes, at most 3 MB."""
STEPS: Final = (10, 1000)
"""Fewest and most steps of a walk."""


class State(StrEnum):
    """Where a calibration stands; the last two are final."""

    RECORDING = "recording"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is to be recorded: exactly one of `steps` and `seconds` ends it. Checked when it is made.

    `choice` is how the counter runs on the device: the walk is counted with its parameters.
    """

    choice: CounterChoice
    method: str
    pace: str | None = None
    steps: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        way = self.way
        if (self.steps is None) == (self.seconds is None):
            raise ParameterError("steps", self.steps, "exactly one of steps and seconds says how long the walk is")
        if self.steps is not None and not way.by_steps:
            raise ParameterError("steps", self.steps, f"{way.name} takes seconds, not steps")
        if self.steps is not None and not STEPS[0] <= self.steps <= STEPS[1]:
            raise ParameterError("steps", self.steps, f"from {STEPS[0]} to {STEPS[1]}")
        if self.seconds is not None and not way.shortest_s <= self.seconds <= LONGEST_S:
            raise ParameterError("seconds", self.seconds, f"from {way.shortest_s:g} to {LONGEST_S:g} s")

    @property
    def way(self) -> Method:
        """The counter's method."""
        return registry.kind(self.choice.name).calibration(self.method)

    @property
    def params(self) -> Any:  # noqa: ANN401  # each counter has its own
        """The counter's parameters."""
        return registry.parameters(self.choice.name, self.choice.preset, self.choice.overrides)


class Calibration:
    """One recording and its lesson."""

    def __init__(self, plan: Plan, *, number: int, began_ns: int) -> None:
        self.plan = plan
        self.number = number
        self.state = State.RECORDING
        self.began_ns = began_ns
        self.ended_ns: int | None = None
        self.samples = 0
        self.reason: str | None = None
        """Why it failed, and what to do."""
        self.lesson: Lesson | None = None
        self.evidence: tuple[float, ...] = ()
        self._learner = plan.way.learner(plan.params)

    @property
    def steps(self) -> int:
        """Steps counted so far."""
        return self._learner.steps

    @property
    def seconds(self) -> float:
        """Device time recorded so far."""
        return self.samples / GRID_HZ

    def take(self, notice: Notice) -> None:
        """Take the next notice of the device's session."""
        if self.state is not State.RECORDING:
            return
        match notice.event:
            case Gridded(block=block):
                self._record(block, notice.at_ns)
            case Gap(filled=False) as gap if self.samples:
                lost_s = gap.to_s - gap.from_s
                self._fail(f"{lost_s:.1f} s of samples are missing: stay near the receiver and repeat", notice.at_ns)
            case Rebooted() if self.samples:
                self._fail("the device has started again: repeat the walk", notice.at_ns)
            case StateChanged(state=state, reason=why) if state is not LinkState.STREAMING:
                because = f" ({why})" if why else ""
                self._fail(f"the device is {state.value}{because}: connect it and repeat the walk", notice.at_ns)
            case _:
                pass

    def finish(self, at_ns: int) -> None:
        """End it with what is there; NotNowError where it has ended."""
        if self.state is not State.RECORDING:
            raise NotNowError(f"calibration {self.number} is {self.state.value}: begin another one")
        try:
            self.evidence = self._learner.finish()
            lesson = self.plan.way.conclude(self.evidence, self.plan.params)
        except LearningError as fault:
            self._fail(str(fault), at_ns)
        else:
            self._end(State.DONE, at_ns, lesson=lesson)

    def _record(self, block: SampleBlock, at_ns: int) -> None:
        if len(block) == 0:
            return
        try:
            self._learner.update(block)
        except CounterError as fault:
            self._fail(str(fault), at_ns)
            return
        self.samples += len(block)
        wanted = self.plan
        if wanted.seconds is not None:
            if self.seconds >= wanted.seconds:
                self.finish(at_ns)
        elif self.steps >= (wanted.steps or 0):
            self.finish(at_ns)
        elif self.seconds >= LONGEST_S:
            self._fail(
                f"only {self.steps} of {wanted.steps} steps were counted in {LONGEST_S:g} s: "
                "walk without pauses, with the device where you wear it",
                at_ns,
            )

    def _fail(self, reason: str, at_ns: int) -> None:
        self._end(State.FAILED, at_ns, reason=reason)

    def _end(self, state: State, at_ns: int, *, lesson: Lesson | None = None, reason: str | None = None) -> None:
        self.state, self.ended_ns, self.lesson, self.reason = state, at_ns, lesson, reason
