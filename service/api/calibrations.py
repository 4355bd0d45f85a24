"""Routes of a device's calibrations: record a walk, learn from it, let the counter go on with what was learnt."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import FastAPI, Path

from service.api import models
from service.api.calibration_models import CalibrationModel, CalibrationsChosen, CalibrationWanted
from service.api.views import lineup_view, utc
from service.pipeline.calibration import Calibration, Plan
from service.pipeline.device import Device
from service.pipeline.supervisor import Supervisor

Responses = dict[int | str, dict[str, Any]]
Number = Annotated[int, Path(description="The calibration's number", ge=1)]

_UNKNOWN: Responses = {404: {"model": models.Problem, "description": "No such device or calibration"}}
_NOT_NOW: Responses = {409: {"model": models.Problem, "description": "Not at this moment; the sentence says when"}}
_ALL = "/api/v1/devices/{id}/calibrations"
_ONE = _ALL + "/{number}"


def add_calibration_routes(app: FastAPI, supervisor: Supervisor) -> None:
    """Add the routes over `supervisor` to `app`."""

    @app.post(_ALL, tags=["calibrations"], status_code=201, responses={**_UNKNOWN, **_NOT_NOW})
    async def begin_calibration(id: str, wanted: CalibrationWanted) -> CalibrationModel:  # noqa: A002  # the path's own
        """Record the device's stream from now on, one at a time; it must be streaming."""
        device = supervisor.device(id)
        plan = Plan(
            choice=device.lineup.choice(wanted.counter),
            method=wanted.method,
            pace=wanted.pace,
            steps=wanted.steps,
            seconds=wanted.seconds,
        )
        await asyncio.to_thread(plan.way.learner, plan.params)  # the first filter to be designed imports scipy: 1 s
        return _view(device, device.calibrate(plan))

    @app.get(_ALL, tags=["calibrations"], responses=_UNKNOWN)
    async def list_calibrations(id: str) -> models.Page[CalibrationModel]:  # noqa: A002
        """List the device's calibrations, oldest first."""
        device = supervisor.device(id)
        return models.Page(items=[_view(device, one) for one in device.calibrations.items])

    @app.post(_ALL + "/apply", tags=["calibrations"], responses={**_UNKNOWN, **_NOT_NOW})
    async def apply_calibrations(id: str, chosen: CalibrationsChosen) -> models.LineupModel:  # noqa: A002
        """Let the counter go on with what was learnt.

        Its other parameters stay; it runs beside the others from now on if it did not run. If it is the primary, a new
        segment begins, and `steps` goes on.
        """
        device = supervisor.device(id)
        device.count_with(device.calibrations.taught(device.lineup, chosen.numbers))
        return lineup_view(device.lineup)

    @app.get(_ONE, tags=["calibrations"], responses=_UNKNOWN)
    async def get_calibration(id: str, number: Number) -> CalibrationModel:  # noqa: A002
        """Tell how a calibration stands; poll it to show progress."""
        device = supervisor.device(id)
        return _view(device, device.calibrations.get(number))

    @app.post(_ONE + "/finish", tags=["calibrations"], responses={**_UNKNOWN, **_NOT_NOW})
    async def finish_calibration(id: str, number: Number) -> CalibrationModel:  # noqa: A002
        """End a recording early, with what is there."""
        device = supervisor.device(id)
        return _view(device, device.calibrations.finish(number))

    @app.delete(_ONE, tags=["calibrations"], status_code=204, responses=_UNKNOWN)
    async def forget_calibration(id: str, number: Number) -> None:  # noqa: A002
        """Cancel a recording, or forget what was learnt; a counter that goes on with it is not changed."""
        supervisor.device(id).calibrations.forget(number)


def _view(device: Device, one: Calibration) -> CalibrationModel:
    plan, lesson = one.plan, one.lesson
    return CalibrationModel.model_validate(
        {
            "number": one.number,
            "device": device.id,
            "counter": plan.choice.name,
            "method": plan.method,
            "pace": plan.pace,
            "steps_wanted": plan.steps,
            "seconds_wanted": plan.seconds,
            "state": one.state,
            "reason": one.reason,
            "began_at": utc(one.began_ns),
            "ended_at": None if one.ended_ns is None else utc(one.ended_ns),
            "steps": one.steps,
            "seconds": one.seconds,
            "params": None if lesson is None else dict(lesson.params),
            "detail": None if lesson is None else lesson.detail,
        }
    )
