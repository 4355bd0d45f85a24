"""All trials: begun over streaming devices, fed by their sessions until their counts are certain."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from service.errors import NotNowError, ParameterError, UnknownNumberError
from service.pipeline.device import Device
from service.pipeline.notices import Notice
from service.pipeline.trial import Entry, Finish, State, Trial

KEPT: Final = 1000
"""Trials; policy: no more are begun until some are deleted, for a result may not vanish by itself."""
CLOCK_S: Final = 0.2
"""A host clock that moved by more against the steady one was set: a step may be on the wrong side of the end."""

Listener = Callable[[Notice], None]


@dataclass(slots=True, kw_only=True)
class _Listening:
    """What a trial that is not done holds on to."""

    offset_ns: int
    """Host UTC less the steady clock, at the beginning."""
    listeners: list[tuple[Device, Listener]] = field(default_factory=list)


class Trials:
    """Every trial since the start, by number. `clock_ns` is host UTC, `steady_ns` a clock that nobody sets."""

    def __init__(
        self, clock_ns: Callable[[], int] = time.time_ns, steady_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._clock_ns = clock_ns
        self._steady_ns = steady_ns
        self._kept: dict[int, Trial] = {}
        self._listening: dict[int, _Listening] = {}
        self._last = 0

    @property
    def items(self) -> list[Trial]:
        """All of them, oldest first."""
        return list(self._kept.values())

    def get(self, number: int) -> Trial:
        """Return the one of that number; UnknownNumberError where there is none."""
        if number not in self._kept:
            raise UnknownNumberError("trial", number, "/api/v1/trials")
        return self._kept[number]

    def begin(self, devices: Sequence[Device], *, name: str | None, wrists: Mapping[str, str]) -> Trial:
        """Count on these from now on; NotNowError where one does not stream, does not count or walks already."""
        ids = [device.id for device in devices]
        if len(set(ids)) != len(ids):
            raise ParameterError("devices", ids, "different devices, each with an id of its own")
        for device in devices:
            self._check(device)
        if len(self._kept) >= KEPT:
            raise NotNowError(f"{KEPT} trials are kept: delete some first")
        self._last += 1
        entries = [_entry(device, wrists) for device in devices]
        name = name or f"trial {self._last}"
        trial = Trial(entries, number=self._last, name=name, began_ns=self._clock_ns())
        self._kept[trial.number] = trial
        self._listening[trial.number] = _Listening(offset_ns=self._offset_ns())
        for device in devices:
            self._listen(trial, device)
        return trial

    def finish(self, number: int) -> Trial:
        """End the walk; the counts settle by themselves."""
        trial, listening = self.get(number), self._listening.get(number)
        at_ns, ends = self._clock_ns(), {}
        if listening is not None:
            moved_s = abs(self._offset_ns() - listening.offset_ns) / 1e9
            remarks = [f"this computer's clock was set by {moved_s:.1f} s meanwhile"] if moved_s > CLOCK_S else []
            ends = {device.id: _finish(device, remarks) for device, _ in listening.listeners}
        trial.finish(at_ns, ends)
        if trial.state is State.DONE:
            self._leave(trial)
        return trial

    def delete(self, number: int) -> None:
        """Drop a trial, whatever its state."""
        self._leave(self.get(number))
        del self._kept[number]

    def forget(self, devices: Iterable[str]) -> None:
        """Drop every trial of any of these devices."""
        gone = set(devices)
        for number in [number for number, trial in self._kept.items() if not gone.isdisjoint(trial.counts)]:
            self.delete(number)

    def _offset_ns(self) -> int:
        return self._clock_ns() - self._steady_ns()

    def _check(self, device: Device) -> None:
        device.require_streaming()
        tracker = device.session.tracker
        if (fault := tracker.counter_faults.get(tracker.primary)) is not None:
            raise NotNowError(f"{device.id} counts nothing: {fault}; choose another counter for it")
        for trial in self._kept.values():
            if trial.state is State.WALKING and device.id in trial.counts:
                raise NotNowError(f"{device.id} walks in trial {trial.number}: finish or delete that one first")

    def _listen(self, trial: Trial, device: Device) -> None:
        key = device.id

        def hear(notice: Notice) -> None:
            trial.take(key, notice)
            if trial.state is State.DONE:
                self._leave(trial)

        self._listening[trial.number].listeners.append((device, hear))
        device.session.observers.append(hear)

    def _leave(self, trial: Trial) -> None:
        listening = self._listening.pop(trial.number, None)
        for device, hear in listening.listeners if listening else ():
            device.session.observers.remove(hear)


def _entry(device: Device, wrists: Mapping[str, str]) -> Entry:
    wrist = wrists.get(device.id, wrists.get(device.address))
    return Entry(device=device.id, counter=device.lineup.primary, wrist=wrist)


def _finish(device: Device, remarks: Sequence[str]) -> Finish:
    tracker = device.session.tracker
    fault = tracker.counter_faults.get(tracker.primary)
    latency_s = device.lineup.makers[tracker.primary]().latency_s
    return Finish(latency_s=latency_s, remarks=(*remarks, *([fault] if fault else [])))
