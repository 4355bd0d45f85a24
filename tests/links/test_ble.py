"""A link is one connection: packets in order, losses told by reason, and no wait without an end."""

import asyncio
import time

import pytest
from links.air import link_to, on_air
from links.conformance import CHECKS, Bench, take

from device_sim.bracelet import PACKET_SAMPLES
from device_sim.gatt import Start
from service.errors import LinkError, LinkFault
from service.links.ble import Timeouts, find
from service.wearables import bracelet as wire
from service.wearables.contract import Read, Write


def numbered(packets):
    """First sample of each packet of data; what was read before is no data."""
    decoder = wire.Bracelet()
    blocks = [(packet.characteristic, decoder.feed(packet.characteristic, packet.data)) for packet in packets]
    return [block.index for characteristic, block in blocks if characteristic == wire.DATA]


@pytest.mark.parametrize("check", CHECKS)
async def test_the_contract(check):
    async with on_air(seconds=600, speed=20) as (gatt, sighting, backend):
        await check(Bench(make=lambda: link_to(sighting, backend), lose=gatt.drop_link, order=numbered))


async def test_find_tells_name_address_and_signal():
    async with on_air(name="Wrist") as (_, sighting, _):
        assert sighting.name == "Wrist"
        assert wire.SERVICE in sighting.services
        assert -100 <= sighting.rssi_dbm <= 0


async def test_what_was_read_comes_first_then_data_without_a_hole():
    radio = {"speed": 20, "start": Start.ON_SUBSCRIBE}
    async with on_air(**radio) as (_, sighting, backend), link_to(sighting, backend) as link:
        packets = await take(link, 60)
        assert link.diagnostics()["connected"]
    kinds = [packet.characteristic for packet in packets]
    assert kinds[:5] == [wire.DEVICE_ID, wire.BOOT, wire.SCALE, wire.RATE, wire.CLOCK]
    indices = numbered(packets)
    assert indices == list(range(0, PACKET_SAMPLES * len(indices), PACKET_SAMPLES))


async def test_a_lost_link_says_so():
    async with on_air(speed=20) as (gatt, sighting, backend), link_to(sighting, backend) as link:
        await gatt.drop_link()
        with pytest.raises(LinkError) as lost:
            await take(link, 10_000)
        assert lost.value.reason is LinkFault.LOST


async def test_a_silent_link_is_dropped():
    timeouts = Timeouts(silence_s=0.2)
    async with on_air(speed=8) as (gatt, sighting, backend), link_to(sighting, backend, timeouts=timeouts) as link:
        await take(link, 12)
        gatt.silence()
        with pytest.raises(LinkError) as silent:
            await take(link, 10_000)
        assert silent.value.reason is LinkFault.SILENT


async def test_a_device_that_answers_nothing_is_bounded():
    async with on_air() as (gatt, sighting, backend):
        await gatt.go_away()
        began = time.monotonic()
        with pytest.raises(LinkError) as failed:
            async with link_to(sighting, backend, timeouts=Timeouts(connect_s=0.4)):
                pass
        assert failed.value.reason in {LinkFault.TIMEOUT, LinkFault.REFUSED}
        assert time.monotonic() - began < 3
        await gatt.come_back()
        async with link_to(sighting, backend) as link:
            assert await take(link, 10)


async def test_cancelling_a_connect_returns_at_once():
    async with on_air() as (gatt, sighting, backend):
        await gatt.go_away()
        task = asyncio.create_task(link_to(sighting, backend).__aenter__())
        await asyncio.sleep(0.1)
        began = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - began < 0.1


async def test_a_device_without_our_characteristic_is_not_ours():
    async with on_air() as (_, sighting, backend):
        wanted = [Read(characteristic="5e9a00ff-4b1d-4c0e-8f3a-73746570b001")]
        with pytest.raises(LinkError) as refused:
            async with link_to(sighting, backend, wanted):
                pass
        assert refused.value.reason is LinkFault.NOT_OURS


async def test_an_optional_characteristic_may_be_missing():
    async with on_air() as (_, sighting, backend):
        optional = Read(characteristic="5e9a00ff-4b1d-4c0e-8f3a-73746570b001", optional=True)
        async with link_to(sighting, backend, [optional, Read(characteristic=wire.RATE)]) as link:
            (packet,) = await take(link, 1)
            assert packet.characteristic == wire.RATE


async def test_a_write_to_what_is_not_there_is_a_link_error():
    async with on_air() as (_, sighting, backend), link_to(sighting, backend) as link:
        with pytest.raises(LinkError) as refused:
            await link.request(Write(characteristic="5e9a00ff-4b1d-4c0e-8f3a-73746570b001", data=b"\0"))
        assert refused.value.reason is LinkFault.NOT_OURS


async def test_no_bluetooth_is_told_with_advice(monkeypatch):
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent")
    with pytest.raises(LinkError, match="steplink demo") as failed:
        await find(wire.Bracelet.services, for_s=0.1)
    assert failed.value.reason is LinkFault.NO_ADAPTER
