"""The whole service on stage, in this process: a simulated bracelet, the virtual radio, and a real HTTP server."""

import asyncio
import contextlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

import httpx
import websockets

from device_sim.air import LocalAir
from device_sim.gatt import GattBracelet
from service.api.app import create_app
from service.api.server import address, listen, serve
from service.counters.registry import DEFAULT, make
from service.links.ble import Backend
from service.pipeline.archive import Archive
from service.pipeline.hub import Hub
from service.pipeline.lineup import lineup
from service.pipeline.supervisor import Supervisor
from service.store.store import open_store
from service.tracking.tracker import Tracker
from service.wearables.bracelet import Bracelet as Protocol


@dataclass
class Stage:
    """What a test may touch: the service by HTTP, its supervisor, and the bracelet's radio."""

    url: str
    http: httpx.AsyncClient
    supervisor: Supervisor
    bracelet: GattBracelet
    bracelets: list[GattBracelet]

    @property
    def live_url(self):
        return self.url.replace("http", "ws", 1) + "api/v1/live"

    def live(self, query="", **options):
        """The feed. A client with messages that nobody reads hears no close, and would wait for ten seconds."""
        options = {"close_timeout": 1} | options
        return websockets.connect(self.live_url + query, max_size=None, proxy=None, **options)

    async def device(self, key="sim-1"):
        answer = await self.http.get(f"api/v1/devices/{key}")
        assert answer.status_code == 200, answer.text
        return answer.json()

    async def until(self, condition, *, within_s=10.0):
        """Wait until `condition(device)` holds; return the device."""
        return await self.poll("devices/sim-1", condition, within_s=within_s)

    async def poll(self, path, condition, *, within_s=10.0):
        """Wait until `condition(what is at path)` holds; return it."""
        async with asyncio.timeout(within_s):
            while True:
                answer = await self.http.get(f"api/v1/{path}")
                if answer.status_code == 200 and condition(answer.json()):
                    return answer.json()
                await asyncio.sleep(0.02)


def default_tracker(wearable):
    return Tracker(wearable, {DEFAULT: lambda: make(DEFAULT)}, primary=DEFAULT)


@contextlib.asynccontextmanager
async def staged(bracelet, *others, **options):
    """Run the service over bracelets on a local air; everything is closed and joined at the end."""
    radio = {name: value for name, value in options.items() if name not in SERVICE}
    async with contextlib.AsyncExitStack() as stack:
        air = await stack.enter_async_context(LocalAir())
        gatts = [await stack.enter_async_context(air.bracelet(worn, **radio)) for worn in (bracelet, *others)]
        service = {name: value for name, value in options.items() if name in SERVICE}
        yield await stack.enter_async_context(serving(air, gatts, **service))


SERVICE = {"durable_limit", "wanted", "counter", "beside", "path", "keep", "disk"}
"""Options that are the service's and not the bracelet's radio's."""


@contextlib.asynccontextmanager
async def serving(
    air, gatts=(), *, durable_limit=1000, wanted=None, counter=DEFAULT, beside=(), path=None, keep=None, disk=None
):
    """Run the service over an air that is there; it stores at `path`, else where nobody looks, on `disk` if given."""
    async with contextlib.AsyncExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        how = {} if disk is None else {"connect": disk.connect, "retry_s": 0.1}
        store = await stack.enter_async_context(open_store(path or Path(folder) / "s.db", queue_batches=100, **how))
        central = await stack.enter_async_context(air.central())
        supervisor = Supervisor(
            hub=Hub(durable_limit=durable_limit),
            make_wearable=Protocol,
            lineup=lineup(counter, beside=beside),
            wanted=wanted,
            backend=Backend(scanner=central.scanner, client=central.client),
            archive=Archive(store, keep),
        )
        bound = listen("127.0.0.1", 0)
        url, ready = address(bound), asyncio.Event()
        server = asyncio.create_task(serve(create_app(supervisor), bound, on_ready=ready.set))
        try:
            async with asyncio.timeout(10):
                await ready.wait()
            async with httpx.AsyncClient(base_url=url, trust_env=False) as http:
                yield Stage(url, http, supervisor, gatts[0] if gatts else None, list(gatts))
        finally:
            server.cancel()
            await asyncio.gather(server, return_exceptions=True)
