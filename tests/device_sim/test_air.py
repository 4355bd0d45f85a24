"""The air itself: participants that come, go, are killed or talk nonsense."""

import asyncio
import math
import signal
import sys

import pytest
from bleak import BleakScanner
from bleak.exc import BleakBluetoothNotAvailableError, BleakError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from device_sim.air import LocalAir
from device_sim.air_tcp import AirServer, RemoteAir, hosted_air, open_air, parse_address, remote_central
from device_sim.bracelet import Bracelet
from service.errors import LinkError, LinkFault, ParameterError

pytestmark = pytest.mark.full

BRACELET_PROCESS = """
import asyncio, sys
import numpy as np
from device_sim.air_tcp import open_air
from device_sim.bracelet import Bracelet

class Still:
    rate_hz = 50.0
    sensors = ("accelerometer",)
    def read(self, n):
        return np.zeros((n, 3))
    def true_steps_until(self, t_s):
        return 0

async def main():
    async with open_air(sys.argv[1]).bracelet(Bracelet(Still(), device_id="other"), name="other"):
        await asyncio.Event().wait()

asyncio.run(main())
"""


@pytest.fixture
async def server():
    async with LocalAir() as air, AirServer(air) as server:
        yield server


@pytest.fixture
async def process(server):
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", BRACELET_PROCESS, server.address)
    yield process
    if process.returncode is None:
        process.kill()
    await process.wait()


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_killed_process_is_a_lost_link_and_a_stopped_one_only_silent(server, process, radio, how):
    async with remote_central(server.address) as central:
        async with asyncio.timeout(20):  # a Python that starts on a busy machine
            while await BleakScanner.find_device_by_name("other", timeout=1, backend=central.scanner) is None:
                pass
        host = await radio.Host.connect(central, device=await radio.seen(central, "other"))
        await host.subscribe()
        await host.got(10)
        process.send_signal(how)
        if how == signal.SIGKILL:
            await radio.until(lambda: host.gone, within_s=0.5)
            await radio.until(lambda: server.statistics()["sockets"] == 1)
        else:
            await asyncio.sleep(0.3)
            assert host.client.is_connected
            await host.client.disconnect()
            assert host.gone == 1


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(garbage=st.binary(min_size=1, max_size=300))
def test_any_bytes_end_their_own_socket_at_most(radio, garbage):
    async def scenario():
        async with (
            LocalAir() as air,
            AirServer(air) as server,
            air.bracelet(Bracelet(radio.Endless()), speed=20),
            remote_central(server.address) as central,
        ):
            host = await radio.Host.connect(central)
            await host.subscribe()
            _reader, writer = await asyncio.open_connection(*parse_address(server.address))
            writer.write(garbage)
            await writer.drain()
            await host.got(host.samples + 30)
            writer.close()
            await radio.until(lambda: server.statistics()["sockets"] == 1)
            assert host.client.is_connected

    asyncio.run(scenario())


@pytest.mark.parametrize(
    "garbage", [b"GET / HTTP/1.1\r\n\r\n", b"\x04\x0e\x04\x01\x03\x0c\x00", b"\x01\x0d\x20\x01\x00"]
)
async def test_what_is_no_host_is_closed(server, garbage):
    reader, writer = await asyncio.open_connection(*parse_address(server.address))
    writer.write(garbage)
    with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
        await asyncio.wait_for(reader.readexactly(1), 1)
    writer.close()
    assert server.statistics()["sockets"] == 0


async def test_one_participant_too_many_is_refused(radio):
    async with (
        LocalAir() as local,
        AirServer(local, max_sockets=1) as server,
        open_air(server.address).bracelet(Bracelet(radio.Endless())),
        remote_central(server.address) as central,
    ):
        with pytest.raises(BleakError):
            await asyncio.wait_for(BleakScanner.discover(timeout=0.1, backend=central.scanner), 2)
        late = open_air(server.address).bracelet(Bracelet(radio.Endless(), device_id="late"))
        with pytest.raises(LinkError) as refused:
            await late.__aenter__()
        assert refused.value.reason is LinkFault.NO_ADAPTER
        assert server.statistics()["refused"] == 2


async def test_an_air_that_dies_ends_links_and_is_found_again(radio):
    local = LocalAir()
    first = await AirServer(local).__aenter__()
    address = first.address
    async with (
        RemoteAir(address).bracelet(Bracelet(radio.Endless()), speed=20) as gatt,
        remote_central(address) as central,
    ):
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(20)
        reading = asyncio.create_task(_read_for_ever(host))
        await first.__aexit__(None, None, None)
        await radio.until(lambda: host.gone == 1, within_s=0.5)
        with pytest.raises(BleakError):
            await asyncio.wait_for(reading, 1)
        with pytest.raises(BleakBluetoothNotAvailableError, match="no virtual air"):
            await asyncio.wait_for(host.client.connect(), 2)
        with pytest.raises(BleakBluetoothNotAvailableError):
            await asyncio.wait_for(BleakScanner.discover(timeout=0.1, backend=central.scanner), 2)
        async with AirServer(local, address):
            again = await radio.Host.connect(central)
            await again.subscribe()
            await again.got(20)
            assert again.blocks[0].index > host.blocks[-1].index  # the bracelet's time went on
            assert gatt.statistics().links == 2
            await again.client.disconnect()
            assert (host.gone, again.gone) == (1, 1)


async def _read_for_ever(host):
    while True:
        await host.client.read_gatt_char("2a19")


async def test_a_scan_goes_on_when_the_air_is_back(radio):
    heard = []
    local = LocalAir()
    first = await AirServer(local).__aenter__()
    async with remote_central(first.address) as central:
        async with BleakScanner(lambda device, _: heard.append(device.name), backend=central.scanner):
            await first.__aexit__(None, None, None)
            async with AirServer(local, first.address), local.bracelet(Bracelet(radio.Endless())):
                await radio.seen(central)  # whoever uses the central next opens it again, for all
                await radio.until(lambda: "Steplink" in heard)
        assert central.central.statistics()["scanners"] == 0


async def test_leaving_a_local_air_ends_everything_on_it(radio):
    async with LocalAir() as air:
        gatt = await air.bracelet(Bracelet(radio.Endless())).__aenter__()
        async with air.central() as central:
            host = await radio.Host.connect(central)
            await air.__aexit__(None, None, None)
            await radio.until(lambda: host.gone == 1 and not gatt.connected)
            assert air.statistics() == {"radios": 0, "links": 0}
        await gatt.__aexit__(None, None, None)


async def test_a_host_that_does_not_read_holds_its_sender_back(server, radio):
    """The sender waits for credits; the air keeps less than its limit, and others are not slowed."""
    bracelet = Bracelet(radio.Endless(), packet_samples=0)
    async with server._air.bracelet(bracelet, speed=math.inf) as gatt, remote_central(server.address) as central:
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(84)
        (device,) = [central.central._device]
        device.host.hci_sink._transport.pause_reading()
        (socket,) = server._sockets
        await radio.until(lambda: socket._radio.congested)
        await asyncio.sleep(0.05)
        packets = gatt.statistics().packets
        await asyncio.sleep(0.1)
        assert gatt.statistics().packets == packets
        assert socket._transport.get_write_buffer_size() < 200_000
        device.host.hci_sink._transport.resume_reading()
        await radio.until(lambda: gatt.statistics().packets > packets + 100)
        indices = [block.index for block in host.blocks]
        assert indices == sorted(set(indices))


async def test_an_air_is_hosted_once_and_joined_after(radio):
    async with LocalAir() as local, AirServer(local) as server:
        free = server.address
    async with hosted_air(free) as air:
        assert isinstance(air, LocalAir)
    async with (
        LocalAir() as local,
        AirServer(local) as server,
        hosted_air(server.address) as joined,
        joined.bracelet(Bracelet(radio.Endless())),
    ):
        assert isinstance(joined, RemoteAir)
        assert server.statistics()["radios"] == 1


@pytest.mark.parametrize(
    "wrong",
    [
        "",
        "7400",
        "127.0.0.1",
        "127.0.0.1:",
        "127.0.0.1:x",
        "0.0.0.0:1",
        "1.2.3.4:1",
        "::1:x",
        "127.0.0.1:0",
        "127.0.0.1:-1",
        "127.0.0.1:65536",
    ],
)
def test_only_loopback_addresses_are_taken(wrong):
    with pytest.raises(ParameterError):
        parse_address(wrong)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("127.0.0.1:7400", ("127.0.0.1", 7400)), ("[::1]:1", ("::1", 1)), ("localhost:65535", ("localhost", 65535))],
)
def test_addresses(text, expected):
    assert parse_address(text) == expected


async def test_five_bracelets_share_an_air(radio):
    async with LocalAir() as air, air.central() as central:
        bracelets = [
            air.bracelet(Bracelet(radio.Endless(), device_id=f"b{n}"), name=f"b{n}", speed=5) for n in range(5)
        ]
        for bracelet in bracelets:
            await bracelet.__aenter__()
        hosts = [await radio.Host.connect(central, device=await radio.seen(central, f"b{n}")) for n in range(5)]
        for host in hosts:
            await host.subscribe()
        for host in hosts:
            await host.got(50)
        assert air.statistics() == {"radios": 6, "links": 5}
        for bracelet in bracelets:
            await bracelet.__aexit__(None, None, None)
        await radio.until(lambda: all(host.gone == 1 for host in hosts))
