import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from device_sim.bracelet import BUFFER_SAMPLES, Bracelet, quantise
from service.errors import ParameterError
from service.samples import ACCELEROMETER_ONLY, Sensor
from service.wearables import bracelet as wire


def host(bracelet):
    decoder = wire.Bracelet()
    decoder.feed(wire.SCALE, bracelet.scale_value())
    decoder.feed(wire.BOOT, bracelet.boot_value())
    return decoder


def drain(bracelet, decoder, mtu=517):
    blocks = []
    while (packet := bracelet.next_packet(mtu)) is not None:
        assert len(packet) <= mtu - wire.ATT_HEADER
        blocks.append(decoder.feed(wire.DATA, packet))
    return blocks


def counts(blocks, lsb_per_g=4096):
    return np.rint(np.concatenate([np.transpose(block.acc_g) for block in blocks]) * lsb_per_g)


@given(
    n=st.integers(0, 400),
    chunks=st.lists(st.integers(0, 60), min_size=1, max_size=20),
    mtus=st.lists(st.integers(23, 517), min_size=1, max_size=5),
    packet_samples=st.integers(0, 100),
    rate_hz=st.sampled_from([12.5, 25.0, 50.0, 52.0, 100 / 3]),
)
def test_any_chunks_and_mtus_give_every_sample_once(radio_known, n, chunks, mtus, packet_samples, rate_hz):
    source = radio_known(n, rate_hz=rate_hz)
    bracelet = Bracelet(source, packet_samples=packet_samples)
    decoder, blocks = host(bracelet), []
    turn = 0
    while not bracelet.ended:
        bracelet.measure(chunks[turn % len(chunks)] or 7)
        blocks += drain(bracelet, decoder, mtus[turn % len(mtus)])
        turn += 1
    expected = quantise(source.acc_g, 4096)
    assert [block.index for block in blocks] == np.cumsum([0, *map(len, blocks)])[:-1].tolist()
    assert np.array_equal(counts(blocks) if blocks else expected[:0], expected)
    for block in blocks:
        assert block.tick == int(1024 * (block.index // 128 * 128) / rate_hz + 1e-9) & 0xFFFF
    assert bracelet.statistics().sent == n


@pytest.fixture(scope="module")
def radio_known():
    class Source:
        sensors = ACCELEROMETER_ONLY

        def __init__(self, n, rate_hz=50.0):
            self.rate_hz = rate_hz
            self.acc_g = np.random.default_rng(n).uniform(-7.9, 7.9, (n, 3))
            self.taken = 0

        def read(self, n):
            block = self.acc_g[self.taken : self.taken + n]
            self.taken += len(block)
            return block

        def true_steps_until(self, _t_s):
            return None

    return Source


@pytest.mark.parametrize(
    ("mtu", "packet_samples", "expected"), [(23, 10, 2), (517, 10, 10), (517, 0, 84), (100, 0, 14)]
)
def test_a_packet_holds_what_fits_but_no_more_than_asked(radio, mtu, packet_samples, expected):
    bracelet = Bracelet(radio.Known(200), packet_samples=packet_samples)
    assert bracelet.wanting(mtu) == expected
    bracelet.measure(expected - 1)
    assert bracelet.next_packet(mtu) is None
    bracelet.measure(1)
    assert len(drain(bracelet, host(bracelet), mtu)[0]) == expected


def test_the_end_of_the_source_sends_the_rest(radio):
    bracelet = Bracelet(radio.Known(13), packet_samples=10)
    assert bracelet.measure(20) == 13
    assert bracelet.ended
    assert [len(block) for block in drain(bracelet, host(bracelet))] == [10, 3]


@pytest.mark.parametrize(("history_s", "lost"), [(0, 25), (0.4, 5), (600, 0)])
def test_what_nobody_takes_is_kept_while_there_is_room_and_its_numbers_are_not_given_again(radio, history_s, lost):
    bracelet = Bracelet(radio.Known(100), packet_samples=10, history_s=history_s)
    bracelet.measure(25)
    bracelet.discard()
    statistics = bracelet.statistics()
    assert (statistics.lost, statistics.waiting) == (lost, 25 - lost)
    bracelet.measure(10)
    assert [block.index for block in drain(bracelet, host(bracelet))] == [25]
    assert (bracelet.statistics().lost, bracelet.statistics().sent) == (lost, 10)


@pytest.mark.parametrize(("history_s", "lost"), [(0, 30), (600, 0)])
def test_what_waits_too_long_for_the_radio_is_left_to_history(radio, history_s, lost):
    bracelet = Bracelet(radio.Endless(), history_s=history_s)
    bracelet.measure(BUFFER_SAMPLES + 30)
    assert bracelet.statistics().lost == lost
    assert drain(bracelet, host(bracelet))[0].index == 30


def test_values_beyond_the_range_are_sent_as_its_limit():
    class Shaken:
        rate_hz = 50.0
        sensors = ACCELEROMETER_ONLY

        def read(self, n):
            return np.tile([9.0, -9.0, 1.0], (n, 1))

        def true_steps_until(self, _t_s):
            return 0

    bracelet = Bracelet(Shaken())
    bracelet.measure(10)
    assert counts(drain(bracelet, host(bracelet)))[0].tolist() == [32767, -32768, 4096]
    assert bracelet.statistics().saturated == 10


def test_a_reset_counts_from_zero_under_the_next_boot_number(radio):
    bracelet = Bracelet(radio.Endless(), boot=0xFFFFFFFF)
    bracelet.measure(300)
    bracelet.reset()
    assert bracelet.boot == 0
    assert bracelet.clock_value() == wire.encode_clock(0, 0)
    bracelet.measure(10)
    block = drain(bracelet, host(bracelet))[0]
    assert (block.boot, block.index, block.tick) == (0, 0, 0)


def test_the_index_wraps_and_the_tick_goes_on(radio):
    bracelet = Bracelet(radio.Endless(), index=2**32 - 10, packet_samples=10)
    decoder = host(bracelet)
    bracelet.measure(20)
    before, after = drain(bracelet, decoder)
    assert (before.index, after.index) == (2**32 - 10, 0)
    assert after.tick == 1024 * 2**32 // 50 & 0xFFFF
    info = decoder.feed(wire.CLOCK, bracelet.clock_value())
    assert info.clock == (0, 1024 * 2**32 // 50)


def test_the_clock_tells_the_full_tick_of_the_newest_tick_sample(radio):
    bracelet = Bracelet(radio.Endless(rate_hz=12.5))
    bracelet.measure(128)
    assert bracelet.clock_value() == wire.encode_clock(0, 0)
    bracelet.measure(1)
    assert bracelet.clock_value() == wire.encode_clock(128, 10485)


@pytest.mark.parametrize(
    "wrong",
    [{"device_id": ""}, {"device_id": "é" * 11}, {"lsb_per_g": 0}, {"lsb_per_g": 65536}, {"packet_samples": -1}],
)
def test_parameters_out_of_range_are_refused(radio, wrong):
    with pytest.raises(ParameterError):
        Bracelet(radio.Endless(), **wrong)


@pytest.mark.parametrize("rate_hz", [0.5, 401.0])
def test_a_rate_the_format_cannot_tell_is_refused(radio, rate_hz):
    with pytest.raises(ParameterError):
        Bracelet(radio.Endless(rate_hz=rate_hz))


def turned(n, sensors, seed=0):
    """A source whose samples hold `sensors`, within their ranges."""
    ranges = {Sensor.ACCELEROMETER: 7.9, Sensor.GYROSCOPE: 36.0, Sensor.MAGNETOMETER: 500.0}

    class Source:
        rate_hz = 50.0
        taken = 0

        def read(self, n):
            block = self.values[self.taken : self.taken + n]
            self.taken += len(block)
            return block

        def true_steps_until(self, _t_s):
            return None

    Source.sensors = sensors
    rng = np.random.default_rng(seed)
    Source.values = np.hstack([rng.uniform(-ranges[sensor], ranges[sensor], (n, 3)) for sensor in sensors])
    return Source()


def all_values(block):
    held = [columns for columns in (block.acc_g, block.gyro_rad_s, block.mag_ut) if columns is not None]
    return np.transpose([column for columns in held for column in columns])


@given(sensors=st.sampled_from([tuple(Sensor), tuple(Sensor)[:2]]), mtu=st.integers(29, 517), n=st.integers(1, 90))
def test_every_sensor_is_sent_to_half_a_bit(sensors, mtu, n):
    source = turned(n, sensors)
    bracelet = Bracelet(source)
    decoder = host(bracelet)
    assert decoder.feed(wire.SENSORS, bracelet.sensors_value()).sensors == sensors
    bracelet.measure(n + 1)
    blocks = drain(bracelet, decoder, mtu)
    assert [block.sensors for block in blocks] == [sensors] * len(blocks)
    half_bits = np.repeat([0.5 / 4096, 0.5 / 900, 0.5 / 64][: len(sensors)], 3)
    assert (np.abs(np.concatenate([all_values(block) for block in blocks]) - source.values) <= half_bits + 1e-12).all()


def test_what_has_no_room_is_left_out_of_the_packet_and_comes_back_with_a_larger_mtu():
    bracelet = Bracelet(turned(40, tuple(Sensor)), packet_samples=10)
    decoder = host(bracelet)
    decoder.feed(wire.SENSORS, bracelet.sensors_value())
    bracelet.measure(20)
    small = drain(bracelet, decoder, 23)
    assert [(block.index, len(block), block.sensors) for block in small] == [
        (i, 1, tuple(Sensor)[:2]) for i in range(20)
    ]
    bracelet.measure(20)
    large = drain(bracelet, decoder, 185)
    assert [(block.index, len(block), block.sensors) for block in large] == [
        (20, 9, tuple(Sensor)),
        (29, 9, tuple(Sensor)),
    ]


def test_a_turn_beyond_the_range_is_sent_as_its_limit():
    source = turned(10, tuple(Sensor)[:2])
    source.values[3, 4] = 40.0
    bracelet = Bracelet(source)
    decoder = host(bracelet)
    decoder.feed(wire.SENSORS, bracelet.sensors_value())
    bracelet.measure(10)
    (block,) = drain(bracelet, decoder)
    assert list(block.saturated) == [3]
    assert block.gyro_rad_s[1][3] == 32767 / 900
    assert bracelet.statistics().saturated == 1
