"""Routes of trials: two devices on one walk, and the table of those that are done."""

from __future__ import annotations

import time
from typing import Annotated, Any

from fastapi import FastAPI, Path, Response

from service.api import models
from service.api.trial_models import TrialChange, TrialEnd, TrialMean, TrialModel, TrialRow, TrialWanted
from service.api.views import utc
from service.errors import ParameterError
from service.pipeline.supervisor import Supervisor
from service.pipeline.trial import Count, Trial, mean
from service.pipeline.trial_table import table_csv
from service.pipeline.trials import Trials

Responses = dict[int | str, dict[str, Any]]
Number = Annotated[int, Path(description="The trial's number", ge=1)]

_UNKNOWN: Responses = {404: {"model": models.Problem, "description": "No trial of that number"}}
_NOT_NOW: Responses = {409: {"model": models.Problem, "description": "Not at this moment; the sentence says when"}}
_NO_DEVICE: Responses = {404: {"model": models.Problem, "description": "No device of that id"}}
_CSV: Responses = {200: {"content": {"text/csv": {}}, "description": "The table as CSV, UTF-8"}}
_ALL = "/api/v1/trials"
_ONE = _ALL + "/{number}"


def add_trial_routes(app: FastAPI, supervisor: Supervisor, trials: Trials) -> None:
    """Add the routes over `trials` to `app`; `supervisor` knows the devices."""

    @app.post(_ALL, tags=["trials"], status_code=201, responses={**_NO_DEVICE, **_NOT_NOW})
    async def begin_trial(wanted: TrialWanted) -> TrialModel:
        """Count on two streaming devices from now on."""
        devices = [supervisor.device(key) for key in wanted.devices]
        known = {key for device in devices for key in (device.id, device.address)}
        if strangers := sorted(set(wanted.wrists) - known):
            raise ParameterError("wrists", strangers, "wrists are told of the trial's devices only")
        return _view(trials.begin(devices, name=wanted.name, wrists=wanted.wrists))

    @app.get(_ALL, tags=["trials"])
    async def list_trials() -> models.Page[TrialModel]:
        """List every trial since the start, oldest first."""
        return models.Page(items=[_view(trial) for trial in trials.items])

    @app.get(_ALL + "/table.csv", tags=["trials"], response_class=Response, responses=_CSV)
    async def trial_table() -> Response:
        """Give the done ones as Table 4 of Wang 2018: a line a trial and device, then each device's mean."""
        name = {"Content-Disposition": 'attachment; filename="trials.csv"'}
        return Response(table_csv(trials.items), media_type="text/csv", headers=name)

    _add_one_trial_routes(app, trials)


def _add_one_trial_routes(app: FastAPI, trials: Trials) -> None:
    @app.get(_ONE, tags=["trials"], responses=_UNKNOWN)
    async def get_trial(number: Number) -> TrialModel:
        """Tell how a trial stands; poll it to show progress."""
        return _view(trials.get(number))

    @app.post(_ONE + "/finish", tags=["trials"], responses={**_UNKNOWN, **_NOT_NOW})
    async def finish_trial(number: Number, end: TrialEnd | None = None) -> TrialModel:
        """End the walk; it settles for some seconds, until every step of it is certain, and is done by itself."""
        trial = trials.finish(number)
        if end is not None and end.true_steps is not None:
            trial.true_steps = end.true_steps
        return _view(trial)

    @app.patch(_ONE, tags=["trials"], responses=_UNKNOWN)
    async def change_trial(number: Number, change: TrialChange) -> TrialModel:
        """Tell the true number, or another name; error and accuracy follow."""
        trial = trials.get(number)
        if "true_steps" in change.model_fields_set:
            trial.true_steps = change.true_steps
        if "name" in change.model_fields_set:
            trial.name = change.name
        return _view(trial)

    @app.delete(_ONE, tags=["trials"], status_code=204, responses=_UNKNOWN)
    async def delete_trial(number: Number) -> None:
        """Drop a trial, also one that is being walked."""
        trials.delete(number)


def _view(trial: Trial) -> TrialModel:
    counts = list(trial.counts.values())
    errors = [trial.error(count) for count in counts]
    accuracies = [trial.accuracy_percent(count) for count in counts]
    return TrialModel(
        number=trial.number,
        name=trial.name,
        state=trial.state,
        began_at=utc(trial.began_ns),
        ended_at=None if trial.ended_ns is None else utc(trial.ended_ns),
        true_steps=trial.true_steps,
        rows=[_row(trial, count) for count in counts],
        mean=TrialMean(
            steps=mean([count.steps for count in counts]) or 0.0,
            error=mean(errors),
            accuracy_percent=_percent(mean(accuracies)),
        ),
    )


def _row(trial: Trial, count: Count) -> TrialRow:
    return TrialRow.model_validate(
        {
            "device": count.entry.device,
            "wrist": count.entry.wrist,
            "counter": count.entry.counter,
            "steps": count.steps,
            "steps_now": count.steps_now,
            "error": trial.error(count),
            "accuracy_percent": _percent(trial.accuracy_percent(count)),
            "note": count.note(time.time_ns()),
        }
    )


def _percent(accuracy: float | None) -> float | None:
    """Return an accuracy to the hundredth that the paper prints, and two digits more."""
    return None if accuracy is None else round(accuracy, 4)
