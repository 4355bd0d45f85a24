"""The FastAPI application: routes, and the page's files."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Query, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.middleware import Middleware
from fastapi.responses import FileResponse, JSONResponse
from fastapi.staticfiles import StaticFiles
from pydantic import TypeAdapter

from service.api import models
from service.api.calibrations import add_calibration_routes
from service.api.devices import add_counter_routes, add_device_routes, add_person_routes
from service.api.guard import Guard
from service.api.guide import add_guide
from service.api.live import serve_feed
from service.api.trials import add_trial_routes
from service.config import LOOPBACK
from service.errors import (
    CounterError,
    NotNowError,
    ParameterError,
    StoreError,
    UnknownDeviceError,
    UnknownNumberError,
    UnknownPersonError,
)
from service.pipeline.supervisor import Supervisor
from service.pipeline.trials import Trials

WEB = Path(__file__).parent / "web"
DESCRIPTION = """Live step counts of Bluetooth LE wearables.

Lists are `{items, next}`: pass `next` as `after` for what follows. Times are UTC with an explicit offset; `*_s` are
device time, seconds after the device's boot. The live feed is the WebSocket `/api/v1/live` (repeat `?device=` to choose
devices): a `snapshot` first, then events; `GET /api/v1/live/schema` has the JSON Schema of every message."""


def create_app(supervisor: Supervisor, trials: Trials | None = None) -> FastAPI:
    """Return the application over `supervisor`, which runs while the application does, and over its trials."""

    @contextlib.asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        async with supervisor.running():
            yield

    app = FastAPI(
        title="steplink",
        version=version("steplink"),
        description=DESCRIPTION,
        lifespan=lifespan,
        redoc_url=None,
        docs_url=None,
        responses={
            403: {"model": models.Problem, "description": "A foreign Host or Origin"},
            422: {"model": models.Problem, "description": "A parameter is missing, of the wrong type or out of range"},
        },
        middleware=[Middleware(Guard, hosts=frozenset(LOOPBACK))],
    )
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(StoreError, _not_stored)
    for fault, status in _REFUSALS.items():
        app.add_exception_handler(fault, _refusal(status))
    walks = trials or Trials()
    add_device_routes(app, supervisor)
    add_counter_routes(app, supervisor)
    add_person_routes(app, supervisor, walks)
    add_calibration_routes(app, supervisor)
    add_trial_routes(app, supervisor, walks)
    _add_live(app, supervisor)
    _add_page(app)
    add_guide(app)
    return app


_REFUSALS: dict[type[Exception], int] = {
    UnknownDeviceError: 404,
    UnknownNumberError: 404,
    UnknownPersonError: 404,
    NotNowError: 409,
    ParameterError: 422,
    CounterError: 422,
}


def _refusal(status: int) -> Callable[[Request, Exception], Awaitable[JSONResponse]]:
    async def answer(_request: Request, error: Exception) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, status_code=status)

    return answer


async def _not_stored(_request: Request, error: Exception) -> JSONResponse:
    """Say what the disk does not do: 503 where it may do it later."""
    passing = isinstance(error, StoreError) and error.is_passing
    return JSONResponse({"detail": str(error)}, status_code=503 if passing else 500)


async def _invalid(_request: Request, error: Exception) -> JSONResponse:
    """Say what FastAPI found wrong as the sentence that every other refusal is."""
    found = error.errors() if isinstance(error, RequestValidationError) else []
    detail = "; ".join(dict.fromkeys(map(_sentence, found)))
    return JSONResponse({"detail": detail}, status_code=422)


_NO_NAMES = frozenset({"body", "query", "path", "float", "str", "int", "bool"})
"""Parts of a fault's place that say where it was sent, or which of several kinds it was tried as."""


def _sentence(fault: Mapping[str, Any]) -> str:
    """Return one fault as `name = value: what is allowed`."""
    name = ".".join(str(part) for part in fault["loc"] if part not in _NO_NAMES)
    allowed = fault["msg"][:1].lower() + fault["msg"][1:]
    if fault["type"] == "json_invalid":
        return f"the body is no JSON: {fault.get('ctx', {}).get('error', allowed)}"
    if not name:
        return f"the body: {allowed}; send JSON, with the header Content-Type: application/json"
    if fault["type"] == "missing":
        return f"{name}: it is missing"
    return f"{name} = {fault['input']!r}: {allowed}"


def _add_live(app: FastAPI, supervisor: Supervisor) -> None:
    @app.get("/api/v1/live/schema", tags=["live"])
    async def live_schema() -> dict[str, Any]:
        """Return the JSON Schema of every message of the live feed."""
        return TypeAdapter(models.LiveMessage).json_schema(mode="serialization")

    @app.websocket("/api/v1/live")
    async def live(
        socket: WebSocket,
        device: Annotated[list[str] | None, Query()] = None,
        counters: Annotated[str | None, Query()] = None,
    ) -> None:
        await serve_feed(socket, supervisor, device or [], counters.split(",") if counters else [])


def _add_page(app: FastAPI) -> None:
    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        return FileResponse(WEB / "index.html")

    app.mount("/web", StaticFiles(directory=WEB), name="web")
