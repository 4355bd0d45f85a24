"""Row 6 of what must not break it: indices and ticks that wrap, outages across a wrap, and devices that start again.

The truth is a device with an ideal clock whose index and tick never wrap: places and times follow from its numbers.
"""

from itertools import pairwise

import pytest
from fakes import EVERY, MetronomeCounter, data_packet, data_packets, described
from hypothesis import given
from hypothesis import strategies as st

from service.events import Gap, Rebooted, StepCounted
from service.samples import GRID_HZ, TICK_EVERY, Packet
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

INDEX_WRAP = 1 << 32
TICK_WRAP_S = 64.0
HOUR_S = 3600
SIZES = st.lists(st.integers(1, 84), min_size=1, max_size=6)
"""Packet sizes by turns: what fits MTU 23 to 517."""


def reconnected(index, *, boot=1, rate_hz=50.0):
    """What a host reads on connecting where sample `index` is the next one to be measured."""
    at = wire.tick_index(index)
    return described(boot=boot, clock=(at % INDEX_WRAP, int(at * 1024 / rate_hz)))


def connected(index=0, **how):
    tracker = Tracker(wire.Bracelet(), {"metronome": MetronomeCounter}, primary="metronome")
    run(tracker, reconnected(index, **how))
    return tracker


def run(tracker, packets):
    return [event for packet in packets for event in tracker.apply(packet)]


def only(events, kind):
    return [event for event in events if isinstance(event, kind)]


def sent(sizes, first, last, **how):
    """Packets of these sizes by turns, from sample `first` up to `last`."""
    at, turn = first, 0
    while at < last:
        n = min(sizes[turn % len(sizes)], last - at)
        yield data_packet(at, n, **how)
        at, turn = at + n, turn + 1


def true_steps(first, last):
    """Times of the metronome's steps in samples `first` up to `last` of a device at 50 Hz."""
    return [k / GRID_HZ for k in range(first, last) if k % EVERY == 0]


def times(events):
    return [event.step.at_s for event in only(events, StepCounted)]


@pytest.mark.full
@given(sizes=SIZES)
@pytest.mark.parametrize("wrap", [INDEX_WRAP, round(TICK_WRAP_S * 50), round(500 * TICK_WRAP_S * 50)])
def test_a_wrap_is_no_gap_at_any_packet_size(sizes, wrap):
    first, last = wrap - 300, wrap + 300
    tracker = connected(first)
    events = run(tracker, sent(sizes, first, last))
    assert only(events, Gap) == only(events, Rebooted) == []
    assert times(events) == pytest.approx(true_steps(first, last), abs=1e-6)
    assert (tracker.tally.samples, tracker.tally.packets_duplicate, tracker.tally.packets_bad) == (600, 0, 0)


@pytest.mark.full
@given(sizes=SIZES, before=st.integers(1, 200), behind=st.integers(1, 200))
@pytest.mark.parametrize("wrap", [INDEX_WRAP, round(TICK_WRAP_S * 50)])
def test_an_outage_over_a_wrap_is_told_exactly(sizes, before, behind, wrap):
    tracker = connected(wrap - 400)
    run(tracker, sent(sizes, wrap - 400, wrap - before))
    events = run(tracker, sent(sizes, wrap + behind, wrap + 400))
    (gap,) = only(events, Gap)
    assert (gap.index, gap.samples) == (wrap - before, before + behind)
    assert (gap.from_s, gap.to_s) == pytest.approx(((wrap - before - 1) / 50, (wrap + behind) / 50))
    inside = [at_s for at_s in times(events) if gap.from_s < at_s < gap.to_s]
    assert inside == [] or gap.filled
    assert tracker.tally.samples_lost == before + behind


@pytest.mark.parametrize("away_s", [63, 65, 600, 24 * HOUR_S])
@pytest.mark.parametrize("ppm", [-20_000, -200, 200, 20_000])
def test_a_long_outage_is_told_exactly_whatever_the_rate(away_s, ppm):
    """Only ten seconds were heard before, and again behind: the clock read at reconnecting tells which 64 s it is."""
    rate_hz = 50 * (1 + ppm * 1e-6)
    tracker = connected()
    run(tracker, data_packets([10] * 50, rate_hz=rate_hz))
    back = 500 + round(away_s * rate_hz)
    run(tracker, reconnected(back, rate_hz=rate_hz))
    events = run(tracker, data_packets([10] * 50, start=back, rate_hz=rate_hz))
    (gap,) = only(events, Gap)
    assert (gap.samples, gap.filled) == (back - 500, False)
    assert gap.to_s == pytest.approx(back / rate_hz, abs=0.005)
    assert tracker.now_s == pytest.approx((back + 499) / rate_hz, abs=0.005)
    assert all(one < other for one, other in pairwise(times(events)))
    assert only(events, Rebooted) == []


@pytest.mark.full
@given(sizes=SIZES, read=st.booleans())
@pytest.mark.parametrize("last", [50, round(TICK_WRAP_S * 50) + 20, INDEX_WRAP - 10, INDEX_WRAP + 10])
def test_a_reboot_is_told_once_and_the_total_goes_on(sizes, read, last):
    """At any packet size, told at a reconnect or by the packets alone, also right at a wrap of the old boot's index."""
    first = max(0, last - 300)
    tracker = connected(first)
    before = run(tracker, sent(sizes, first, last))
    behind = run(tracker, reconnected(0, boot=2)) if read else []
    behind += run(tracker, sent(sizes, 0, 300, boot=2))
    assert only(before + behind, Rebooted) == [Rebooted(boot=2, previous=1)]
    assert only(before + behind, Gap) == []
    counts = [event.steps for event in only(before + behind, StepCounted)]
    assert counts == list(range(1, len(true_steps(first, last)) + len(true_steps(0, 300)) + 1))
    assert times(behind) == pytest.approx(true_steps(0, 300))
    assert tracker.total == counts[-1]
    assert tracker.tally.reboots == 1


@pytest.mark.parametrize("since_s", [5, 600, 24 * HOUR_S])
def test_a_device_that_started_again_long_ago_is_placed_by_its_own_clock(since_s):
    """It was away, started again, and is met `since_s` later: no gap, since nothing of that boot was ever there."""
    tracker = connected()
    run(tracker, data_packets([10] * 50))
    back = since_s * 50
    run(tracker, reconnected(back, boot=2))
    events = run(tracker, data_packets([10] * 50, start=back, boot=2))
    assert only(events, Rebooted) == [Rebooted(boot=2, previous=1)]
    assert only(events, Gap) == []
    assert tracker.now_s == pytest.approx((back + 499) / 50, abs=1e-6)


def test_boot_numbers_that_wrap_in_their_low_byte_are_another_boot():
    tracker = connected(boot=255)
    run(tracker, sent([10], 0, 100, boot=255))
    run(tracker, reconnected(0, boot=256))
    events = run(tracker, sent([10], 0, 100, boot=256))
    assert [(event.boot, event.previous) for event in only(events, Rebooted)] == [(256, 255)]


@pytest.mark.parametrize("rate_hz", [12.5, 25.0, 100.0])
def test_other_rates_wrap_as_well(rate_hz):
    tracker = Tracker(wire.Bracelet(), {"metronome": MetronomeCounter}, primary="metronome")
    first = INDEX_WRAP - 10 * TICK_EVERY
    clock = Packet(characteristic=wire.CLOCK, data=wire.encode_clock(first, int(first * 1024 / rate_hz)), at_ns=0)
    run(tracker, [*described(rate_hz=rate_hz), clock])
    events = run(tracker, sent([7], first, INDEX_WRAP + 1000, rate_hz=rate_hz))
    assert only(events, Gap) == []
    assert tracker.now_s == pytest.approx((INDEX_WRAP + 999) / rate_hz, abs=1e-3)
