"""From the pipeline's objects to the API's schemas."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from service.api import models
from service.api.gait_models import GaitModel, RefusedModel
from service.counters import describe
from service.counters.registry import CounterKind
from service.events import (
    Awaited,
    Corrected,
    Counting,
    Gap,
    Rebooted,
    Segmented,
    Signal,
    StepCounted,
    Tentative,
    Walked,
)
from service.pipeline.device import Device
from service.pipeline.lifecycle import State
from service.pipeline.lineup import Lineup
from service.pipeline.notices import DeviceChanged, Notice, StateChanged
from service.pipeline.supervisor import Supervisor
from service.samples import Band, DeviceInfo, Gait, Verdict
from service.signals.hosttime import Drift
from service.signals.rate import Rate

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_CONFIDENCE_DIGITS = 3
_SIGNAL_DIGITS = 4
"""Digits of a plotted g: finer than any screen."""


def utc(at_ns: int) -> datetime:
    """Return host nanoseconds as a UTC time; to the microsecond, without the rounding of a float."""
    return _EPOCH + timedelta(microseconds=at_ns // 1000)


def nanoseconds(moment: datetime) -> int:
    """Return a time with an offset as host nanoseconds; exact."""
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def device_view(device: Device) -> models.Device:
    """Return a device as it stands now."""
    tracker, session = device.session.tracker, device.session
    info, tally = tracker.info, tracker.tally
    return models.Device(
        id=device.id,
        name=device.name,
        address=device.address,
        state=device.state,
        reason=device.reason,
        since=utc(device.since_ns),
        session_since=utc(session.since_ns),
        primary=tracker.primary,
        steps=tracker.total,
        steps_now=tracker.steps_now,
        counters=tracker.steps,
        counter_faults=tracker.counter_faults,
        sensors=None if info.sensors is None else list(info.sensors),
        cadence_spm=tracker.cadence_spm if device.state is State.STREAMING else None,
        gait=_gait_view(tracker.gait) if device.state is State.STREAMING else None,
        refused={name: _refused_view(count) for name, count in tracker.refused.items()},
        battery_percent=info.battery_percent,
        rate_hz=info.rate_hz,
        **_clocks_view(tracker.rate, session.drift),
        rssi_dbm=device.rssi_dbm,
        packets=tally.packets,
        packets_bad=tally.packets_bad,
        packets_duplicate=tally.packets_duplicate,
        packets_reordered=tally.packets_reordered,
        samples=tally.samples,
        samples_awaited=tally.samples_awaited,
        samples_lost=tally.samples_lost,
        samples_saturated=tally.samples_saturated,
        gaps=tally.gaps,
        reboots=tally.reboots,
        register_steps=info.register_steps,
        history_s=_history_s(info),
        manufacturer=info.manufacturer,
        model=info.model,
        firmware=info.firmware,
    )


def _clocks_view(rate: Rate | None, drift: Drift | None) -> dict[str, Any]:
    """Return rate and drift with their uncertainties, without digits that mean nothing."""
    return {
        "measured_rate_hz": round(rate.hz, 6) if rate else None,
        "measured_rate_uncertainty_hz": round(rate.uncertainty_hz, 7) if rate else None,
        "clock_drift_ppm": round(drift.ppm, 2) if drift else None,
        "clock_drift_uncertainty_ppm": round(drift.uncertainty_ppm, 2) if drift else None,
    }


def _history_s(info: DeviceInfo) -> float | None:
    if info.history_samples is None or info.rate_hz is None:
        return None
    return round(info.history_samples / info.rate_hz, 1)


def event_view(notice: Notice, supervisor: Supervisor) -> models.LiveMessage:
    """Return a notice as the live feed tells it."""
    if isinstance(notice.event, DeviceChanged):
        value = device_view(supervisor.device(notice.device))
        return models.DeviceEvent(device=notice.device, at=utc(notice.at_ns), value=value)
    if isinstance(notice.event, Tentative):
        return _tentative_view(notice, notice.event)
    if isinstance(notice.event, Awaited):
        told = notice.event
        return models.AwaitedEvent(
            device=notice.device, at=utc(notice.at_ns), from_s=told.from_s, to_s=told.to_s, samples=told.samples
        )
    if isinstance(notice.event, Signal | Counting):
        return _ephemeral_view(notice, notice.event)
    return durable_view(notice)


_SAME_FIELDS: dict[type, Callable[..., models.DurableEvent]] = {
    Corrected: models.CorrectionEvent,
    Rebooted: models.RebootEvent,
    Segmented: models.SegmentEvent,
}


def durable_view(notice: Notice) -> models.DurableEvent:
    """Return a durable notice as an event."""
    device, at, ordinal, event = notice.device, utc(notice.at_ns), notice.ordinal or 0, notice.event
    match event:
        case StepCounted():
            return step_view(notice)
        case StateChanged(state=state, reason=reason):
            return models.StateEvent(device=device, at=at, ordinal=ordinal, state=state, reason=reason)
        case Gap():
            return models.GapEvent(
                device=device,
                at=at,
                ordinal=ordinal,
                from_s=event.from_s,
                to_s=event.to_s,
                samples=event.samples,
                filled=event.filled,
            )
        case Corrected() | Rebooted() | Segmented():
            view = _SAME_FIELDS[type(event)]
            return view(device=device, at=at, ordinal=ordinal, **dataclasses.asdict(event))
        case Walked():
            return walk_view(notice)
        case _:
            raise TypeError(f"{event!r} is not durable")


def step_view(notice: Notice) -> models.StepEvent:
    """Return a step's notice as an event."""
    event = notice.event
    if not isinstance(event, StepCounted):
        raise TypeError(f"{event!r} is no step")
    step = event.step
    return models.StepEvent(
        device=notice.device,
        at=utc(notice.at_ns),
        ordinal=notice.ordinal or 0,
        device_s=step.at_s,
        boot=event.boot,
        counter=event.counter,
        steps=event.steps,
        **_known(notice, event),
        strength=step.strength,
        interval_s=step.interval_s,
        peak=step.peak,
        valley=step.valley,
        upper=step.upper,
        lower=step.lower,
    )


def walk_view(notice: Notice) -> models.WalkEvent:
    """Return a notice of a walk as an event."""
    event = notice.event
    if not isinstance(event, Walked):
        raise TypeError(f"{event!r} is no walk")
    return models.WalkEvent(
        device=notice.device,
        at=utc(notice.at_ns),
        ordinal=notice.ordinal or 0,
        status="began" if event.begins else "ended",
        counter=event.counter,
        device_s=event.at_s,
        boot=event.boot,
    )


def counter_view(kind: CounterKind) -> models.CounterModel:
    """Return a counter of the registry with its parameters."""
    parameters = [_parameter_view(field, kind) for field in dataclasses.fields(kind.params)]
    return models.CounterModel(
        name=kind.name,
        source=describe.source(kind),
        sensors=sorted(kind.sensors),
        latency_s={preset: describe.latency_s(kind, preset) for preset in kind.presets},
        calibrations=list(kind.calibrations),
        parameters=parameters,
    )


def _parameter_view(field: dataclasses.Field[Any], kind: CounterKind) -> models.ParameterModel:
    meta = field.metadata
    return models.ParameterModel(
        name=field.name,
        text=meta["text"],
        unit=meta.get("unit"),
        whole=isinstance(field.default, int),
        low=meta.get("low"),
        high=meta.get("high"),
        options=list(meta["options"]) if "options" in meta else None,
        presets={preset: getattr(params, field.name) for preset, params in kind.presets.items()},
    )


def lineup_view(lineup: Lineup) -> models.LineupModel:
    """Return a device's counters as they can be put back."""
    choices = [
        models.ChoiceModel.model_validate(
            {"name": choice.name, "preset": choice.preset, "params": dict(choice.overrides)}
        )
        for choice in lineup.choices
    ]
    return models.LineupModel(counters=choices)


def _tentative_view(notice: Notice, event: Tentative) -> models.TentativeEvent:
    return models.TentativeEvent(
        device=notice.device,
        at=utc(notice.at_ns),
        counter=event.counter,
        status="retracted" if event.retracted else "likely",
        passes=event.passes,
        device_s=event.at_s,
        boot=event.boot,
        **_known(notice, event),
        strength=event.strength,
        interval_s=event.interval_s,
    )


def _known(notice: Notice, event: StepCounted | Tentative) -> dict[str, Any]:
    """Return how well a step's times are known, and its heading."""
    heading = event.heading
    return {
        "device_uncertainty_s": round(event.uncertainty_s, 6),
        "at_uncertainty_s": round(notice.uncertainty_s + event.uncertainty_s, 6),
        "heading_deg": round(heading.deg, 1) if heading else None,
        "heading_uncertainty_deg": round(heading.uncertainty_deg, 1) if heading else None,
        "heading_is_line": heading.is_line if heading else None,
    }


def _ephemeral_view(notice: Notice, event: Signal | Counting) -> models.SignalEvent | models.CountingEvent:
    device, at = notice.device, utc(notice.at_ns)
    if isinstance(event, Counting):
        return models.CountingEvent(
            device=device,
            at=at,
            now_s=event.now_s,
            steps=event.steps,
            steps_now=event.steps_now,
            cadence_spm=event.cadence_spm,
            gait=_gait_view(event.gait),
        )
    values = [round(float(value), _SIGNAL_DIGITS) for value in event.values]
    bands = [_band_view(band) for band in event.bands]
    return models.SignalEvent(device=device, at=at, from_s=event.from_s, values=values, bands=bands)


def _gait_view(gait: Gait | None) -> GaitModel | None:
    if gait is None:
        return None
    return GaitModel(verdict=gait.verdict, confidence=round(gait.confidence, _CONFIDENCE_DIGITS), device_s=gait.at_s)


def _refused_view(count: Mapping[Verdict, int]) -> RefusedModel:
    return RefusedModel(rest=count[Verdict.REST], other=count[Verdict.OTHER], perhaps=count[Verdict.PERHAPS])


def _band_view(band: Band) -> models.BandModel:
    return models.BandModel(from_s=band.from_s, to_s=band.to_s, upper=band.upper, lower=band.lower)
