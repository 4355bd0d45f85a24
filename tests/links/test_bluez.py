"""bleak's own BlueZ backend against a played bluetoothd: bleak #2002 has no effect on us, and silence ends a link."""

import asyncio
import shutil
import sys

import pytest
from conftest import missing

from service.errors import LinkError, LinkFault
from service.links.ble import PLATFORM, BleLink, Timeouts, close_stale, find
from service.wearables import bracelet as wire
from service.wearables.contract import Subscribe

pytestmark = pytest.mark.full

SENT = 20
HANDSHAKE = [Subscribe(characteristic=wire.DATA)]


@pytest.fixture
async def daemon(tmp_path):
    if sys.platform != "linux" or shutil.which("dbus-daemon") is None:
        missing("dbus-daemon is not installed (Debian: dbus-daemon)")
    from links.bluetoothd import bluetoothd

    async with bluetoothd(tmp_path) as daemon:
        yield daemon


class Counted(BleLink):
    """A link that counts what it is called back with, of all links together."""

    calls = 0

    def _notified(self, characteristic, data):
        Counted.calls += 1
        super()._notified(characteristic, data)


class Careless(Counted):
    """One that lets go of its client as it is: what bleak #2002 needs."""

    kept = []  # noqa: RUF012  # so that nothing ends with it

    async def _close(self):
        self.kept.append(self._client)
        self._client = None


async def play(daemon, link, packets):
    """Notify 20 packets, lose the link, take what came."""
    async with link, asyncio.timeout(3):
        for number in range(SENT):
            daemon.data.notify(bytes([1, number]))
            await asyncio.sleep(0.005)
        daemon.device.lose()
        async for packet in link:
            packets.append(packet.data[1])  # ends by the error


async def rounds(daemon, kind, n=3):
    """Link, take 20 packets, lose the link; n times. Return how often a link was called back in each."""
    calls = []
    for _ in range(n):
        (sighting,) = await find(wire.Bracelet.services, for_s=0.3)
        before, packets = Counted.calls, []
        with pytest.raises(LinkError) as lost:
            await play(daemon, kind(sighting.handle, HANDSHAKE), packets)
        assert lost.value.reason is LinkFault.LOST
        assert sorted(set(packets)) == list(range(SENT))
        calls.append(Counted.calls - before)
    return calls


async def test_each_notification_comes_once_after_any_number_of_losses(daemon):
    assert await rounds(daemon, Counted) == [SENT] * 3
    assert daemon.device.links == 3
    await asyncio.sleep(0.1)
    assert daemon.data.clients == set()


async def test_the_trap_is_there(daemon):
    """So that the test above can fail: without a disconnect after a loss each reconnect adds a copy."""
    assert await rounds(daemon, Careless) == [SENT, 2 * SENT, 3 * SENT]
    for client in Careless.kept:
        await client.disconnect()


async def test_a_silent_link_is_dropped(daemon):
    (sighting,) = await find(wire.Bracelet.services, for_s=0.3)
    async with BleLink(sighting.handle, HANDSHAKE, timeouts=Timeouts(silence_s=0.2)) as link:
        with pytest.raises(LinkError) as silent:
            await anext(aiter(link))
    assert silent.value.reason is LinkFault.SILENT
    assert not daemon.device.connected


async def test_a_connection_that_an_earlier_run_left_open_is_closed(daemon):
    from links.bluetoothd import ADDRESS

    daemon.device.Connect.__wrapped__(daemon.device)
    assert daemon.device.connected
    await close_stale([ADDRESS], PLATFORM)
    assert not daemon.device.connected
    (sighting,) = await find(wire.Bracelet.services, for_s=0.3)
    assert sighting.address == ADDRESS
