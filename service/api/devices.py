"""Routes of the service's health and of its devices."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import FastAPI, Query

from service.api import models
from service.api.steps import StepsQuery, list_page
from service.api.views import counter_view, device_view, lineup_view
from service.counters import registry
from service.pipeline.lineup import CounterChoice, Lineup
from service.pipeline.supervisor import Supervisor

_UNKNOWN: dict[int | str, dict[str, Any]] = {404: {"model": models.Problem, "description": "No device of that id"}}


def add_device_routes(app: FastAPI, supervisor: Supervisor) -> None:
    """Add the routes over `supervisor` to `app`."""

    @app.get("/healthz", tags=["service"])
    async def health() -> models.Health:
        """Tell that the service runs, and whether Bluetooth does."""
        trouble = supervisor.trouble
        return models.Health(
            version=app.version,
            devices=len(supervisor.devices),
            bluetooth="ok" if trouble is None else "unavailable",
            reason=None if trouble is None else trouble.why,
        )

    @app.get("/api/v1/devices", tags=["devices"])
    async def list_devices() -> models.Page[models.Device]:
        """List every device heard since the start."""
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

    @app.get("/api/v1/devices/{id}/steps", tags=["devices"], responses=_UNKNOWN)
    async def list_steps(id: str, query: Annotated[StepsQuery, Query()]) -> models.Page[models.StepEvent]:  # noqa: A002
        """List a device's confirmed steps, oldest first."""
        return list_page(supervisor.device(id), query)


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
