"""The live feed over WebSocket: a snapshot first, then every event as it happens.

Sender and receiver run side by side and the first to end ends both, so that neither a silent client nor a full socket
can hold up a shutdown. A client that reads too slowly is told so and closed; it comes back and begins at a snapshot.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Collection, Sequence

from fastapi import WebSocket, WebSocketDisconnect

from service.api import models
from service.api.views import device_view, event_view, utc
from service.counters import registry
from service.errors import UnknownDeviceError
from service.events import StepCounted, Tentative
from service.pipeline.hub import SlowSubscriberError, Subscription
from service.pipeline.supervisor import Supervisor

CLOSE_UNKNOWN = 4404
CLOSE_SLOW = 4408
SEND_TIMEOUT_S = 10.0
"""A client whose socket takes nothing for so long is gone."""


async def serve_feed(
    socket: WebSocket, supervisor: Supervisor, wanted: Sequence[str], counters: Sequence[str] = ()
) -> None:
    """Serve one client until it goes or falls behind.

    `wanted` are device ids or addresses, `counters` names whose steps, likely ones too, are told; empty means all.
    """
    await socket.accept()
    try:
        devices = [supervisor.device(key) for key in wanted] if wanted else supervisor.devices
    except UnknownDeviceError as error:
        await socket.close(CLOSE_UNKNOWN, str(error)[:120])
        return
    if unknown := [name for name in counters if name not in registry.COUNTERS]:
        await socket.close(CLOSE_UNKNOWN, f"no counter {', '.join(unknown)}: see /api/v1/counters"[:120])
        return
    keys = {key for device in devices for key in (device.id, device.address)} if wanted else None
    subscription = supervisor.hub.subscribe(keys)
    snapshot = models.Snapshot(at=utc(time.time_ns()), devices=[device_view(device) for device in devices])
    sender = asyncio.create_task(_send(socket, subscription, supervisor, snapshot, frozenset(counters)))
    receiver = asyncio.create_task(_receive(socket))
    try:
        await asyncio.wait({sender, receiver}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        subscription.close()
        sender.cancel()
        receiver.cancel()
        await asyncio.gather(sender, receiver, return_exceptions=True)


async def _send(
    socket: WebSocket,
    subscription: Subscription,
    supervisor: Supervisor,
    snapshot: models.Snapshot,
    counters: Collection[str],
) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        await _send_text(socket, snapshot.model_dump_json())
        try:
            while True:
                for notice in await subscription.receive():
                    told = notice.event
                    if counters and isinstance(told, StepCounted | Tentative) and told.counter not in counters:
                        continue
                    await _send_text(socket, event_view(notice, supervisor).model_dump_json())
        except SlowSubscriberError:
            last = models.Lagging(detail="too slow: subscribe again, the snapshot has every count")
            await _send_text(socket, last.model_dump_json())
            await socket.close(CLOSE_SLOW, last.detail)


async def _send_text(socket: WebSocket, text: str) -> None:
    async with asyncio.timeout(SEND_TIMEOUT_S):
        await socket.send_text(text)


async def _receive(socket: WebSocket) -> None:
    """Read and drop what the client says, until it goes: the feed takes no requests."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while (await socket.receive())["type"] != "websocket.disconnect":
            pass
