import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from device_sim.bracelet import BUFFER_SAMPLES, Bracelet, quantise
from service.errors import ParameterError
from service.samples import ACCELEROMETER_ONLY
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
    bracelet = Bracelet(radio.Known(13))
    assert bracelet.measure(20) == 13
    assert bracelet.ended
    assert [len(block) for block in drain(bracelet, host(bracelet))] == [10, 3]


def test_what_nobody_takes_is_lost_and_its_numbers_are_not_given_again(radio):
    bracelet = Bracelet(radio.Known(100))
    bracelet.measure(25)
    bracelet.discard()
    bracelet.measure(10)
    assert [block.index for block in drain(bracelet, host(bracelet))] == [25]
    assert (bracelet.statistics().lost, bracelet.statistics().sent) == (25, 10)


def test_a_full_buffer_loses_the_oldest(radio):
    bracelet = Bracelet(radio.Endless())
    bracelet.measure(BUFFER_SAMPLES + 30)
    assert bracelet.statistics().lost == 30
    assert drain(bracelet, host(bracelet))[0].index == 30


def test_values_beyond_the_range_are_sent_as_its_limit():
    class Shaken:
        rate_hz = 50.0
        sensors = ACCELEROMETER_ONLY

        def read(self, n):
            return np.tile([9.0, -9.0, 1.0], (n, 1))

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
    bracelet = Bracelet(radio.Endless(), index=2**32 - 10)
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
