"""The control point without its radio: what it carries out, what it refuses, and reports against the ring."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from device_sim.bracelet import BUFFER_SAMPLES, Bracelet, quantise
from device_sim.control_point import ControlPoint, RefusedError
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control
from service.wearables.bracelet_control import Answer, AttFault, Op, Records, Result

U32 = 2**32


def asked(point, write, **enabled):
    return point.take(write.data, **({"indications": True, "notifications": True} | enabled))


def ask(point, write):
    """Ask, and confirm the answer if it comes at once."""
    answer = asked(point, write)
    if answer is not None:
        point.confirmed()
    return answer


def report(bracelet, point, records, mtu=517):
    """Ask for records; return the blocks that came and the answer."""
    decoder = wire.Bracelet()
    decoder.feed(wire.SCALE, bracelet.scale_value())
    decoder.feed(wire.BOOT, bracelet.boot_value())
    answer, blocks = ask(point, control.report(*records)), []
    while answer is None:
        part = point.next_part(mtu)
        if isinstance(part, Answer):
            answer = part
            point.confirmed()
        else:
            assert len(part) <= mtu - wire.ATT_HEADER
            blocks.append(decoder.feed(wire.DATA, part))
    return blocks, answer


@pytest.fixture
def bracelet(radio):
    made = Bracelet(radio.Endless(), boot=7)
    made.measure(1000)
    return made


@pytest.fixture
def point(bracelet):
    return ControlPoint(bracelet)


def test_it_streams_from_the_newest_sample_on_between_start_and_stop(bracelet, point):
    assert not point.streaming
    assert ask(point, control.start()) == Answer(op=Op.START, result=Result.SUCCESS)
    assert point.streaming
    bracelet.measure(8)
    assert wire.Bracelet().feed(wire.BOOT, bracelet.boot_value())
    assert bracelet.next_packet(517)[2:6] == (1000).to_bytes(4, "little")
    assert ask(point, control.start()).result is Result.SUCCESS  # so already: nothing is left out for it
    assert ask(point, control.stop()).result is Result.SUCCESS
    assert not point.streaming


@pytest.mark.parametrize("write", [control.set_rate(25.0), control.set_range(2)])
def test_rate_and_range_are_set_while_stopped_only(bracelet, point, write):
    ask(point, control.start())
    assert ask(point, write).result is Result.NOT_PERMITTED
    assert (bracelet.boot, bracelet.rate_hz, bracelet.lsb_per_g) == (7, 50.0, 4096)
    ask(point, control.stop())
    assert ask(point, write).result is Result.SUCCESS
    assert (bracelet.boot, len(bracelet._ring)) == (8, 0)
    assert (bracelet.rate_hz, bracelet.lsb_per_g) in {(25.0, 4096), (50.0, 16384)}


@pytest.mark.parametrize("write", [control.set_rate(50.0), control.set_range(8)])
def test_what_is_so_already_begins_no_new_numbering(bracelet, point, write):
    assert ask(point, write).result is Result.SUCCESS
    assert (bracelet.boot, bracelet.held().samples) == (7, 1000)


def test_a_clock_that_was_set_goes_on_with_the_samples_and_through_a_new_numbering(bracelet, point):
    assert bracelet.utc_ms() is None
    ask(point, control.set_time(1_790_000_000_000))
    bracelet.measure(50)
    assert bracelet.utc_ms() == 1_790_000_001_000
    ask(point, control.set_rate(100.0))
    bracelet.measure(50)
    assert bracelet.utc_ms() == 1_790_000_001_500
    bracelet.reset()
    assert bracelet.utc_ms() is None


def test_what_is_no_request_is_an_att_error(point):
    with pytest.raises(RefusedError) as off:
        asked(point, control.start(), indications=False)
    assert off.value.fault is AttFault.INDICATIONS_OFF
    with pytest.raises(RefusedError) as deaf:
        asked(point, control.report(7, 0, 10), notifications=False)
    assert deaf.value.fault is AttFault.INDICATIONS_OFF
    with pytest.raises(RefusedError) as empty:
        point.take(b"", indications=True, notifications=True)
    assert empty.value.fault is AttFault.INVALID_LENGTH
    assert not point.streaming


def test_one_request_at_a_time(point):
    asked(point, control.start())
    with pytest.raises(RefusedError) as unconfirmed:
        asked(point, control.stop())
    assert unconfirmed.value.fault is AttFault.IN_PROGRESS
    point.confirmed()
    assert asked(point, control.report(7, 0, 500)) is None
    with pytest.raises(RefusedError) as reporting:
        asked(point, control.stop())
    assert reporting.value.fault is AttFault.IN_PROGRESS
    assert ask(point, control.abort()) == Answer(op=Op.ABORT, result=Result.SUCCESS)
    assert point.next_part(517) is None
    assert ask(point, control.stop()).result is Result.SUCCESS


def test_a_connection_begins_stopped_and_free(point):
    ask(point, control.start())
    asked(point, control.report(7, 0, 500))
    point.disconnected()
    assert not (point.streaming)
    assert not (point.reporting)
    assert ask(point, control.start()).result is Result.SUCCESS


@given(
    before=st.integers(0, 800),
    index=st.integers(0, U32 - 1),
    ahead=st.integers(-900, 900),
    samples=st.one_of(st.integers(1, 1500), st.just(U32 - 1)),
    mtu=st.sampled_from([23, 185, 517]),
)
def test_a_report_sends_what_is_held_of_the_range_and_says_so(radio_of, before, index, ahead, samples, mtu):
    bracelet = Bracelet(radio_of(before), index=index, history_s=10)
    bracelet.measure(before)
    expected = quantise(bracelet._source._source.acc_g, 4096)
    held = range(max(0, before - 500), before)
    wanted = [k for k in held if ahead <= k < ahead + samples]
    first = (index + ahead) % U32
    blocks, answer = report(bracelet, ControlPoint(bracelet), Records(1, first, samples), mtu)
    if not wanted:
        assert (blocks, answer.result, answer.records) == ([], Result.NO_RECORDS, Records(1, first, 0))
        return
    assert (answer.result, answer.records) == (Result.SUCCESS, Records(1, (index + wanted[0]) % U32, len(wanted)))
    assert [block.index for block in blocks] == [
        (index + wanted[0] + sum(map(len, blocks[:place]))) % U32 for place in range(len(blocks))
    ]
    assert all(block.history for block in blocks)
    got = np.concatenate([np.transpose(block.acc_g) for block in blocks])
    assert np.array_equal(np.rint(got * 4096), expected[wanted])


@pytest.fixture(scope="module")
def radio_of():
    class Source:
        sensors, rate_hz = ("accelerometer",), 50.0

        def __init__(self, n):
            self.acc_g = np.random.default_rng(n).uniform(-4, 4, (n, 3))

        def read(self, n):
            return self.acc_g[:n]

        def true_steps_until(self, _t_s):
            return None

    return Source


def test_records_of_another_boot_are_none(bracelet, point):
    blocks, answer = report(bracelet, point, Records(6, 0, 10))
    assert (blocks, answer.result, answer.records) == ([], Result.NO_RECORDS, Records(6, 0, 0))


def test_the_extent_is_what_a_report_can_send(bracelet, point):
    assert ask(point, control.report_extent()).records == Records(7, 0, 1000)
    bracelet.measure(30_000)
    assert ask(point, control.report_extent()).records == Records(7, 1000, 30_000)


def test_a_report_that_is_overtaken_says_how_far_it_came(radio):
    bracelet = Bracelet(radio.Endless(), history_s=20)
    point = ControlPoint(bracelet)
    bracelet.measure(1000)
    assert ask(point, control.report(1, 0, 1000)) is None
    bracelet.measure(10)  # before anything was sent: it begins where there is something
    assert wire.FLAG_HISTORY & point.next_part(23)[0]
    bracelet.measure(100)
    answer = point.next_part(23)
    assert (answer.result, answer.records) == (Result.NOT_COMPLETED, Records(1, 10, 2))


def test_without_history_nothing_is_sent_again(radio):
    bracelet = Bracelet(radio.Endless(), history_s=0)
    bracelet.measure(BUFFER_SAMPLES)
    assert bracelet.history_value() == wire.encode_history(0)
    blocks, answer = report(bracelet, ControlPoint(bracelet), Records(1, 0, 10))
    assert (blocks, answer.result) == ([], Result.NO_RECORDS)
