"""A device's calibrations: one records at a time, ended ones are kept until they are forgotten, and applied."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

from service.counters import registry
from service.errors import LearningError, NotNowError, ParameterError, UnknownNumberError
from service.pipeline.calibration import Calibration, Plan, State
from service.pipeline.lineup import Lineup
from service.pipeline.notices import Notice
from service.pipeline.session import Session

KEPT: Final = 100
"""Calibrations of one device; policy: no more are begun until some are forgotten."""


class Calibrations:
    """All of one device, fed by its session while one records."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._kept: dict[int, Calibration] = {}
        self._last = 0

    @property
    def items(self) -> list[Calibration]:
        """The kept ones, oldest first."""
        return list(self._kept.values())

    def get(self, number: int) -> Calibration:
        """Return the one of that number; UnknownNumberError where there is none."""
        if number not in self._kept:
            raise UnknownNumberError("calibration", number, "…/calibrations")
        return self._kept[number]

    def begin(self, plan: Plan) -> Calibration:
        """Record from the next sample on; NotNowError while another one records."""
        recording = [kept.number for kept in self.items if kept.state is State.RECORDING]
        if recording:
            raise NotNowError(f"calibration {recording[0]} of this device is recording: finish or delete it first")
        if len(self._kept) >= KEPT:
            raise NotNowError(f"{KEPT} calibrations of this device are kept: delete some first")
        self._last += 1
        begun = self._kept[self._last] = Calibration(plan, number=self._last, began_ns=time.time_ns())
        self._session.observers.append(self._hear)
        return begun

    def leave(self) -> None:
        """Listen to the session no more."""
        if self._hear in self._session.observers:
            self._session.observers.remove(self._hear)

    def finish(self, number: int) -> Calibration:
        """End a recording with what is there."""
        ended = self.get(number)
        ended.finish(time.time_ns())
        self._session.observers.remove(self._hear)
        return ended

    def forget(self, number: int) -> None:
        """Cancel a recording, or drop what was learnt."""
        if self.get(number).state is State.RECORDING:
            self._session.observers.remove(self._hear)
        del self._kept[number]

    def taught(self, lineup: Lineup, numbers: Sequence[int]) -> Lineup:
        """Return `lineup` with what these calibrations of one counter and method teach together."""
        chosen = [self.get(number) for number in dict.fromkeys(numbers)]
        for one in chosen:
            if one.state is not State.DONE:
                raise NotNowError(f"calibration {one.number} is {one.state.value}: only done ones can be applied")
        if len({(one.plan.choice.name, one.plan.method) for one in chosen}) != 1:
            raise ParameterError("numbers", list(numbers), "calibrations of one counter and one method")
        plan, choice = chosen[0].plan, lineup.choice(chosen[0].plan.choice.name)
        pooled = [value for one in chosen for value in one.evidence]
        params = registry.parameters(choice.name, choice.preset, choice.overrides)
        try:
            lesson = plan.way.conclude(pooled, params)
        except LearningError as fault:  # the counter's other parameters have changed since
            raise NotNowError(str(fault)) from fault
        return lineup.taught(choice.name, lesson.params)

    def _hear(self, notice: Notice) -> None:
        (recording,) = (kept for kept in self.items if kept.state is State.RECORDING)
        recording.take(notice)
        if recording.state is not State.RECORDING:
            self._session.observers.remove(self._hear)
