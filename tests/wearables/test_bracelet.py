"""The bracelet's wire format: round trips, and nothing but samples or a WireError from any bytes."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import WireError, WireFault
from service.samples import ACCELEROMETER_ONLY, DeviceInfo, Sensor
from service.wearables import bracelet as wire
from service.wearables import bracelet_values as values

A, G, M = Sensor
HELD = [(A,), (A, G), (A, M), (A, G, M)]
"""What the samples of a packet may hold."""
i16 = st.integers(-32768, 32767)


def samples(sensors):
    return st.lists(st.tuples(*[i16] * 3 * len(sensors)), min_size=1, max_size=wire.samples_per_packet(517, sensors))


packets = st.sampled_from(HELD).flatmap(lambda sensors: st.tuples(st.just(sensors), samples(sensors)))


def ready(*, boot=1, lsb_per_g=4096, sensors=tuple(Sensor), lsb_per_rad_s=900, lsb_per_100_ut=6400):
    decoder = wire.Bracelet()
    if sensors != ACCELEROMETER_ONLY:
        told = wire.encode_sensors(sensors, lsb_per_rad_s=lsb_per_rad_s, lsb_per_100_ut=lsb_per_100_ut)
        decoder.feed(wire.SENSORS, told)
    decoder.feed(wire.SCALE, wire.encode_scale(lsb_per_g))
    decoder.feed(wire.BOOT, wire.encode_boot(boot))
    return decoder


@given(
    packet=packets,
    index=st.integers(0, 2**32 - 1),
    tick=st.integers(0, 2**40),
    boot=st.integers(0, 2**32 - 1),
    history=st.booleans(),
    lsb=st.tuples(*[st.integers(1, 65535)] * 3),
)
def test_round_trip(packet, index, tick, boot, history, lsb):
    sensors, counts = packet
    sent = wire.DataPacket(boot=boot, index=index, tick=tick, counts=counts, history=history, sensors=sensors)
    decoder = ready(boot=boot, lsb_per_g=lsb[0], lsb_per_rad_s=lsb[1], lsb_per_100_ut=lsb[2])
    block = decoder.feed(wire.DATA, wire.encode(sent))
    assert (block.boot, block.index, block.tick) == (boot, index, tick & 0xFFFF)
    assert (block.sensors, block.history) == (sensors, history)
    per_unit = {A: lsb[0], G: lsb[1], M: lsb[2] / 100}
    units = [per_unit[sensor] for sensor in sensors for _ in "xyz"]
    held = [columns for columns in (block.acc_g, block.gyro_rad_s, block.mag_ut) if columns is not None]
    columns = [column for columns in held for column in columns]
    assert list(zip(*columns, strict=True)) == [
        tuple(value / unit for value, unit in zip(sample, units, strict=True)) for sample in counts
    ]
    at_limit = [i for i, sample in enumerate(counts) if {-32768, 32767} & {*sample}]
    assert list(block.saturated) == at_limit


def test_the_table_in_bytes():
    packet = wire.DataPacket(boot=0x1FF, index=0x01020304, tick=0x50607, counts=[(1, -1, 4096)])
    assert wire.encode(packet) == bytes.fromhex("01 ff 04030201 0706 0100 ffff 0010")


def test_the_table_of_all_sensors_in_bytes():
    counts = [(1, -1, 4096, 900, 0, -2, 6400, 0, 3)]
    packet = wire.DataPacket(boot=1, index=128, tick=7, counts=counts, sensors=(A, G, M))
    data = bytes.fromhex("61 01 80000000 0700 0100 ffff 0010 8403 0000 feff 0019 0000 0300")
    assert wire.encode(packet) == data
    assert wire.encode_sensors((A, G, M), lsb_per_rad_s=900, lsb_per_100_ut=6400) == bytes.fromhex("07 8403 0019")
    block = ready().feed(wire.DATA, data)
    assert (block.gyro_rad_s[0], block.mag_ut[0]) == ([1.0], [100.0])


@pytest.mark.parametrize(
    ("mtu", "sensors", "held", "n"),
    [
        (23, (A,), (A,), 2),
        (185, (A,), (A,), 29),
        (247, (A,), (A,), 39),
        (517, (A,), (A,), 84),
        (23, (A, G), (A, G), 1),
        (23, (A, M), (A, M), 1),
        (185, (A, G), (A, G), 14),
        (23, (A, G, M), (A, G), 1),
        (28, (A, G, M), (A, G), 1),
        (29, (A, G, M), (A, G, M), 1),
        (185, (A, G, M), (A, G, M), 9),
        (517, (A, G, M), (A, G, M), 28),
    ],
)
def test_what_a_packet_holds(mtu, sensors, held, n):
    assert wire.packet_sensors(mtu, sensors) == held
    assert wire.samples_per_packet(mtu, sensors) == n
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(0,) * 3 * len(held)] * n, sensors=held)
    assert len(wire.encode(packet)) <= mtu - wire.ATT_HEADER
    assert len(wire.encode(packet)) + 6 * len(held) > mtu - wire.ATT_HEADER


def test_a_sample_is_as_wide_as_its_sensors():
    with pytest.raises(ValueError, match="three values"):
        wire.encode(wire.DataPacket(boot=0, index=0, tick=0, counts=[(0,) * 6], sensors=(A, G, M)))


def test_the_ranges_hold_a_fast_arm_and_several_earths():
    assert math.radians(2000) < 32767 / wire.DEFAULT_LSB_PER_RAD_S
    assert 32767 / wire.DEFAULT_LSB_PER_100_UT * 100 > 5 * 65


def test_values_outside_the_range_are_sent_as_its_limit():
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(40000, -40000, 0)])
    block = ready(lsb_per_g=1).feed(wire.DATA, wire.encode(packet))
    assert block.acc_g == ([32767.0], [-32768.0], [0.0])


@given(
    uuid=st.sampled_from(
        [action.characteristic for action in wire.Bracelet().handshake()],
    ),
    data=st.binary(max_size=512),
    sensors=st.sampled_from(HELD),
)
def test_any_bytes_give_a_value_or_a_wire_error(uuid, data, sensors):
    decoder = ready(sensors=sensors)
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
        (wire.DATA, bytes.fromhex("61 01 00000000 0000") + bytes(12), WireFault.LENGTH),
        (wire.DATA, bytes.fromhex("21 01 00000000 0000") + bytes(18), WireFault.LENGTH),
        (wire.SENSORS, bytes.fromhex("07 8403"), WireFault.LENGTH),
        (wire.SENSORS, bytes.fromhex("06 8403 0019"), WireFault.VALUE),
        (wire.SENSORS, bytes.fromhex("0f 8403 0019"), WireFault.VALUE),
        (wire.SENSORS, bytes.fromhex("03 0000 0019"), WireFault.VALUE),
        (wire.SENSORS, bytes.fromhex("05 8403 0000"), WireFault.VALUE),
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


@pytest.mark.parametrize("held", HELD[1:])
def test_values_without_a_scale_are_refused(held):
    packet = wire.DataPacket(boot=0, index=0, tick=0, counts=[(0,) * 3 * len(held)], sensors=held)
    with pytest.raises(WireError, match="whose scale was not told"):
        ready(sensors=(A,)).feed(wire.DATA, wire.encode(packet))


@pytest.mark.parametrize("has", HELD)
def test_what_it_measures_is_known_once_the_scale_is(has):
    """A bracelet that does not say so, as old firmware, has an accelerometer only."""
    decoder = ready(sensors=has)
    assert decoder.feed(wire.SCALE, wire.encode_scale(4096)) == DeviceInfo(lsb_per_g=4096.0, sensors=has)


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
    assert decoder.feed(wire.REGISTER, wire.encode_register(70_000)) == DeviceInfo(register_steps=70_000)
    assert decoder.feed("00002a99-0000-1000-8000-00805f9b34fb", b"x") is None


@given(st.integers(0, 2**32 - 1))
def test_only_a_bracelet_that_keeps_samples_is_asked_for_them(samples):
    decoder = wire.Bracelet()
    assert decoder.history(1, 0, 10) == ()
    assert decoder.feed(wire.HISTORY, wire.encode_history(samples)) == DeviceInfo(history_samples=samples)
    assert len(decoder.history(1, 0, 10)) == (samples > 0)
    assert decoder.history(1, 0, 0) == ()


def test_the_request_for_samples_in_bytes():
    decoder = wire.Bracelet()
    decoder.feed(wire.HISTORY, wire.encode_history(30_000))
    (write,) = decoder.history(0x01020304, 0xFFFFFFF0, 300)
    assert (write.characteristic, write.data) == (wire.CONTROL, bytes.fromhex("06 04030201 f0ffffff 2c010000"))


def test_a_host_subscribes_to_answers_then_to_data_and_begins_last():
    *_, control, _battery, _register, data, start = wire.Bracelet().handshake()
    assert (control.characteristic, data.characteristic) == (wire.CONTROL, wire.DATA)
    assert (start.characteristic, start.data, start.optional) == (wire.CONTROL, b"\x01", True)


@pytest.mark.parametrize("utc_ms", [0, 1, 1_790_000_000_123])
def test_the_devices_own_utc(utc_ms):
    assert values.decode_utc(wire.encode_utc(utc_ms)) == (utc_ms or None)


@given(st.binary(max_size=512))
def test_any_bytes_are_a_time_or_a_wire_error(data):
    try:
        utc_ms = values.decode_utc(data)
    except WireError as error:
        assert error.reason in WireFault
    else:
        assert utc_ms is None or 0 < utc_ms < values.LATEST_UTC_MS
