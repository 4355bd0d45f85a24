"""A bracelet that says nothing in the clear: bleak's own pair(), and the service's link, which pairs by itself."""

import pytest
from bleak.exc import BleakGATTProtocolError

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from service.links.ble import Backend, BleLink
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control

INSUFFICIENT_ENCRYPTION = 0x0F


@pytest.mark.full
async def test_its_own_service_is_closed_until_it_is_paired_with(on_air, radio):
    async with on_air(encrypted=True) as (_, central):
        host = await radio.Host.connect(central)
        with pytest.raises(BleakGATTProtocolError) as read:
            await host.client.read_gatt_char(wire.SCALE)
        await host.client.start_notify(wire.CONTROL, host._take)
        await host.client.start_notify(wire.DATA, host._take)
        with pytest.raises(BleakGATTProtocolError) as written:
            await host.client.write_gatt_char(wire.CONTROL, control.start().data, response=True)
        assert read.value.code == written.value.code == INSUFFICIENT_ENCRYPTION
        assert bytes(await host.client.read_gatt_char(wire.MODEL_NUMBER)) == b"simulated bracelet"
        await host.client.pair()
        await host.describe()
        assert (await host.ask(control.start())).accepted
        await host.got(20)


@pytest.mark.full
async def test_old_firmware_sends_nothing_in_the_clear_either(radio):
    bracelet = Bracelet(radio.Endless(), control=False)
    async with (
        LocalAir() as air,
        air.bracelet(bracelet, speed=20, encrypted=True) as gatt,
        air.central() as central,
    ):
        host = await radio.Host.connect(central)
        await host.client.start_notify(wire.DATA, host._take)
        measured = gatt.statistics().measured
        await radio.until(lambda: gatt.statistics().measured > measured + 50)
        assert (host.blocks, gatt.statistics().packets) == ([], 0)


async def test_the_services_link_pairs_once_and_goes_on(radio):
    async with (
        LocalAir() as air,
        air.bracelet(Bracelet(radio.Endless()), speed=20, encrypted=True) as gatt,
        air.central() as central,
    ):
        backend = Backend(scanner=central.scanner, client=central.client)
        for _ in range(2):
            async with BleLink(await radio.seen(central), wire.Bracelet().handshake(), backend) as link:
                packets = []
                async for packet in link:
                    packets.append(packet.characteristic)
                    if packets.count(wire.DATA) == 10:
                        break
            assert packets[:2] == [wire.DEVICE_ID, wire.BOOT]
        assert gatt.statistics().links == 2
