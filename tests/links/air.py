"""A bracelet on a virtual air, heard by a host, and links to it."""

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
