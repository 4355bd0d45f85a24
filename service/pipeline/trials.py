"""All trials: begun over streaming devices, fed by their sessions until their counts are certain."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from service.errors import NotNowError, ParameterError, UnknownNumberError
from service.pipeline.device import Device
from service.pipeline.notices import Notice
from service.pipeline.trial import Entry, Finish, State, Trial

KEPT: Final = 1000
"""Trials; policy: no more are begun until some are deleted, for a result may not vanish by itself."""

CLOCK_S: Final = 0.2
"""A host clock that moved by more against the monotonic one was set: a step may be on the wrong side of the end."""


class Trials:
    """Every trial since the start, by number."""

    def __init__(self) -> None:
        self._kept: dict[int, Trial] = {}
        self._devices: dict[int, dict[str, Device]] = {}
        self._observers: dict[int, dict[str, Callable[[Notice], None]]] = {}
        """Of those that are not done: the devices, and what listens to their sessions."""
        self._set_by: dict[int, int] = {}
        """Host UTC less monotonic time at the beginning: whether somebody set the clock meanwhile."""
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
        if len({device.address for device in devices}) != len(devices):
            raise ParameterError("devices", [device.id for device in devices], "different devices")
        for device in devices:
            self._check(device)
        if len(self._kept) >= KEPT:
            raise NotNowError(f"{KEPT} trials are kept: delete some first")
        self._last += 1
        number = self._last
        entries = [
            Entry(
                device=device.id,
                counter=device.lineup.primary,
                wrist=wrists.get(device.id, wrists.get(device.address)),
            )
            for device in devices
        ]
        trial = self._kept[number] = Trial(
            entries, number=number, name=name or f"trial {number}", began_ns=time.time_ns()
        )
        self._set_by[number] = time.time_ns() - time.monotonic_ns()
        self._devices[number] = {device.id: device for device in devices}
        self._observers[number] = {}
        for device in devices:
            self._listen(trial, device)
        return trial

    def finish(self, number: int) -> Trial:
        """End the walk; the counts settle by themselves."""
        trial = self.get(number)
        devices = self._devices.get(number, {})
        moved_s = abs(time.time_ns() - time.monotonic_ns() - self._set_by[number]) / 1e9
        clock = [f"this computer's clock was set by {moved_s:.1f} s meanwhile"] if moved_s > CLOCK_S else []
        trial.finish(time.time_ns(), {key: _finish(device, clock) for key, device in devices.items()})
        if trial.state is State.DONE:
            self._leave(number)
        return trial

    def delete(self, number: int) -> None:
        """Drop a trial, whatever its state."""
        self.get(number)
        self._leave(number)
        del self._kept[number], self._set_by[number]

    def _check(self, device: Device) -> None:
        device.require_streaming()
        tracker = device.session.tracker
        if (fault := tracker.counter_faults.get(tracker.primary)) is not None:
            raise NotNowError(f"{device.id} counts nothing: {fault}; choose another counter for it")
        for number, devices in self._devices.items():
            if device in devices.values() and self._kept[number].state is State.WALKING:
                raise NotNowError(f"{device.id} walks in trial {number}: finish or delete that one first")

    def _listen(self, trial: Trial, device: Device) -> None:
        key = device.id  # as it is now: a device may tell its id later

        def hear(notice: Notice) -> None:
            trial.take(key, notice)
            if trial.state is State.DONE:
                self._leave(trial.number)

        self._observers[trial.number][key] = hear
        device.session.observers.append(hear)

    def _leave(self, number: int) -> None:
        devices, observers = self._devices.pop(number, {}), self._observers.pop(number, {})
        for key, hear in observers.items():
            devices[key].session.observers.remove(hear)


def _finish(device: Device, remarks: Sequence[str]) -> Finish:
    tracker = device.session.tracker
    fault = tracker.counter_faults.get(tracker.primary)
    latency_s = device.lineup.makers[tracker.primary]().latency_s
    return Finish(latency_s=latency_s, remarks=(*remarks, *([fault] if fault else [])))
