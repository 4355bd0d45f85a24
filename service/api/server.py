"""The server process: a port that is ours before anything else starts, and an end that takes less than two seconds."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import socket
from collections.abc import Callable, Iterator

import uvicorn
from fastapi import FastAPI

from service.errors import ParameterError

GRACE_S = 1
"""Open connections have so long to end after the service was told to stop."""
MESSAGE_BYTES = 65_536
"""Largest message a WebSocket client may send; ours takes none."""


class _Server(uvicorn.Server):
    """uvicorn without its signal handlers (the command owns them), that says when it answers."""

    def __init__(self, config: uvicorn.Config, on_ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_ready = on_ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start answering, and say so."""
        await super().startup(sockets)
        if not self.should_exit:
            self._on_ready()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def listen(host: str, port: int) -> socket.socket:
    """Return a socket bound to `host` and `port` (0: a free one); ParameterError where that port is in use."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        bound.listen()  # now, so that a second service fails here and not later
    except OSError as error:
        bound.close()
        why = f"cannot listen on {host}:{port} ({error.strerror}); choose another with --port, 0 for a free one"
        raise ParameterError("port", port, why) from error
    return bound


def spare_what_is_loaded() -> None:
    """Have Python's collector pass over all that is loaded: looking through it holds the loop for 20 ms or more."""
    gc.collect()
    gc.freeze()


def address(bound: socket.socket) -> str:
    """Return the URL of the page behind `bound`."""
    host, port = bound.getsockname()[:2]
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"


async def serve(app: FastAPI, bound: socket.socket, *, on_ready: Callable[[], None]) -> None:
    """Serve `app` on `bound` until cancelled; `on_ready` is called once it answers."""
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=MESSAGE_BYTES,
        timeout_graceful_shutdown=GRACE_S,
    )
    server = _Server(config, on_ready)
    running = asyncio.create_task(server.serve(sockets=[bound]), name="http server")
    try:
        await asyncio.shield(running)
    finally:
        server.should_exit = True
        await asyncio.wait({running})
        bound.close()
