"""Hosts that come and go at any moment: the bracelet is on the air again afterwards, whatever they left behind."""

import asyncio
import contextlib
import random

import pytest

from device_sim import peripheral
from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.errors import LinkError
from service.links.ble import Backend, BleLink, find
from service.wearables import bracelet as wire


@contextlib.asynccontextmanager
async def on_air():
    async with LocalAir() as air:
        bracelet = Bracelet(Walker("normal:600", seed=1))
        async with air.bracelet(bracelet, speed=8) as gatt, air.central() as central:
            yield gatt, Backend(scanner=central.scanner, client=central.client)


async def heard(backend):
    return await find(wire.Bracelet.services, for_s=0.3, backend=backend)


async def delivers(backend, sighting):
    async with BleLink(sighting.handle, wire.Bracelet().handshake(), backend) as link, asyncio.timeout(10):
        async for packet in link:
            if packet.characteristic == wire.DATA:
                return True
    return False


@pytest.mark.full
async def test_a_link_whose_host_never_asks_for_anything_is_given_up(monkeypatch):
    monkeypatch.setattr(peripheral, "UNASKED_S", 1.0)
    async with on_air() as (gatt, backend):
        gatt._peripheral._on_connection(Ghost())
        gatt._peripheral._advertising = True  # as it is in truth, so that settling stops it
        await gatt._peripheral.settle()
        assert await heard(backend) == []
        await asyncio.sleep(1.0)
        (sighting,) = await heard(backend)
        assert await delivers(backend, sighting)


class Ghost:
    """A link that exists in the bracelet's mind only."""

    handle = 0x0EFF
    att_mtu = 23

    def once(self, *_):
        """Its end is never told."""


async def storm(seed, rounds):
    rng = random.Random(seed)
    async with on_air() as (_, backend):
        for _ in range(rounds):
            found = await heard(backend)
            if not found:
                continue
            task = asyncio.create_task(delivers(backend, found[0]))
            await asyncio.sleep(rng.random() * 0.12)
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError, LinkError):
                await task
        async with asyncio.timeout(peripheral.UNASKED_S + 10):
            while not (found := await heard(backend)):
                pass
        assert await delivers(backend, found[0])


@pytest.mark.full
async def test_a_short_storm_ends_in_a_working_link():
    await storm(seed=1, rounds=6)


@pytest.mark.full
@pytest.mark.parametrize("seed", [2, 3])
async def test_a_long_storm_ends_in_a_working_link(seed):
    await storm(seed, rounds=40)
