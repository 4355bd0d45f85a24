"""The bracelet's wire format: round trips, and nothing but samples or a WireError from any bytes."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import WireError, WireFault
from service.samples import DeviceInfo
from service.wearables import bracelet as wire

i16 = st.integers(-32768, 32767)
samples = st.lists(st.tuples(i16, i16, i16), min_size=1, max_size=84)


def ready(*, boot=1, lsb_per_g=4096):
    decoder = wire.Bracelet()
    decoder.feed(wire.SCALE, wire.encode_scale(lsb_per_g))
    decoder.feed(wire.BOOT, wire.encode_boot(boot))
    return decoder


@given(
    counts=samples,
    index=st.integers(0, 2**32 - 1),
    tick=st.integers(0, 2**40),
    boot=st.integers(0, 2**32 - 1),
    history=st.booleans(),
    lsb_per_g=st.integers(1, 65535),
)
def test_round_trip(counts, index, tick, boot, history, lsb_per_g):
    packet = wire.DataPacket(boot=boot, index=index, tick=tick, counts=counts, history=history)
    block = ready(boot=boot, lsb_per_g=lsb_per_g).feed(wire.DATA, wire.encode(packet))
    assert (block.boot, block.index, block.tick) == (boot, index, tick & 0xFFFF)
    assert list(zip(*block.acc_g, strict=True)) == [tuple(v / lsb_per_g for v in xyz) for xyz in counts]


def test_the_table_in_bytes():
    packet = wire.DataPacket(boot=0x1FF, index=0x01020304, tick=0x50607, counts=[(1, -1, 4096)])
    assert wire.encode(packet) == bytes.fromhex("01 ff 04030201 0706 0100 ffff 0010")


@pytest.mark.parametrize(("mtu", "n"), [(23, 2), (185, 29), (247, 39), (517, 84)])
def test_samples_per_packet(mtu, n):
    assert wire.samples_per_packet(mtu) == n
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(0, 0, 0)] * n)
    assert len(wire.encode(packet)) <= mtu - wire.ATT_HEADER


def test_values_outside_the_range_are_sent_as_its_limit():
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(40000, -40000, 0)])
    block = ready(lsb_per_g=1).feed(wire.DATA, wire.encode(packet))
    assert block.acc_g == ([32767.0], [-32768.0], [0.0])


@given(
    uuid=st.sampled_from([wire.DATA, wire.SCALE, wire.RATE, wire.BOOT, wire.DEVICE_ID, wire.CLOCK, wire.BATTERY_LEVEL]),
    data=st.binary(max_size=512),
)
def test_any_bytes_give_a_value_or_a_wire_error(uuid, data):
    decoder = ready()
    try:
        assert decoder.feed(uuid, data) is not None
    except WireError as error:
        assert error.reason in WireFault


@pytest.mark.parametrize(
    ("uuid", "data", "reason"),
    [
        (wire.DATA, b"", WireFault.LENGTH),
        (wire.DATA, bytes.fromhex("01 01 00000000 0000"), WireFault.LENGTH),
        (wire.DATA, bytes.fromhex("01 01 00000000 0000 0000 0000 00"), WireFault.LENGTH),
        (wire.DATA, bytes.fromhex("02 01 00000000 0000 0000 0000 0000"), WireFault.VERSION),
        (wire.DATA, bytes.fromhex("81 01 00000000 0000 0000 0000 0000"), WireFault.VERSION),
        (wire.SCALE, struct.pack("<H", 0), WireFault.VALUE),
        (wire.RATE, struct.pack("<H", 99), WireFault.VALUE),
        (wire.CLOCK, struct.pack("<IQ", 100, 0), WireFault.VALUE),
        (wire.CLOCK, struct.pack("<IQ", 128, 1 << 42), WireFault.VALUE),
        (wire.BATTERY_LEVEL, b"\x65", WireFault.VALUE),
        (wire.DEVICE_ID, b"a/b", WireFault.VALUE),
        (wire.DEVICE_ID, b"", WireFault.VALUE),
        (wire.DEVICE_ID, b"\xff", WireFault.VALUE),
        (wire.BOOT, b"\x01", WireFault.LENGTH),
    ],
)
def test_what_is_refused(uuid, data, reason):
    with pytest.raises(WireError) as caught:
        ready().feed(uuid, data)
    assert caught.value.reason is reason


def test_data_before_the_scale_is_refused():
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(0, 0, 0)])
    with pytest.raises(WireError, match="before the scale"):
        wire.Bracelet().feed(wire.DATA, wire.encode(packet))


def test_a_reset_counts_the_boot_upwards():
    decoder = ready(boot=0x1FF)
    packet = wire.DataPacket(boot=0x200, index=0, tick=0, counts=[(0, 0, 0)])
    assert decoder.feed(wire.DATA, wire.encode(packet)).boot == 0x200


def test_what_a_device_says_of_itself():
    decoder = wire.Bracelet()
    assert decoder.feed(wire.RATE, wire.encode_rate(12.5)) == DeviceInfo(rate_hz=12.5)
    assert decoder.feed(wire.CLOCK, wire.encode_clock(256, 2**33)) == DeviceInfo(clock=(256, 2**33))
    assert decoder.feed(wire.BATTERY_LEVEL, b"\x57") == DeviceInfo(battery_percent=87)
    assert decoder.feed(wire.MANUFACTURER_NAME, "Größe".encode()) == DeviceInfo(manufacturer="Größe")
    assert decoder.feed("00002a99-0000-1000-8000-00805f9b34fb", b"x") is None
