"""Control point and history over real GATT with bleak's own API."""

import asyncio

import numpy as np
import pytest
from bleak.exc import BleakGATTProtocolError

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet, quantise
from service.links.ble import Backend, BleLink
from service.samples import DeviceInfo, RawBlock, Reply
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control
from service.wearables.bracelet_values import decode_utc


@pytest.fixture
def stage(radio):
    """A function: an async context of (gatt, host) whose host has enabled answers and data, and has not begun."""
    return lambda **options: Stage(radio, **options)


class Stage:
    def __init__(self, radio, *, source=None, speed=20, max_mtu=517, **options):
        self._radio = radio
        self._bracelet = Bracelet(source or radio.Endless(), **options)
        self._air, self._how = LocalAir(), {"speed": speed, "max_mtu": max_mtu}

    async def __aenter__(self):
        await self._air.__aenter__()
        self.gatt = await self._air.bracelet(self._bracelet, **self._how).__aenter__()
        self._central = self._air.central()
        host = await self._radio.Host.connect(await self._central.__aenter__())
        await host.describe()
        await host.enable_answers()
        await host.client.start_notify(wire.DATA, host._take)
        return self.gatt, host

    async def __aexit__(self, *error):
        await self._central.__aexit__(*error)
        await self.gatt.__aexit__(*error)
        await self._air.__aexit__(*error)


def code(caught):
    return caught.value.code


async def write(host, request):
    await host.client.write_gatt_char(wire.CONTROL, getattr(request, "data", request), response=True)


@pytest.mark.full
async def test_data_comes_between_start_and_stop(stage):
    async with stage() as (gatt, host):
        await asyncio.sleep(0.1)
        assert (host.blocks, gatt.subscribed) == ([], False)
        assert (await host.ask(control.start())).accepted
        await host.got(50)
        assert (await host.ask(control.stop())).accepted
        before = host.samples
        await asyncio.sleep(0.1)
        assert host.samples == before
        assert (await host.ask(control.start())).accepted
        await host.got(before + 20)
        assert max(np.diff([block.index for block in host.blocks])) > 20  # what was measured meanwhile is history


@pytest.mark.full
async def test_a_rate_is_a_new_numbering_and_what_it_says_is_so(stage):
    async with stage(speed=8) as (gatt, host):
        said = await host.ask(control.set_rate(100.0))
        assert (said.request, said.accepted) == ("rate", True)
        infos = await host.describe()
        assert (infos[wire.RATE].rate_hz, infos[wire.BOOT].boot) == (100.0, 2)
        await host.ask(control.start())
        began, first = asyncio.get_running_loop().time(), gatt.statistics().measured
        await asyncio.sleep(0.4)
        took = asyncio.get_running_loop().time() - began
        assert gatt.statistics().measured - first == pytest.approx(800 * took, rel=0.2)
        assert {block.boot for block in host.blocks} == {2}
        assert not (await host.ask(control.set_range(16))).accepted


async def test_a_range_is_a_new_scale(stage, radio):
    class Leaning(radio.Endless):
        def read(self, n):
            return super().read(n) * 0 + [0.25, -1.5, 0.5]

    async with stage(source=Leaning()) as (_, host):
        assert (await host.ask(control.set_range(2))).accepted
        assert (await host.describe())[wire.SCALE].lsb_per_g == 16384
        await host.ask(control.start())
        await host.got(10)
        assert np.unique(host.acc_g(), axis=0).tolist() == [[0.25, -1.5, 0.5]]


async def test_what_is_refused_is_answered_why(stage):
    async with stage() as (_, host):
        await write(host, b"\x42")
        await host.until(lambda: host.replies)
        assert "no such request" in host.replies[-1].why
        await write(host, b"\x03\x01\x00")
        await host.until(lambda: len(host.replies) == 2)
        assert (host.replies[-1].request, host.replies[-1].accepted) == ("rate", False)
        with pytest.raises(BleakGATTProtocolError) as empty:
            await write(host, b"")
        assert code(empty) == 0x0D


async def test_no_request_is_taken_while_indications_are_off(stage):
    async with stage() as (gatt, host):
        await host.client.stop_notify(wire.CONTROL)
        with pytest.raises(BleakGATTProtocolError) as off:
            await write(host, control.start())
        assert code(off) == 0xFD
        assert not gatt.subscribed


@pytest.mark.parametrize("max_mtu", [23, 517])
@pytest.mark.full
async def test_history_is_sample_for_sample_what_live_data_was(stage, radio, max_mtu):
    source = radio.Known(3000)
    async with stage(source=source, speed=40, max_mtu=max_mtu) as (gatt, host):
        await host.ask(control.start())
        await host.got(600)
        live = {block.index + k: block for block in host.blocks for k in range(len(block))}
        reply = await host.ask(control.report(1, 0, 2**32 - 1))
        assert (reply.request, reply.accepted, reply.boot, reply.first) == ("history", True, 1, 0)
        assert reply.samples >= 600
        assert sum(map(len, host.again)) == reply.samples
        assert [block.index for block in host.again] == [0, *np.cumsum([len(block) for block in host.again])[:-1]]
        assert len(host.again[0]) == wire.samples_per_packet(max_mtu)
        got = np.concatenate([np.transpose(block.acc_g) for block in host.again])
        assert np.array_equal(np.rint(got * 4096), quantise(source.acc_g[: reply.samples], 4096))
        for block in host.again:
            for k in range(len(block)):
                if (was := live.get(block.index + k)) is not None:
                    at = block.index + k - was.index
                    assert [column[k] for column in block.acc_g] == [column[at] for column in was.acc_g]
        await host.until(lambda: gatt.statistics().packets_again == len(host.again))


@pytest.mark.full
async def test_live_data_goes_on_while_history_is_sent(stage):
    async with stage(speed=20, max_mtu=23) as (gatt, host):
        gatt.bracelet.measure(20_000)
        await host.ask(control.start())
        await host.got(20)
        before = host.samples
        reply = await host.ask(control.report(1, 0, 20_000), within_s=20)
        assert reply.samples == 20_000
        assert host.samples > before + 20
        assert np.diff([block.index for block in host.blocks]).tolist() == [2] * (len(host.blocks) - 1)
        assert gatt.statistics().lost == 0


async def test_only_abort_is_taken_while_a_report_goes_on(stage):
    async with stage(max_mtu=23) as (gatt, host):
        gatt.bracelet.measure(20_000)
        await write(host, control.report(1, 0, 20_000))
        await host.until(lambda: host.again)
        with pytest.raises(BleakGATTProtocolError) as busy:
            await write(host, control.stop())
        assert code(busy) == 0xFE
        assert (await host.ask(control.abort())).request == "abort"
        sent = sum(map(len, host.again))
        await asyncio.sleep(0.05)
        assert sum(map(len, host.again)) == sent < 20_000
        assert len(host.replies) == 1
        assert (await host.ask(control.start())).accepted


async def test_a_range_that_is_partly_gone_and_one_of_another_boot(stage):
    async with stage(history_s=10) as (gatt, host):
        gatt.bracelet.measure(800)
        reply = await host.ask(control.report(1, 100, 500))
        assert reply.first >= 300
        assert reply.first + reply.samples == 600
        assert sum(map(len, host.again)) == reply.samples
        other = await host.ask(control.report(0, 100, 500))
        assert (other.accepted, other.boot, other.first, other.samples) == (True, 0, 100, 0)
        extent = await host.ask(control.report_extent())
        assert (extent.boot, extent.samples) == (1, 500)


@pytest.mark.full
async def test_what_was_measured_out_of_range_is_asked_for_and_complete(stage, radio):
    source = radio.Known(20_000)
    async with stage(source=source, speed=40) as (gatt, host):
        await host.ask(control.start())
        await host.got(100)
        await gatt.drop_link()
        await host.until(lambda: host.gone)
        await asyncio.sleep(0.3)
        again = await radio.Host.connect(host.central)
        await again.subscribe()
        await again.got(50)
        last, first = host.blocks[-1].index + len(host.blocks[-1]), again.blocks[0].index
        assert first > last + 100
        reply = await again.ask(control.report(1, last, first - last))
        assert (reply.first, reply.samples) == (last, first - last)
        got = np.concatenate([np.transpose(block.acc_g) for block in again.again])
        assert np.array_equal(np.rint(got * 4096), quantise(source.acc_g[last:first], 4096))
        assert gatt.statistics().lost == 0


async def test_the_services_link_asks_and_is_answered(radio):
    async with (
        LocalAir() as air,
        air.bracelet(Bracelet(radio.Endless()), speed=20) as gatt,
        air.central() as central,
    ):
        gatt.bracelet.measure(500)
        wearable, said = wire.Bracelet(), []
        backend = Backend(scanner=central.scanner, client=central.client)
        async with BleLink(await radio.seen(central), wearable.handshake(), backend) as link:
            async for packet in link:
                said.append(wearable.feed(packet.characteristic, packet.data))
                if said[-1] == Reply(request="start", accepted=True):
                    (request,) = wearable.history(1, 100, 300)
                    await link.request(request)
                if isinstance(said[-1], Reply) and said[-1].request == "history":
                    break
        assert said[-1] == Reply(request="history", accepted=True, boot=1, first=100, samples=300)
        blocks = [one for one in said if isinstance(one, RawBlock)]
        assert sum(len(block) for block in blocks if block.history) == 300
        assert any(isinstance(one, DeviceInfo) and one.history_samples == 30_000 for one in said)


@pytest.mark.full
async def test_a_report_ends_with_its_listener_and_with_its_link(stage, radio):
    async with stage(max_mtu=23) as (gatt, host):
        gatt.bracelet.measure(20_000)
        await write(host, control.report(1, 0, 20_000))
        await host.until(lambda: host.again)
        await host.client.stop_notify(wire.DATA)
        await host.until(lambda: host.replies)
        assert (host.replies[-1].request, host.replies[-1].accepted) == ("history", False)
        await host.client.start_notify(wire.DATA, host._take)
        await write(host, control.report(1, 0, 20_000))
        await gatt.drop_link()
        await host.until(lambda: host.gone)
        again = await radio.Host.connect(host.central)
        await again.subscribe()
        await again.got(50)
        assert again.again == []


@pytest.mark.full
async def test_old_firmware_streams_to_whoever_subscribes(radio):
    async with LocalAir() as air, air.central() as central:
        bracelet = Bracelet(radio.Endless(), control=False)
        async with air.bracelet(bracelet, speed=20) as gatt:
            host = await radio.Host.connect(central)
            infos = await host.describe()
            assert wire.HISTORY not in infos
            assert host.decoder.history(1, 0, 100) == ()
            await host.client.start_notify(wire.DATA, host._take)
            await host.got(50)
            await radio.until(lambda: gatt.subscribed)


async def test_the_clock_that_a_host_sets_is_the_one_it_reads(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless())) as _, air.central() as central:
        host = await radio.Host.connect(central)
        assert decode_utc(bytes(await host.client.read_gatt_char(wire.UTC))) is None
        await host.enable_answers()
        assert (await host.ask(control.set_time(1_790_000_000_000))).request == "time"
        told_ms = decode_utc(bytes(await host.client.read_gatt_char(wire.UTC)))
        assert 0 <= told_ms - 1_790_000_000_000 < 5000
