"""Routes of the service's health and of its devices."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import FastAPI, Query, Response

from service.api import models
from service.api.steps import EventsQuery, StepsQuery, steps_page, walks_page
from service.api.views import counter_view, device_view, lineup_view
from service.counters import registry
from service.pipeline.lineup import CounterChoice, Lineup
from service.pipeline.supervisor import Supervisor
from service.pipeline.trials import Trials

_UNKNOWN: dict[int | str, dict[str, Any]] = {404: {"model": models.Problem, "description": "No device of that id"}}
_NOT_STORED: dict[int | str, dict[str, Any]] = {
    503: {"model": models.Problem, "description": "The disk does not take or give it now; it may later"}
}


def add_device_routes(app: FastAPI, supervisor: Supervisor) -> None:
    """Add the routes over `supervisor` to `app`."""

    @app.get("/healthz", tags=["service"])
    async def health() -> models.Health:
        """Tell that the service runs, and whether Bluetooth does."""
        trouble, store = supervisor.trouble, supervisor.store_trouble
        return models.Health(
            version=app.version,
            devices=len(supervisor.devices),
            bluetooth="ok" if trouble is None else "unavailable",
            reason=None if trouble is None else trouble.why,
            store="ok" if store is None else "unavailable",
            store_reason=None if store is None else store.why,
        )

    @app.get("/readyz", tags=["service"], responses={503: {"model": models.Readiness, "description": "Not ready"}})
    async def ready(answer: Response) -> models.Readiness:
        """Tell whether devices can be heard and what is counted can be stored; if not, with status 503 and why."""
        troubles = [trouble for trouble in (supervisor.trouble, supervisor.store_trouble) if trouble is not None]
        answer.status_code = 503 if troubles else 200
        return models.Readiness(ready=not troubles, reasons=[trouble.why for trouble in troubles])

    @app.get("/api/v1/devices", tags=["devices"])
    async def list_devices() -> models.Page[models.Device]:
        """List every device with a stored session and every one heard since the start."""
        return models.Page(items=[device_view(device) for device in supervisor.devices])

    @app.get("/api/v1/devices/{id}", tags=["devices"], responses=_UNKNOWN)
    async def get_device(id: str) -> models.Device:  # noqa: A002  # the path's own word
        """Tell how a device stands now; its link address finds it too."""
        return device_view(supervisor.device(id))

    @app.post("/api/v1/devices/{id}/connect", tags=["devices"], status_code=202, responses=_UNKNOWN)
    async def connect(id: str) -> models.Device:  # noqa: A002
        """Keep a device connected: now if it is near, and again whenever it was lost."""
        return device_view(supervisor.connect(id))

    @app.post("/api/v1/devices/{id}/disconnect", tags=["devices"], status_code=202, responses=_UNKNOWN)
    async def disconnect(id: str) -> models.Device:  # noqa: A002
        """Close a device's connection and leave it alone; its count stays."""
        return device_view(supervisor.disconnect(id))

    @app.get("/api/v1/devices/{id}/steps", tags=["devices"], responses={**_UNKNOWN, **_NOT_STORED})
    async def list_steps(id: str, query: Annotated[StepsQuery, Query()]) -> models.Page[models.StepEvent]:  # noqa: A002
        """List a device's confirmed steps, oldest first."""
        return await steps_page(supervisor.device(id), query)

    @app.get("/api/v1/devices/{id}/walks", tags=["devices"], responses={**_UNKNOWN, **_NOT_STORED})
    async def list_walks(id: str, query: Annotated[EventsQuery, Query()]) -> models.Page[models.WalkEvent]:  # noqa: A002
        """List when a device's wearer began and ceased to walk, oldest first.

        Nothing where the primary does not recognise walking.
        """
        return await walks_page(supervisor.device(id), query)


def add_person_routes(app: FastAPI, supervisor: Supervisor, trials: Trials) -> None:
    """Add the routes of whose data is whose to `app`."""

    @app.put("/api/v1/devices/{id}/person", tags=["persons"], status_code=204, responses={**_UNKNOWN, **_NOT_STORED})
    async def assign(id: str, owner: models.OwnerModel) -> None:  # noqa: A002
        """Make a person the owner of a device's data: of those that are nobody's and of those to come.

        Where the session is another person's it ends, and one that counts from nothing begins.
        """
        await supervisor.assign(id, owner.person)

    nobody: dict[int | str, dict[str, Any]] = {
        404: {"model": models.Problem, "description": "Nobody of that name has data"}
    }

    @app.delete("/api/v1/persons/{person}", tags=["persons"], responses={**nobody, **_NOT_STORED})
    async def forget(person: str) -> models.Forgotten:
        """Delete all data of a person for good: samples, steps, events and counts of every device of theirs.

        The devices are disconnected, and count from nothing when they are connected again.
        """
        sessions, devices = await supervisor.forget(person)
        trials.forget(device.id for device in devices)
        return models.Forgotten(sessions=sessions)


def add_counter_routes(app: FastAPI, supervisor: Supervisor) -> None:
    """Add the routes of counters and of a device's lineup to `app`."""

    @app.get("/api/v1/counters", tags=["counters"])
    def list_counters() -> models.Page[models.CounterModel]:  # in a thread: the first filter imports scipy
        """List every counter with its parameters, their units, ranges and presets."""
        return models.Page(items=[counter_view(kind) for kind in registry.COUNTERS.values()])

    @app.get("/api/v1/devices/{id}/counters", tags=["counters"], responses=_UNKNOWN)
    async def get_lineup(id: str) -> models.LineupModel:  # noqa: A002
        """Tell which counters run on a device's stream, the primary first."""
        return lineup_view(supervisor.device(id).lineup)

    @app.put("/api/v1/devices/{id}/counters", tags=["counters"], responses=_UNKNOWN)
    async def put_lineup(id: str, wanted: models.LineupModel) -> models.LineupModel:  # noqa: A002
        """Let these counters run from now on; another primary begins a new segment, and `steps` goes on.

        Refused where the device is known to lack a sensor that the primary needs; the others wait for it, and
        `counter_faults` of the device says so. Refused too where parameters are out of range or contradict each other;
        a refusal changes nothing.
        """
        device = supervisor.device(id)
        choices = [
            CounterChoice(name=choice.name, preset=choice.preset, overrides=choice.params) for choice in wanted.counters
        ]
        device.count_with(Lineup(choices=tuple(choices)))
        return lineup_view(device.lineup)
