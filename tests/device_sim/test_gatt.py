"""The bracelet on the air: its time, its silences and its faults."""

import asyncio
import math
import time

import numpy as np
import pytest

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet, quantise
from device_sim.gatt import GattBracelet, Start
from service.errors import ParameterError, WireError
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control


async def test_time_goes_on_while_nobody_listens(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless()), speed=20) as gatt, air.central() as central:
        await radio.until(lambda: gatt.statistics().measured >= 200)
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(100)
        assert host.blocks[0].index >= 200
        statistics = gatt.statistics()
        assert (statistics.lost, statistics.waiting >= 200) == (0, True)
        assert statistics.measured == statistics.sent + statistics.lost + statistics.waiting


@pytest.mark.parametrize("speed", [50, math.inf])
async def test_a_source_may_wait_for_the_first_subscriber(radio, speed):
    source = radio.Known(205)
    bracelet = Bracelet(source)
    async with (
        LocalAir() as air,
        air.bracelet(bracelet, speed=speed, start="on_subscribe") as gatt,
        air.central() as central,
    ):
        host = await radio.Host.connect(central)
        await host.describe()
        await asyncio.sleep(0.05)
        assert gatt.statistics().measured == 0
        await host.subscribe()
        await asyncio.wait_for(gatt.played.wait(), 2)
        await host.got(205)
        assert np.array_equal(np.rint(host.acc_g() * 4096), quantise(source.acc_g, 4096))
        assert bytes(await host.client.read_gatt_char(wire.BATTERY_LEVEL)) == b"\x64"  # played, but alive


async def test_speed_is_device_seconds_per_second_without_drift(radio):
    async with (
        LocalAir() as air,
        air.bracelet(Bracelet(radio.Known(1000)), speed=40, start=Start.ON_SUBSCRIBE) as gatt,
        air.central() as central,
    ):
        host = await radio.Host.connect(central)
        await host.describe()
        began = time.perf_counter()
        await host.subscribe()
        await asyncio.wait_for(gatt.played.wait(), 5)
        assert 0.48 <= time.perf_counter() - began < 1.0  # 1000 samples at 50 Hz × 40


async def test_a_speed_beyond_the_machine_lags_and_leaves_the_loop_free(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless()), speed=1e9) as gatt, air.central() as central:
        await asyncio.wait_for(radio.seen(central), 2)
        assert gatt.statistics().measured > 10_000


async def test_a_stall_of_the_process_loses_nothing(radio):
    bracelet = Bracelet(radio.Endless(), packet_samples=10)
    async with LocalAir() as air, air.bracelet(bracelet) as gatt, air.central() as central:
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(10)
        time.sleep(1.0)  # noqa: ASYNC251  # the point: nothing runs meanwhile
        await host.got(60, within_s=0.5)
        indices = [block.index for block in host.blocks]
        assert np.diff(indices).tolist() == [10] * (len(indices) - 1)
        assert gatt.connected


async def test_flat_out_stands_still_between_subscribers(radio):
    source = radio.Known(30_000)
    async with LocalAir() as air, air.bracelet(Bracelet(source), speed=math.inf) as gatt, air.central() as central:
        first = await radio.Host.connect(central)
        await first.subscribe()
        await first.got(500)
        await gatt.drop_link()
        measured = gatt.statistics().measured
        await asyncio.sleep(0.05)
        assert gatt.statistics().measured == measured < 30_000
        second = await radio.Host.connect(central)
        await second.subscribe()
        await second.got(500)
        assert 0 <= second.blocks[0].index - (first.blocks[-1].index + 8) <= 200  # what was on its way was lost


async def test_silence_keeps_the_link_and_loses_what_is_measured(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless()), speed=20) as gatt, air.central() as central:
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(50)
        gatt.silence()
        await asyncio.sleep(0.01)
        before = host.samples
        await asyncio.sleep(0.1)
        assert (host.samples, host.client.is_connected) == (before, True)
        gatt.speak()
        await host.got(before + 50)
        assert max(np.diff([block.index for block in host.blocks])) > 50


async def test_a_corrupt_packet_is_one_bad_packet(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless()), speed=20) as gatt, air.central() as central:
        host = await radio.Host.connect(central)
        await host.describe()
        results = []

        def take(characteristic, data):
            try:
                results.append(host.decoder.feed(characteristic.uuid, bytes(data)))
            except WireError as error:
                results.append(error.reason)

        await host.client.start_notify(wire.DATA, take)
        await host.client.start_notify(wire.CONTROL, lambda *_: None)
        await host.client.write_gatt_char(wire.CONTROL, control.start().data, response=True)
        await radio.until(lambda: results)
        gatt.corrupt_next(2)
        await radio.until(lambda: len([result for result in results if isinstance(result, str)]) == 2)
        count = len(results)
        await radio.until(lambda: len(results) >= count + 5)
        bad = [place for place, result in enumerate(results) if isinstance(result, str)]
        assert len(bad) == 2
        assert bad[1] == bad[0] + 1


async def test_packets_are_lost_and_doubled_as_a_test_wants(radio):
    bracelet = Bracelet(radio.Known(100), packet_samples=10)
    async with (
        LocalAir() as air,
        air.bracelet(bracelet, speed=math.inf, start=Start.ON_SUBSCRIBE) as gatt,
        air.central() as central,
    ):
        fates = iter([1, 0, 2] + [1] * 7)
        gatt.distort = lambda packet: [packet] * next(fates)
        host = await radio.Host.connect(central)
        await host.subscribe()
        await asyncio.wait_for(gatt.played.wait(), 2)
        await host.got(100)
        assert [block.index for block in host.blocks] == [0, 20, 20, *range(30, 100, 10)]


async def test_a_reboot_ends_the_link_and_begins_a_new_count(radio):
    bracelet = Bracelet(radio.Endless(), boot=7)
    async with LocalAir() as air, air.bracelet(bracelet, speed=20) as gatt, air.central() as central:
        host = await radio.Host.connect(central)
        await host.subscribe()
        await host.got(100)
        await gatt.reboot()
        await radio.until(lambda: host.gone)
        again = await radio.Host.connect(central)
        await again.subscribe()
        await again.got(10)
        assert (host.blocks[-1].boot, again.blocks[0].boot) == (7, 8)
        assert gatt.statistics().links == 2


async def test_the_battery_is_told(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless())) as gatt, air.central() as central:
        await gatt.set_battery(90)  # nobody listens yet
        host = await radio.Host.connect(central)
        levels = []
        await host.client.start_notify(wire.BATTERY_LEVEL, lambda _, data: levels.append(data[0]))
        await gatt.set_battery(41)
        await radio.until(lambda: levels == [41])
        assert (await host.describe())[wire.BATTERY_LEVEL].battery_percent == 41


@pytest.mark.parametrize(
    "wrong", [{"name": "ninebytes"}, {"name": ""}, {"speed": 0}, {"speed": math.nan}, {"max_mtu": 22}, {"max_mtu": 518}]
)
async def test_parameters_out_of_range_are_refused_before_the_air(radio, wrong):
    with pytest.raises(ParameterError):
        GattBracelet(Bracelet(radio.Endless()), LocalAir(), **wrong)


async def test_a_bracelet_may_be_entered_and_left_with_no_host(radio):
    async with LocalAir() as air:
        for _ in range(3):
            async with air.bracelet(Bracelet(radio.Endless())) as gatt:
                assert not gatt.connected
                await gatt.drop_link()
        assert air.statistics() == {"radios": 0, "links": 0}


async def test_an_error_of_the_source_is_raised_where_the_bracelet_is_left(radio):
    class Broken(radio.Endless):
        def read(self, _n):
            raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        async with LocalAir() as air, air.bracelet(Bracelet(Broken())):
            await asyncio.sleep(0.05)
