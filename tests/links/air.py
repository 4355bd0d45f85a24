"""A bracelet on a virtual air, heard by a host, and links to it."""

import asyncio
import contextlib

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.links.ble import Backend, BleLink, find
from service.wearables import bracelet as wire


@contextlib.asynccontextmanager
async def on_air(seconds=60, **radio):
    async with LocalAir() as air:
        bracelet = Bracelet(Walker(f"normal:{seconds}", seed=1))
        async with air.bracelet(bracelet, **radio) as gatt, air.central() as central:
            backend = Backend(scanner=central.scanner, client=central.client)
            (sighting,) = await find(wire.Bracelet.services, for_s=0.3, backend=backend)
            yield gatt, sighting, backend


def link_to(sighting, backend, handshake=None, **how):
    return BleLink(sighting.handle, handshake or wire.Bracelet().handshake(), backend, **how)


def at_each_step(backend, gatt, comes):
    """A backend that awaits `comes(step)` before each thing that its client asks of `gatt`'s bracelet."""

    async def discovery():
        """Services are asked for once the MTU is agreed on."""
        while not (gatt.connected and gatt._peripheral.mtu > 23):  # noqa: ASYNC110  # the bracelet tells nobody
            await asyncio.sleep(0)
        await comes("discovery")

    class Client(backend.client):
        async def connect(self, *words, **how):
            await comes("connect")
            watch = asyncio.create_task(discovery())
            try:
                await super().connect(*words, **how)
            finally:
                watch.cancel()

        async def read_gatt_char(self, *words, **how):
            await comes("read")
            return await super().read_gatt_char(*words, **how)

        async def start_notify(self, *words, **how):
            await comes("subscribe")
            await super().start_notify(*words, **how)

        async def write_gatt_char(self, *words, **how):
            await comes("write")
            await super().write_gatt_char(*words, **how)

    return Backend(scanner=backend.scanner, client=Client)
