"""The Tracker: a pure fold over packets. Bad, repeated, late and absent ones are counted, and none stops it."""

import json

import pytest
from fakes import EVERY, MetronomeCounter, data_packet, data_packets, described, tick_at
from hypothesis import given
from hypothesis import strategies as st

from service.errors import CounterError, ParameterError
from service.events import Counting, Described, Gap, Rebooted, Segmented, Signal, StepCounted, Tentative
from service.samples import GRID_HZ, Packet
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire


def make():
    return Tracker(wire.Bracelet(), {"metronome": MetronomeCounter}, primary="metronome")


def ready(**said):
    tracker = make()
    for packet in described(**said):
        tracker.apply(packet)
    return tracker


def run(tracker, packets):
    return [event for packet in packets for event in tracker.apply(packet)]


def steps(events):
    return [(event.boot, event.step.at_s, event.steps) for event in events if isinstance(event, StepCounted)]


def only(events, kind):
    return [event for event in events if isinstance(event, kind)]


def test_steps_come_with_time_and_count():
    tracker = ready()
    events = run(tracker, data_packets([10] * 10))
    assert steps(events) == [(1, 0.0, 1), (1, 0.5, 2), (1, 1.0, 3), (1, 1.5, 4)]
    assert tracker.steps == {"metronome": 4}
    assert tracker.tally.samples == 100


def test_counts_and_signal_come_with_every_packet():
    *_, signal, counting = run(ready(), data_packets([10] * 2))
    assert isinstance(signal, Signal)
    assert list(signal.values) == [i / 4096 for i in range(10, 20)]
    assert (counting.steps, counting.steps_now, counting.now_s) == (1, 2, 19 / 50)


@given(sizes=st.lists(st.integers(1, 84), min_size=1, max_size=40))
def test_packet_size_changes_nothing(sizes):
    total = sum(sizes)
    whole = ready()
    cut = ready()
    assert steps(run(whole, data_packets([1] * total))) == steps(run(cut, data_packets(sizes)))
    assert whole.tally.samples == cut.tally.samples == total


def test_repeated_and_overlapping_packets_count_once():
    tracker, plain = ready(), ready()
    events = run(tracker, [data_packet(0), data_packet(0), data_packet(5, 20), data_packet(10), data_packet(25)])
    assert steps(events) == steps(run(plain, data_packets([35])))
    assert tracker.tally.packets_duplicate == 2
    assert tracker.tally.samples == 35


@given(cut=st.integers(1, 19), n=st.integers(1, 84))
def test_an_overlap_across_a_tick_keeps_the_grid(cut, n):
    """A packet cut in front of a stretch's first sample must not bring that stretch another's tick."""
    whole, overlapping = ready(rate_hz=100.0), ready(rate_hz=100.0)
    run(whole, data_packets([20] * 20, rate_hz=100.0))
    run(overlapping, [data_packet(i, 20, rate_hz=100.0) for i in range(0, 120, 20)])
    run(overlapping, [data_packet(120 - cut, n, rate_hz=100.0)])
    run(overlapping, [data_packet(i, 20, rate_hz=100.0) for i in range(120, 400, 20)])
    assert overlapping.now_s == whole.now_s
    assert overlapping.steps == whole.steps


def test_late_packets_are_dropped_and_told():
    tracker = ready()
    events = run(tracker, [data_packet(0), data_packet(20), data_packet(10), data_packet(30)])
    assert only(events, Gap) == [Gap(from_s=0.18, to_s=0.4, index=10, samples=10, filled=True)]
    assert tracker.tally.packets_duplicate == 1
    assert tracker.tally.samples_lost == 10


def test_a_long_gap_is_told_and_skipped():
    tracker = ready()
    events = run(tracker, [*data_packets([10] * 10), *data_packets([10] * 10, start=200)])
    assert only(events, Gap) == [Gap(from_s=99 / 50, to_s=4.0, index=100, samples=100, filled=False)]
    assert all(not 99 / 50 < at_s < 4.0 for _, at_s, _ in steps(events))
    assert tracker.tally.gaps == 1


@pytest.mark.parametrize("data", [b"", b"\x01\x01garbage", bytes.fromhex("0e 01 00000000 0000 000000000000")])
def test_a_corrupt_packet_is_counted_and_skipped(data):
    tracker, plain = ready(), ready()
    run(tracker, data_packets([10] * 5))
    assert tracker.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0)) == []
    run(tracker, data_packets([10] * 5, start=50))
    run(plain, data_packets([10] * 10))
    assert tracker.tally.packets_bad == 1
    assert tracker.last_fault is not None
    assert tracker.steps == plain.steps


@pytest.mark.parametrize(("index", "boot"), [(2**30, 1), (50, 77)])
def test_one_packet_that_claims_a_far_jump_or_a_reboot_is_not_believed(index, boot):
    tracker = ready()
    events = run(tracker, [*data_packets([10] * 5), data_packet(index, boot=boot), *data_packets([10] * 5, start=50)])
    assert only(events, Gap) == only(events, Rebooted) == []
    assert tracker.tally.packets_bad == 1
    assert tracker.tally.samples == 100


@pytest.mark.parametrize("bit", range(5, 32))
def test_no_flipped_bit_of_an_index_ends_the_count(bit):
    """Bits below the fifth move a packet by less than a hole that is interpolated."""
    tracker, plain = ready(), ready()
    whole = list(data_packets([10] * 100))
    broken = Packet(
        characteristic=wire.DATA,
        data=bytes(byte ^ flip for byte, flip in zip(whole[40].data, flipped(whole[40].data, 2, bit), strict=True)),
        at_ns=0,
    )
    run(tracker, [*whole[:40], broken, *whole[41:]])
    run(plain, whole)
    assert plain.steps["metronome"] - 1 <= tracker.steps["metronome"] <= plain.steps["metronome"]
    assert tracker.tally.packets_bad + tracker.tally.packets_duplicate == 1
    assert tracker.tally.samples_lost == 10


def flipped(data, offset, bit):
    """A mask as long as `data` with one bit set, counted from byte `offset`."""
    mask = bytearray(len(data))
    mask[offset + bit // 8] = 1 << bit % 8
    return mask


OURS = [wire.DATA, wire.CLOCK, wire.RATE, wire.SCALE, wire.BOOT, wire.DEVICE_ID, wire.SENSORS]


@given(values=st.lists(st.tuples(st.sampled_from(OURS), st.binary(max_size=60)), max_size=20), at=st.integers(0, 20))
def test_any_bytes_on_any_characteristic_never_raise_and_counting_goes_on(values, at):
    tracker = ready()
    run(tracker, data_packets([10] * at))
    run(tracker, [Packet(characteristic=uuid, data=data, at_ns=0) for uuid, data in values])
    run(tracker, described(boot=9))
    before = tracker.total
    run(tracker, data_packets([10] * 30, boot=9))
    assert tracker.total - before >= 10


def test_a_device_that_starts_again_with_the_same_boot_number_is_found():
    tracker = ready()
    events = run(tracker, [*data_packets([10] * 50), *data_packets([10] * 50)])
    assert only(events, Rebooted) == [Rebooted(boot=1, previous=1)]
    assert tracker.tally.reboots == 1
    assert tracker.total == 20 + 16


def test_samples_sent_again_on_request_are_no_restart():
    again = [
        wire.encode(wire.DataPacket(boot=1, index=i, tick=0, counts=[(0, 0, 4096)] * 10, history=True))
        for i in range(0, 300, 10)
    ]
    tracker = ready()
    events = run(tracker, data_packets([10] * 50))
    events += run(tracker, [Packet(characteristic=wire.DATA, data=data, at_ns=0) for data in again])
    assert only(events, Rebooted) == []
    assert tracker.tally.packets_duplicate == 30


def test_two_that_agree_are_believed():
    tracker = ready()
    events = run(tracker, [*data_packets([10] * 5), *data_packets([10] * 5, start=2**30)])
    assert [gap.samples for gap in only(events, Gap)] == [2**30 - 50]
    assert tracker.tally.samples == 100
    assert tracker.tally.packets_bad == 0


def test_a_reboot_begins_device_time_anew_and_the_count_goes_on():
    tracker = ready()
    events = run(tracker, [*data_packets([10] * 5), *data_packets([10] * 5, boot=2)])
    assert only(events, Rebooted) == [Rebooted(boot=2, previous=1)]
    assert only(events, Gap) == []
    assert steps(events) == [(1, 0.0, 1), (1, 0.5, 2), (2, 0.0, 3), (2, 0.5, 4)]
    assert tracker.tally.reboots == 1


def test_a_reboot_told_on_reconnecting_is_believed_at_once():
    tracker = ready()
    run(tracker, data_packets([10] * 5))
    run(tracker, described(boot=2))
    events = tracker.apply(data_packet(0, boot=2))
    assert isinstance(events[0], Rebooted)
    assert len(only(events, Counting)) == 1


def test_the_index_wraps_without_a_gap():
    start = 2**32 - 64
    tracker = ready(clock=(2**32 - 128, 0))
    events = run(tracker, data_packets([16] * 10, start=start))
    assert only(events, Gap) == []
    assert tracker.tally.samples == 160
    assert tracker.tally.packets_duplicate == 0


def test_samples_before_the_rate_are_bad_packets():
    tracker = make()
    scale = next(packet for packet in described() if packet.characteristic == wire.SCALE)
    run(tracker, [scale, data_packet(0)])
    assert (tracker.tally.packets, tracker.tally.packets_bad) == (1, 1)
    assert "rate" in str(tracker.last_fault)


class GyroscopeCounter(MetronomeCounter):
    """A counter that needs what the device does not send, and says it late."""

    def update(self, block):
        raise CounterError(f"needs a gyroscope, not {len(block)} samples of acceleration")


def test_a_counter_without_its_sensor_says_so_and_the_others_count_on():
    counters = {"metronome": MetronomeCounter, "gyroscope": GyroscopeCounter}
    tracker, plain = Tracker(wire.Bracelet(), counters, primary="metronome"), ready()
    run(tracker, [*described(), *data_packets([10] * 10)])
    run(plain, data_packets([10] * 10))
    assert tracker.counter_faults == {"gyroscope": "needs a gyroscope, not 10 samples of acceleration"}
    assert tracker.steps == {**plain.steps, "gyroscope": 0}


def test_samples_at_their_limit_are_counted_once():
    def packet(index, values):
        counts = [(value, 0, 4096) for value in values]
        sent = wire.DataPacket(boot=1, index=index, tick=tick_at(index), counts=counts)
        return Packet(characteristic=wire.DATA, data=wire.encode(sent), at_ns=0)

    tracker = ready()
    run(tracker, [packet(0, [0, 99_999, 0, -99_999]), packet(2, [0, -99_999, 32_766, 32_767])])
    assert tracker.tally.samples == 6
    assert tracker.tally.samples_saturated == 3


def test_a_device_is_described_once_a_change():
    tracker = make()
    events = run(tracker, [*described(), *described()])
    assert all(isinstance(event, Described) for event in events)
    assert len(events) == 5
    assert tracker.info.device == "dev-1"


@given(cut=st.integers(0, 20))
def test_snapshot_and_restore_at_any_packet(cut):
    packets = [*data_packets([10] * 8), *data_packets([10] * 4, start=200), *data_packets([10] * 8, boot=2)]
    whole, first, second = ready(), ready(), make()
    expected = run(whole, packets)
    before = run(first, packets[:cut])
    second.restore(json.loads(json.dumps(first.snapshot())))
    after = run(second, packets[cut:])
    assert steps(before + after) == steps(expected)
    assert json.dumps(second.snapshot()) == json.dumps(whole.snapshot())


class Foresight(MetronomeCounter):
    """Names each step at the sample before it, and once a step that never comes."""

    def update(self, block):
        update = super().update(block)
        ahead = [k / GRID_HZ for k in range(self._next, self._next + 10) if k % EVERY == 0]
        false = [1.3] if 1.0 <= self._next / GRID_HZ < 1.5 else []
        return update._replace(likely=[(at_s, 0.5, True) for at_s in (*ahead, *false)])


def test_likely_steps_are_told_then_confirmed_or_retracted():
    tracker = Tracker(wire.Bracelet(), {"metronome": Foresight}, primary="metronome")
    events = run(tracker, [*described(), *data_packets([10] * 10)])
    told = [(event.at_s, event.interval_s, event.retracted) for event in only(events, Tentative)]
    assert told == [
        (0.0, None, False),  # confirmed at first sight
        (0.5, 0.5, False),
        (1.0, 0.5, False),
        (1.3, pytest.approx(0.3), False),
        (1.5, pytest.approx(0.2), False),
        (1.3, None, True),
        (2.0, 0.5, False),
    ]
    ending = tracker.finish()
    assert [(event.at_s, event.retracted) for event in only(ending, Tentative)] == [(2.0, True)]


class Half(MetronomeCounter):
    """Counts every other step of the metronome."""

    def update(self, block):
        update = super().update(block)
        return update._replace(steps=tuple(step for step in update.steps if round(step.at_s * 2) % 2 == 0))


def test_counters_run_side_by_side_on_one_stream():
    tracker = Tracker(wire.Bracelet(), {"metronome": MetronomeCounter, "half": Half}, primary="metronome")
    events = run(tracker, [*described(), *data_packets([10] * 20)])
    assert tracker.steps == {"metronome": 8, "half": 4}
    assert [event.steps for event in only(events, StepCounted) if event.counter == "half"] == [1, 2, 3, 4]
    assert tracker.total == 8


def test_another_primary_begins_a_segment_and_the_count_goes_on():
    tracker = ready()
    run(tracker, data_packets([10] * 10))
    events = tracker.change_counters({"half": Half, "metronome": MetronomeCounter}, primary="half")
    assert only(events, Segmented) == [Segmented(primary="half", steps=4)]
    assert tracker.total == 4
    run(tracker, data_packets([10] * 10, start=100))
    assert tracker.steps == {"half": 2, "metronome": 8}
    assert tracker.total == 6
    run(tracker, [])
    tracker.change_counters({"metronome": MetronomeCounter, "half": Half}, primary="metronome")
    run(tracker, data_packets([10] * 10, start=200))
    assert tracker.total == 10


def test_counters_that_cannot_be_built_change_nothing():
    def broken():
        raise ParameterError("t_min", 60, "at most t_max")

    refused, plain = ready(), ready()
    for tracker in (refused, plain):
        run(tracker, data_packets([10] * 7))
    before = refused.snapshot()
    with pytest.raises(ParameterError):
        refused.change_counters({"half": Half, "broken": broken}, primary="half")
    assert refused.snapshot() == before
    assert run(refused, data_packets([10] * 13, start=70)) == run(plain, data_packets([10] * 13, start=70))
    assert refused.snapshot() == plain.snapshot()
    (segment,) = only(refused.change_counters({"half": Half}, primary="half"), Segmented)
    assert segment.steps == plain.total


def test_a_counter_that_stays_goes_on_without_a_break():
    changed, plain = ready(), ready()
    run(plain, data_packets([10] * 20))
    run(changed, data_packets([10] * 7))
    events = changed.change_counters({"metronome": MetronomeCounter, "half": Half}, primary="metronome")
    run(changed, data_packets([10] * 13, start=70))
    assert only(events, Segmented) == []
    assert changed.steps["metronome"] == plain.steps["metronome"]
