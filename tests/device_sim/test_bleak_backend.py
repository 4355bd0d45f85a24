"""bleak's own API over the virtual radio, in one process and over TCP."""

import asyncio
import contextlib
import math
import random

import numpy as np
import pytest
from bleak import BleakClient, BleakScanner
from bleak.exc import BleakCharacteristicNotFoundError, BleakDeviceNotFoundError, BleakError, BleakGATTProtocolError
from bleak_retry_connector import establish_connection

from device_sim.bracelet import Bracelet, quantise
from device_sim.gatt import Start
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control

CCCD = "00002902-0000-1000-8000-00805f9b34fb"


async def test_a_scan_finds_a_bracelet_by_its_service(on_air):
    async with on_air() as (_gatt, central):
        found = await BleakScanner.discover(
            timeout=0.4, return_adv=True, service_uuids=[wire.SERVICE], backend=central.scanner
        )
        ((device, data),) = found.values()
        assert (device.name, data.local_name, data.service_uuids) == ("Steplink", "Steplink", [wire.SERVICE])
        other = await BleakScanner.discover(timeout=0.3, service_uuids=["180d"], backend=central.scanner)
        assert other == []
        assert central.central.statistics()["scanners"] == 0


async def test_everything_a_host_reads_is_what_the_bracelet_is(on_air, radio):
    async with on_air() as (gatt, central):
        host = await radio.Host.connect(central)
        assert (host.client.mtu_size, host.client.name, host.client.is_connected) == (517, "Steplink", True)
        infos = await host.describe()
        assert infos[wire.DEVICE_ID].device == "sim-1"
        assert infos[wire.BOOT].boot == gatt.bracelet.boot
        assert infos[wire.SCALE].lsb_per_g == 4096
        assert infos[wire.RATE].rate_hz == 50
        assert infos[wire.CLOCK].clock[0] % 128 == 0
        assert infos[wire.BATTERY_LEVEL].battery_percent == 100
        assert infos[wire.MANUFACTURER_NAME].manufacturer == "steplink"
        assert {infos[wire.MODEL_NUMBER].model, infos[wire.FIRMWARE_REVISION].firmware} == {"simulated bracelet", "2"}
        await host.client.disconnect()


@pytest.mark.parametrize(("max_mtu", "in_packet"), [(517, 10), (23, 2)])
async def test_a_thousand_packets_arrive_in_order_and_exact(on_air, radio, max_mtu, in_packet):
    samples = 1000 * in_packet
    source = radio.Known(samples)
    async with on_air(source, speed=math.inf, max_mtu=max_mtu) as (gatt, central):
        host = await radio.Host.connect(central)
        assert host.client.mtu_size == max_mtu
        await host.subscribe()
        await host.got(samples, within_s=20)
        await asyncio.wait_for(gatt.played.wait(), 1)
        assert (len(host.blocks), gatt.statistics().packets, gatt.statistics().lost) == (1000, 1000, 0)
        assert [block.index for block in host.blocks] == list(range(0, samples, in_packet))
        assert np.array_equal(np.rint(host.acc_g() * 4096), quantise(source.acc_g, 4096))


async def test_a_lost_link_is_told_once_and_a_new_one_brings_each_packet_once(on_air, radio):
    async with on_air(speed=10) as (gatt, central):
        for _ in range(3):
            host = await radio.Host.connect(central)
            await host.subscribe()
            await host.got(30)
            began = asyncio.get_running_loop().time()
            await gatt.drop_link()
            await host.until(lambda host=host: host.gone, within_s=0.1)
            assert asyncio.get_running_loop().time() - began < 0.1
            assert not host.client.is_connected
            indices = [block.index for block in host.blocks]
            assert len(set(indices)) == len(indices)
            await host.client.disconnect()
            assert host.gone == 1


async def test_one_client_connects_again_after_a_loss(on_air, radio):
    async with on_air(speed=10) as (gatt, central):
        host = await radio.Host.connect(central)
        for _ in range(3):
            host.blocks.clear()
            await host.subscribe()
            await host.got(50)
            indices = [block.index for block in host.blocks]
            assert indices == list(range(indices[0], indices[0] + 10 * len(indices), 10))
            await gatt.drop_link()
            await host.until(lambda: not host.client.is_connected)
            await host.client.connect()
        await host.client.disconnect()
        assert host.gone == 4


async def test_a_wanted_disconnect_calls_back_once(on_air, radio):
    async with on_air() as (gatt, central):
        host = await radio.Host.connect(central)
        await asyncio.gather(host.client.disconnect(), host.client.disconnect())
        await host.client.disconnect()
        assert host.gone == 1
        await host.until(lambda: not gatt.connected)
        with pytest.raises(BleakError):
            await host.client.read_gatt_char(wire.SCALE)


async def test_a_bracelet_out_of_range_times_out_and_is_found_when_it_is_back(on_air, radio):
    async with on_air() as (gatt, central):
        device = await radio.seen(central)
        await gatt.go_away()
        with pytest.raises(TimeoutError):
            await radio.Host.connect(central, device=device, timeout=0.3)
        await gatt.come_back()
        host = await radio.Host.connect(central, device=device)
        await host.describe()
        await gatt.go_away()
        await host.until(lambda: host.gone)
        assert await BleakScanner.discover(timeout=0.3, backend=central.scanner) == []


async def test_a_bracelet_that_answers_nothing_times_out_and_answers_later(on_air, radio):
    async with on_air() as (gatt, central):
        device = await radio.seen(central)
        gatt.silence()
        with pytest.raises(TimeoutError):
            await radio.Host.connect(central, device=device, timeout=0.3)
        await radio.until(lambda: not gatt.connected, within_s=1)
        gatt.speak()
        host = await radio.Host.connect(central, device=device)
        await host.describe()


@pytest.mark.parametrize("fault", ["away", "silent"])
async def test_a_cancelled_connect_ends_within_100_ms(on_air, radio, fault):
    async with on_air() as (gatt, central):
        device = await radio.seen(central)
        if fault == "away":
            await gatt.go_away()
        else:
            gatt.silence()
        connecting = asyncio.create_task(radio.Host.connect(central, device=device, timeout=30))
        await asyncio.sleep(0.25)
        began = asyncio.get_running_loop().time()
        connecting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await connecting
        assert asyncio.get_running_loop().time() - began < 0.1
        gatt.speak()
        await gatt.come_back()
        host = await radio.Host.connect(central, device=device)
        await host.describe()


@pytest.mark.parametrize("turns", [0, 1, 3, 8])
async def test_a_connect_cancelled_at_any_moment_leaves_no_link(on_air, radio, turns):
    async with on_air() as (gatt, central):
        device = await radio.seen(central)
        connecting = asyncio.create_task(radio.Host.connect(central, device=device))
        for _ in range(turns * 3):
            await asyncio.sleep(0)
        if turns % 2:
            await asyncio.sleep(0.01 * turns)
        connecting.cancel()
        await asyncio.wait({connecting})
        if not connecting.cancelled():
            await connecting.result().client.disconnect()
        await radio.until(lambda: not gatt.connected and central.central.statistics()["operations"] == 0, within_s=1)
        host = await radio.Host.connect(central, device=device)
        await host.describe()


@pytest.mark.parametrize("delay_turns", [0, 7, 20])
async def test_operations_in_flight_fail_when_the_link_drops(on_air, radio, delay_turns):
    async with on_air() as (gatt, central):
        host = await radio.Host.connect(central)

        async def read_for_ever():
            while True:
                await host.client.read_gatt_char(wire.SCALE)

        readers = [asyncio.create_task(read_for_ever()) for _ in range(3)]
        for _ in range(delay_turns):
            await asyncio.sleep(0)
        await gatt.drop_link()
        results = await asyncio.wait_for(asyncio.gather(*readers, return_exceptions=True), 1)
        assert all(isinstance(result, BleakError) for result in results), results
        assert host.gone == 1


async def test_an_unanswered_request_ends_with_the_link_and_not_with_its_caller(on_air, radio):
    async with on_air() as (gatt, central):
        host = await radio.Host.connect(central)
        gatt.silence()
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await host.client.read_gatt_char(wire.SCALE)
        gatt.speak()
        waiting = asyncio.create_task(host.client.read_gatt_char(wire.BOOT))
        await asyncio.sleep(0.05)
        assert not waiting.done()  # the first transaction is still open: its answer must not become this one's
        await gatt.drop_link()
        with pytest.raises(BleakError):
            await waiting


@pytest.mark.full
async def test_a_hundred_losses_at_any_moment_leave_nothing_behind(on_air, radio):
    moments = random.Random(9)
    async with on_air(speed=10) as (gatt, central):
        device = await radio.seen(central)
        streamed = 0
        for _ in range(100):
            attempt = asyncio.create_task(_subscribed(radio, central, device))
            await asyncio.sleep(moments.uniform(0, 0.15))
            await gatt.drop_link()
            with contextlib.suppress(BleakError, TimeoutError):
                host = await attempt
                await gatt.drop_link()
                await host.until(lambda host=host: host.gone)
                indices = [block.index for block in host.blocks]
                assert indices == sorted(set(indices))
                streamed += bool(indices)
        assert streamed > 20
        await radio.until(lambda: central.central.statistics() == {"scanners": 0, "links": 0, "operations": 0})
        host = await _subscribed(radio, central, device)
        await host.got(20)


async def _subscribed(radio, central, device):
    host = await radio.Host.connect(central, device=device, timeout=2)
    await host.subscribe()
    return host


async def test_a_subscription_ends_and_begins_again(on_air, radio):
    async with on_air(speed=10) as (gatt, central):
        host = await radio.Host.connect(central)
        await host.subscribe()
        with pytest.raises(BleakError):
            await host.client.start_notify(wire.DATA, host._take)
        await host.got(20)
        await host.client.stop_notify(wire.DATA)
        before = len(host.blocks)
        assert not gatt.subscribed
        await asyncio.sleep(0.1)
        assert len(host.blocks) == before
        await host.client.start_notify(wire.DATA, host._take)
        await host.got(host.samples + 20)
        indices = [block.index for block in host.blocks]
        assert indices == sorted(set(indices))


async def test_two_bracelets_are_two_devices(on_air, radio):
    async with on_air.air() as air:
        first = Bracelet(radio.Known(500, seed=1), device_id="left")
        second = Bracelet(radio.Known(500, seed=2), device_id="right")
        options = {"speed": math.inf, "start": Start.ON_SUBSCRIBE}
        async with (
            air.bracelet(first, name="left", **options),
            air.bracelet(second, name="right", **options),
            air.central() as central,
        ):
            devices = [await radio.seen(central, name) for name in ("left", "right")]
            hosts = await asyncio.gather(*(radio.Host.connect(central, device=device) for device in devices))
            await asyncio.gather(*(host.subscribe() for host in hosts))
            for host, seed in zip(hosts, (1, 2), strict=True):
                await host.got(500)
                assert np.array_equal(np.rint(host.acc_g() * 4096), quantise(radio.Known(500, seed=seed).acc_g, 4096))
            await hosts[0].client.disconnect()
            assert hosts[1].client.is_connected


async def test_a_bracelet_has_one_host_at_a_time(on_air, radio):
    async with (
        on_air.air() as air,
        air.bracelet(Bracelet(radio.Endless())) as gatt,
        air.central() as one,
        air.central() as two,
    ):
        device = await radio.seen(two)
        await radio.seen(one)  # both are open: they hear the same advertisement
        both = [radio.Host.connect(central, device=device, timeout=0.5) for central in (one, two)]
        results = await asyncio.gather(*both, return_exceptions=True)
        hosts = [result for result in results if isinstance(result, radio.Host)]
        assert len(hosts) == 1, results
        assert all(isinstance(result, (radio.Host, BleakError, TimeoutError)) for result in results)
        await hosts[0].describe()
        assert gatt.statistics().links == 1


async def test_the_retry_connector_connects(on_air, radio):
    async with on_air() as (gatt, central):
        device = await radio.seen(central)
        client = await establish_connection(BleakClient, device, "band", backend=central.client)
        await gatt.drop_link()
        client = await establish_connection(BleakClient, device, "band", backend=central.client)
        assert bytes(await client.read_gatt_char(wire.DEVICE_ID)) == b"sim-1"
        await client.disconnect()


async def test_an_address_alone_is_enough_where_the_device_advertises(on_air, radio):
    async with on_air() as (_gatt, central):
        device = await radio.seen(central)
        async with BleakClient(device.address, backend=central.client, timeout=3) as client:
            assert client.is_connected
        with pytest.raises(BleakDeviceNotFoundError):
            await BleakClient("C0:00:00:00:00:01", backend=central.client, timeout=0.3).connect()
        assert central.central.statistics()["scanners"] == 0


async def test_only_wanted_services_are_discovered(on_air, radio):
    async with on_air() as (_gatt, central):
        host = await radio.Host.connect(central, services=["180f"])
        assert [service.uuid[4:8] for service in host.client.services] == ["180f"]
        with pytest.raises(BleakCharacteristicNotFoundError):
            await host.client.read_gatt_char(wire.SCALE)


async def test_descriptors_are_read_and_written(on_air, radio):
    async with on_air(speed=10) as (gatt, central):
        host = await radio.Host.connect(central)
        data = host.client.services.get_characteristic(wire.DATA)
        (cccd,) = data.descriptors
        assert cccd.uuid == CCCD
        assert bytes(await host.client.read_gatt_descriptor(cccd.handle)) == b"\0\0"
        await host.client._backend.write_gatt_descriptor(cccd, b"\1\0")  # bleak itself leaves this one to start_notify
        await host.enable_answers()
        await host.ask(control.start())
        assert gatt.subscribed
        assert bytes(await host.client.read_gatt_descriptor(cccd.handle)) == b"\1\0"


async def test_what_a_bracelet_refuses_is_a_protocol_error(on_air, radio):
    async with on_air() as (_gatt, central):
        host = await radio.Host.connect(central)
        with pytest.raises(BleakGATTProtocolError):
            await host.client.write_gatt_char(wire.SCALE, b"\0\0", response=True)
        with pytest.raises(BleakGATTProtocolError):
            await host.client.read_gatt_char(wire.DATA)


async def test_pairing_is_possible_and_forgotten(on_air, radio):
    async with on_air() as (_gatt, central):
        host = await radio.Host.connect(central, pair=True)
        await host.describe()
        await host.client.unpair()
        assert not host.client.is_connected


async def test_a_closed_central_says_so(on_air, radio):
    async with on_air() as (gatt, central):
        host = await radio.Host.connect(central)
        await central.central.__aexit__(None, None, None)
        await host.until(lambda: host.gone == 1 and not gatt.connected)
        with pytest.raises(BleakError, match="closed"):
            await host.client.connect()
