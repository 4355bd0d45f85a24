"""Rows 7 and 8 of what must not break it: packets in bursts, clocks that drift, a host clock that is set.

Device times and counts do not depend on arrival at all; the host times that steps are told with stay near the truth.
"""

from dataclasses import replace
from functools import partial
from itertools import cycle, pairwise

import numpy as np
import pytest
from fakes import EVERY, MetronomeCounter, data_packets, described

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters import registry
from service.events import Gap, StepCounted, Tentative
from service.pipeline.session import Session
from service.samples import GRID_HZ, Packet
from service.tracking.backfill import BackfillTracker
from service.wearables import bracelet as wire

SAMPLE_NS = 20_000_000
SECOND_NS = 10**9
HOUR_NS = 3600 * SECOND_NS
EPOCH_NS = 1_700_000_000 * SECOND_NS
PACKET = 10


def followed(packets, make=MetronomeCounter):
    """What a session tells of these packets."""
    told = []
    made = Session(lambda: "dev-1", BackfillTracker(wire.Bracelet(), {"one": make}, primary="one"), told.append)
    for packet in packets:
        made.apply(packet)
        while made.tracker.has_work:
            made.catch_up()
    return told


def only(told, kind):
    return [notice for notice in told if isinstance(notice.event, kind)]


def steps(told):
    return only(told, StepCounted)


def late(packets, delays_s):
    """The packets, each so much later, none before the one ahead of it."""
    newest_ns = 0
    for packet, delay_s in zip(packets, cycle(delays_s), strict=False):
        if packet.at_ns:
            newest_ns = max(newest_ns, packet.at_ns + round(delay_s * SECOND_NS))
        yield replace(packet, at_ns=newest_ns)


def plain(minutes):
    return [*described(), *data_packets([PACKET] * (minutes * 60 * 50 // PACKET))]


def walked(minutes):
    """A walker's packets, each there 5 ms after its last sample."""
    bracelet = Bracelet(Walker("normal:70,rest:5,fast:45", seed=4))
    bracelet.packet_samples = PACKET
    yield from described()
    for k in range(1, minutes * 60 * 50 // PACKET + 1):
        bracelet.measure(PACKET)
        at_ns = EPOCH_NS + k * PACKET * SAMPLE_NS + 5_000_000
        yield Packet(characteristic=wire.DATA, data=bracelet.next_packet(mtu=517), at_ns=at_ns)


JITTER_S = np.random.default_rng(7).uniform(0, 0.3, 997).tolist()


@pytest.mark.full
@pytest.mark.parametrize("name", ["double_threshold", "adaptive_peak", "autocorrelation"])
@pytest.mark.parametrize(("delays_s", "since_s"), [((0, 0, 0.048), 0.0), (JITTER_S, 20.0)])
def test_arrival_changes_no_device_time_and_host_times_by_less_than_a_sample(name, delays_s, since_s):
    """Of delays of 0 to 300 ms it takes some time until a small one was seen: until then their spread is told."""
    packets = list(walked(2))
    make = partial(registry.make, name)
    smooth, shaken = steps(followed(packets, make)), steps(followed(late(packets, delays_s), make))
    assert len(smooth) > 100
    assert [notice.event.step for notice in smooth] == [notice.event.step for notice in shaken]
    for one, other in zip(smooth, shaken, strict=True):
        known_ns = 0 if one.event.step.at_s >= since_s else other.uncertainty_s * SECOND_NS
        assert abs(one.at_ns - other.at_ns) <= SAMPLE_NS + known_ns
    assert all(one.at_ns < other.at_ns for one, other in pairwise(shaken))
    intervals_s = [notice.event.step.interval_s for notice in shaken]
    assert all(interval_s > 0 for interval_s in intervals_s if interval_s is not None)


@pytest.mark.parametrize("set_ns", [-HOUR_NS, HOUR_NS])
def test_a_host_clock_that_is_set_moves_labels_once_and_no_interval(set_ns):
    """Each label is of the clock before it was set or of the one after, none between, and all are after ten seconds."""
    packets, at = plain(4), 601
    moved = [*packets[:at], *(replace(packet, at_ns=packet.at_ns + set_ns) for packet in packets[at:])]
    whole, told = followed(packets), followed(moved)
    assert [notice.event.step for notice in steps(told)] == [notice.event.step for notice in steps(whole)]
    off_ns = [one.at_ns - other.at_ns for one, other in zip(steps(told), steps(whole), strict=True)]
    assert all(min(abs(off), abs(off - set_ns)) < SAMPLE_NS for off in off_ns)
    assert sum(abs(one - other) > SAMPLE_NS for one, other in pairwise(off_ns)) == 1
    was_set_s = at * PACKET / 50
    after = [off for off, step in zip(off_ns, steps(told), strict=True) if step.event.step.at_s > was_set_s + 11]
    assert len(after) > 200
    assert all(abs(off - set_ns) < SAMPLE_NS for off in after)
    assert only(told, Gap) == []


def test_while_it_is_open_whether_the_clock_was_set_the_label_says_so():
    packets, at = plain(2), 401
    told = followed([*packets[:at], *(replace(packet, at_ns=packet.at_ns + HOUR_NS) for packet in packets[at:])])
    was_set_s = at * PACKET / 50
    for one, other in zip(steps(told), steps(followed(packets)), strict=True):
        true_ns = other.at_ns + (HOUR_NS if one.event.step.at_s >= was_set_s else 0)
        near_the_change = abs(one.event.step.at_s - was_set_s) < 0.3
        assert near_the_change or abs(one.at_ns - true_ns) <= one.uncertainty_s * SECOND_NS + SAMPLE_NS


def test_a_host_that_slept_labels_what_came_before_and_after_alike():
    """Two hours without a packet; the last ones before them are delivered after them, in a burst."""
    packets, at = plain(4), 601
    slept_ns = 2 * HOUR_NS
    waited = [replace(packet, at_ns=packet.at_ns + slept_ns) for packet in packets[at - 10 : at]]
    behind = data_packets([PACKET] * 600, start=(at - 1) * PACKET + slept_ns // SAMPLE_NS)
    told = followed([*packets[: at - 10], *waited, *behind])
    assert [gap.event.filled for gap in only(told, Gap)] == [False]
    first, *others = steps(told)
    for notice in others:
        true_ns = first.at_ns + round((notice.event.step.at_s - first.event.step.at_s) * SECOND_NS)
        assert abs(notice.at_ns - true_ns) < SAMPLE_NS
    assert all(one.at_ns < other.at_ns for one, other in pairwise(steps(told)))


def test_a_reboot_while_the_host_clock_is_set_labels_each_boot_by_its_own_clock():
    packets = plain(1)
    moved_ns = 60 * SECOND_NS + HOUR_NS
    again = [replace(packet, at_ns=packet.at_ns + moved_ns) for packet in data_packets([PACKET] * 300, boot=2)]
    told = followed([*packets, *described(boot=2), *again])
    spans = {1: (EPOCH_NS, packets[-1].at_ns), 2: (EPOCH_NS + moved_ns, again[-1].at_ns)}
    labelled = [*steps(told), *only(told, Tentative)]
    assert {notice.event.boot for notice in labelled} == {1, 2}
    for notice in labelled:
        first_ns, last_ns = spans[notice.event.boot]
        assert first_ns <= notice.at_ns <= last_ns


def test_the_drift_is_told_of_the_boot_that_is_running():
    told = []
    made = Session(lambda: "d", BackfillTracker(wire.Bracelet(), {"one": MetronomeCounter}, primary="one"), told.append)
    assert made.drift is None
    for packet in plain(10):
        made.apply(replace(packet, at_ns=EPOCH_NS + round((packet.at_ns - EPOCH_NS) / (1 + 150e-6))))
    assert abs(made.drift.ppm - 150) <= made.drift.uncertainty_ppm < 20
    for packet in [*described(boot=2), *data_packets([PACKET] * 20, boot=2)]:
        made.apply(packet)
    assert made.drift is None


@pytest.mark.full
@pytest.mark.parametrize(("ppm", "sensor_ppm"), [(-200, 200), (200, -200), (-200, -20_000), (200, 20_000)])
def test_eight_hours_of_clocks_that_drift_leave_every_step_near_the_truth(ppm, sensor_ppm):
    """The device's clock against the host's, and the sensor's rate against the device's clock; bursts of three."""
    rate_hz, n = 50 * (1 + sensor_ppm * 1e-6), 84
    pace = 1 / (1 + ppm * 1e-6)

    def arriving():
        yield from described()
        packets = data_packets([n] * int(8 * 3600 * rate_hz / n), rate_hz=rate_hz)
        for packet, delay_s in zip(packets, cycle((0.0, 0.0, 0.048)), strict=False):
            sent_s = (packet.at_ns - EPOCH_NS) / SECOND_NS * pace
            yield replace(packet, at_ns=EPOCH_NS + round((sent_s + delay_s) * SECOND_NS))

    told = steps(followed(arriving()))
    at_s = np.array([notice.event.step.at_s for notice in told])
    assert len(told) == pytest.approx(8 * 3600 * GRID_HZ / EVERY, abs=6)
    assert np.diff(at_s).min() > 0
    at_ns = np.array([notice.at_ns for notice in told])
    assert np.diff(at_ns).min() > 0
    sent_s = 1 / rate_hz  # a packet leaves one sample after its newest
    off_s = np.abs((at_ns - EPOCH_NS) / SECOND_NS - (at_s + sent_s) * pace)
    settled_s = 60 if abs(sensor_ppm) < 1000 else 300  # the first five seconds are placed by a rate 2 % off
    assert off_s[at_s > settled_s].max() < 0.02
    assert off_s[at_s > 3600].max() < 0.005
