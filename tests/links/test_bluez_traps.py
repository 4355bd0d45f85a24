"""What BlueZ does and the virtual radio does not: a backend that behaves as it, and what the link makes of that."""

import asyncio
import contextlib

import pytest
from bleak import BleakClient
from links.air import link_to, on_air

from service.errors import LinkError, LinkFault
from service.links.ble import Backend, close_stale
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control
from service.wearables.contract import Read


class Subscribers:
    """Who asked for a characteristic's values. BlueZ forgets them when their client disconnects, not with the link, and
    gives each value to the newest as often as there are any (bleak #2002).
    """

    def __init__(self):
        self.of = {}
        self.calls = 0

    def like_bluez(self, client):
        """A client class over `client` that is remembered here."""
        subscribers = self

        class BluezLike(client):
            async def start_notify(self, characteristic, callback, **kwargs):
                clients = subscribers.of.setdefault(characteristic.uuid, [])
                clients.append(self)

                def notified(value):
                    for _ in tuple(clients):
                        subscribers.calls += characteristic.uuid == wire.DATA
                        callback(value)

                await super().start_notify(characteristic, notified, **kwargs)

            async def disconnect(self):
                for clients in subscribers.of.values():
                    clients[:] = [client for client in clients if client is not self]
                await super().disconnect()

        return BluezLike


async def taken(link, n):
    async with asyncio.timeout(5):
        async for packet in link:
            n -= packet.characteristic == wire.DATA
            if not n:
                return


@pytest.mark.full
async def test_without_a_disconnect_each_reconnect_brings_one_copy_more():
    """The trap itself, so that the test below can fail."""
    async with on_air(speed=8) as (gatt, sighting, backend):
        subscribers, heard, copies = Subscribers(), [], []
        client = subscribers.like_bluez(backend.client)
        for _ in range(3):
            bleak = BleakClient(sighting.handle, backend=client)
            await bleak.connect()
            heard.clear()
            await bleak.start_notify(wire.DATA, lambda _, data: heard.append(bytes(data)))
            await bleak.start_notify(wire.CONTROL, lambda *_: None)
            begin = control.start()
            await bleak.write_gatt_char(begin.characteristic, begin.data, response=True)
            async with asyncio.timeout(10):
                while len(set(heard)) < 5:  # noqa: ASYNC110  # the callback tells nobody
                    await asyncio.sleep(0.01)
            copies.append(heard.count(heard[0]))
            await gatt.drop_link()
        assert copies == [1, 2, 3]


async def test_after_any_number_of_losses_each_notification_comes_once():
    async with on_air(speed=30) as (gatt, sighting, backend):
        subscribers = Subscribers()
        bluez = Backend(scanner=backend.scanner, client=subscribers.like_bluez(backend.client))
        for _ in range(4):
            sent, calls = gatt.statistics().packets, subscribers.calls
            with contextlib.suppress(LinkError):
                async with link_to(sighting, bluez) as link:
                    await taken(link, 6)
                    await gatt.drop_link()
                    await taken(link, 1_000_000)
            assert 6 <= subscribers.calls - calls <= gatt.statistics().packets - sent
        assert all(clients == [] for clients in subscribers.of.values())


@pytest.mark.full
async def test_what_the_platform_calls_after_the_end_fills_no_queue():
    async with on_air(speed=8) as (_, sighting, backend), link_to(sighting, backend) as link:
        await taken(link, 3)
    waiting = link.diagnostics()["waiting"]
    link._notified(type("Characteristic", (), {"uuid": wire.DATA}), bytearray(20))
    assert link.diagnostics()["waiting"] == waiting


async def test_services_are_forgotten_where_a_characteristic_is_missing():
    """BlueZ answers from its cache: what it remembers may be an older firmware's."""
    forgotten = []

    async def clear(address):
        forgotten.append(address)

    async with on_air() as (_, sighting, backend):
        bluez = Backend(scanner=backend.scanner, client=backend.client, clear_cache=clear)
        wanted = [Read(characteristic="5e9a00ff-4b1d-4c0e-8f3a-73746570b001")]
        with pytest.raises(LinkError) as refused:
            async with link_to(sighting, bluez, wanted):
                pass
        assert refused.value.reason is LinkFault.NOT_OURS
        assert forgotten == [sighting.address]


async def test_stale_connections_are_closed_within_bounds_and_whatever_happens(caplog):
    closed = []

    async def close(address):
        closed.append(address)

    await close_stale(["A", "B"], Backend(close_stale=close))
    assert closed == ["A", "B"]
    await close_stale(["A"], Backend())

    async def hang(_address):
        await asyncio.sleep(60)

    async def fail(_address):
        raise RuntimeError("no bus")

    for close_badly in (hang, fail):
        caplog.clear()
        await close_stale(["A"], Backend(close_stale=close_badly), timeout_s=0.05)
        assert "earlier run" in caplog.text
