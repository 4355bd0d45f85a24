"""Host time of device time: the line below all delays, how well it is known, and clocks that are set."""

import json

import numpy as np
import pytest

from service.signals.hosttime import DRIFT_PRIOR, JUMP_AFTER_S, KNOWN_PPM, LEVEL_S, HostClock

S = 1_000_000_000
EVERY_S = 0.16
"""Packets of eight samples."""
MIN_S = 0.04
"""The delay that every packet has: it cannot be seen from one side."""


class Link:
    """A device's packets and the host's clock: `ppm` is how much the device's is faster, `set_s` what it was set by."""

    def __init__(self, clock=None, *, ppm=0.0, start_s=0.0):
        self.clock = clock or HostClock()
        self.now_s = start_s
        self.set_s = 0.0
        self._pace = 1 / (1 + ppm * 1e-6)

    def true_ns(self, device_s):
        return round((1000 + self.set_s + device_s * self._pace) * S)

    def hear(self, delays_s, *, every_s=EVERY_S):
        """Hear a packet for each delay; return how far labels of what was four seconds ago were off, after each."""
        off_s = []
        for delay_s in delays_s:
            self.clock.arrived(self.now_s, self.true_ns(self.now_s) + round((MIN_S + delay_s) * S))
            off_s.append(self.off_s(self.now_s - 4))
            self.now_s += every_s
        return np.array(off_s)

    def off_s(self, device_s):
        return (self.clock.at_ns(device_s) - self.true_ns(device_s)) / S - MIN_S


def minutes(n, every_s=EVERY_S):
    return int(n * 60 / every_s)


def uniform(n, width_s=0.3, seed=5):
    return np.random.default_rng(seed).uniform(0, width_s, n)


def stalling(n, seed=5):
    """Delays of a link that is quick and stalls every five seconds for a second's mean; what waited comes at once."""
    rng = np.random.default_rng(seed)
    stalls_s = np.where(rng.random(n) < EVERY_S / 5, rng.exponential(1.0, n), 0.0)
    sent_s = np.arange(n) * EVERY_S
    return np.maximum.accumulate(sent_s + rng.uniform(0, 0.05, n) + stalls_s) - sent_s


def test_the_least_delay_wins():
    clock = HostClock()
    for device_s, delay_ms in ((0.0, 40), (0.2, 5), (0.4, 90)):
        clock.arrived(device_s, round((1000 + device_s) * S) + delay_ms * 1_000_000)
    assert clock.at_ns(0.3) == pytest.approx(1000.3 * S + 5_000_000, abs=1000)


def test_an_old_minimum_is_forgotten():
    """A link whose least delay has grown by 50 ms."""
    link = Link()
    link.hear([0.0])
    link.hear([0.05] * 399, every_s=1.0)
    assert link.off_s(399.0) == pytest.approx(0.05, abs=0.001)
    assert LEVEL_S < 399


def test_before_the_first_packet_it_says_nothing():
    assert HostClock().at_ns(5.0) == 0
    assert HostClock().drift is None


@pytest.mark.parametrize("spread", ["uniform", "exponential"])
@pytest.mark.parametrize("mean_s", [0.005, 0.03, 0.2])
def test_the_uncertainty_covers_the_spread_of_delays(spread, mean_s):
    rng = np.random.default_rng(5)
    delays_s = rng.exponential(mean_s, 600) if spread == "exponential" else rng.uniform(0, 2 * mean_s, 600)
    link, covered = Link(), []
    for n in range(10, 600, 10):
        link.hear(delays_s[n - 10 : n])
        if n >= 100:
            covered.append(delays_s[n] - delays_s[:n].min() <= link.clock.uncertainty_s)
            assert link.clock.uncertainty_s < 6 * mean_s + 0.025
    assert np.mean(covered) >= 0.85


def test_it_is_wide_while_little_was_heard_and_narrows():
    assert HostClock().uncertainty_s >= 0.25
    for packets, least_s, most_s in ((1, 0.25, 1.0), (300, 0.0, 0.002)):
        link = Link()
        link.hear([0.01] * packets)
        assert least_s <= link.clock.uncertainty_s < most_s


@pytest.mark.parametrize("ppm", [-200, 200])
def test_a_drift_not_known_yet_is_covered(ppm):
    """For the first minutes labels may be off by what an unknown drift makes of it, and say so."""
    link = Link(ppm=ppm)
    for delay_s in uniform(minutes(10), 0.05):
        (off_s,) = np.abs(link.hear([delay_s]))
        assert off_s <= link.clock.uncertainty_s
        assert link.now_s < 10 or off_s < 0.02


@pytest.mark.parametrize("ppm", [-20_000, -200, 200])
@pytest.mark.parametrize("delays", [uniform, stalling])
def test_drift_is_found_and_made_good(ppm, delays):
    """Also that of a device without a clock of its own, which only counts the samples of a sensor 2 % off."""
    link = Link(ppm=ppm)
    assert np.abs(link.hear(delays(minutes(30))))[minutes(5) :].max() < 0.01
    drift = link.clock.drift
    assert abs(drift.ppm - ppm) <= drift.uncertainty_ppm < 10


def test_a_drift_is_not_told_before_it_is_known():
    link = Link(ppm=-150)
    for _ in range(60):
        link.hear(uniform(minutes(0.25)))
        if (drift := link.clock.drift) is not None:
            assert abs(drift.ppm + 150) <= drift.uncertainty_ppm <= KNOWN_PPM
    assert link.clock.drift is not None
    young = Link()
    young.hear(uniform(minutes(1)))
    assert young.clock.drift is None


@pytest.mark.full
@pytest.mark.parametrize("ppm", [-200, 200])
@pytest.mark.parametrize("delays", [uniform, stalling])
def test_eight_hours_of_drift_stay_within_a_sample(ppm, delays):
    link = Link(ppm=ppm)
    off_s = np.abs(link.hear(delays(minutes(8 * 60))))[minutes(5) :]
    assert np.median(off_s) < 0.001
    assert off_s.max() < 0.01


@pytest.mark.parametrize("set_s", [-3600.0, -1.0, -0.2])
def test_a_host_clock_that_is_set_back_is_followed_at_once(set_s):
    link = Link(ppm=100)
    link.hear(uniform(minutes(30), 0.05))
    link.set_s = set_s
    off_s = np.abs(link.hear(uniform(minutes(2), 0.05)))
    assert off_s[:5].max() < 0.05
    assert off_s[25:].max() < 0.02


@pytest.mark.parametrize("set_s", [3600.0, 1.0])
def test_a_host_clock_that_is_set_forward_is_followed_after_ten_seconds(set_s):
    link = Link(ppm=100)
    link.hear(uniform(minutes(30), 0.05))
    link.set_s = set_s
    first, second, third = np.split(
        np.abs(link.hear(uniform(minutes(2), 0.05))), [2, round(JUMP_AFTER_S / EVERY_S) + 2]
    )
    assert first.max() == pytest.approx(set_s, abs=0.01)
    assert second[:-2].max() == pytest.approx(set_s, abs=0.01)
    assert third.max() < 0.01
    drift = link.clock.drift
    assert abs(drift.ppm - 100) <= drift.uncertainty_ppm


def test_while_it_is_open_whether_the_clock_was_set_labels_are_that_uncertain():
    link = Link()
    link.hear(uniform(minutes(5), 0.05))
    assert link.clock.uncertainty_s < 0.1
    link.set_s = 3600
    link.hear([0.01] * 3)
    assert link.clock.uncertainty_s == pytest.approx(3600, abs=0.1)
    link.hear([0.01] * 100)
    assert link.clock.uncertainty_s < 0.1


def test_a_small_step_forward_is_followed_within_two_minutes():
    link = Link()
    link.hear(uniform(minutes(30), 0.05))
    link.set_s = 0.3
    assert np.abs(link.hear(uniform(minutes(10), 0.05)))[round(1.6 * LEVEL_S / EVERY_S) :].max() < 0.02


def test_packets_that_waited_for_a_sleeping_host_change_nothing():
    """Its monotonic clock stood still for an hour, UTC and the device went on; the radio had kept some packets."""
    link = Link(ppm=50)
    link.hear(uniform(minutes(30), 0.05))
    waited_s = 3600 - np.arange(40) * EVERY_S
    assert np.abs(link.hear(waited_s)).max() < 0.01
    link.now_s += 3600
    off_s = np.abs(link.hear(uniform(minutes(5), 0.05)))
    assert off_s.max() < 0.05
    assert off_s[50:].max() < 0.01
    assert link.clock.uncertainty_s < 0.2
    assert link.clock.drift.ppm == pytest.approx(50, abs=5)


def test_a_backlog_of_minutes_is_no_clock_set_forward():
    """Ten minutes of samples sent again, a hundred times as fast as they were taken."""
    link = Link()
    link.hear(uniform(minutes(5), 0.05))
    n = minutes(10)
    backlog_s = 600 - np.arange(n) * EVERY_S * 0.99
    assert np.abs(link.hear(backlog_s))[: -minutes(0.5)].max() < 0.01
    assert np.abs(link.hear(uniform(minutes(1), 0.05)))[50:].max() < 0.01


def plain(clock):
    return json.loads(json.dumps(clock.snapshot()))


@pytest.mark.parametrize("set_s", [-3600.0, -0.4, 0.0, 0.4, 3600.0])
def test_after_a_restart_the_old_offset_does_not_count_and_the_drift_does(set_s):
    link = Link(ppm=150)
    link.hear(uniform(minutes(30), 0.05))
    known = link.clock.drift
    resumed = HostClock()
    resumed.restore(plain(link.clock))
    assert resumed.at_ns(link.now_s) == link.clock.at_ns(link.now_s)
    link.clock, link.set_s = resumed, set_s
    link.now_s += 600
    off_s = np.abs(link.hear(uniform(minutes(1), 0.05)))
    assert off_s[0] <= 0.05
    assert off_s[50:].max() < 0.01
    assert resumed.drift == known


def test_another_hosts_drift_is_found_after_a_restart():
    link = Link(ppm=150)
    link.hear(uniform(minutes(30), 0.05))
    resumed = HostClock()
    resumed.restore(plain(link.clock))
    moved = Link(resumed, ppm=-120, start_s=link.now_s)
    assert np.abs(moved.hear(uniform(minutes(30), 0.05)))[minutes(5) :].max() < 0.01
    assert abs(moved.clock.drift.ppm + 120) <= moved.clock.drift.uncertainty_ppm


def test_a_clock_that_heard_nothing_can_be_restored():
    resumed = HostClock()
    resumed.restore(plain(HostClock()))
    assert (resumed.at_ns(1.0), resumed.drift) == (0, None)
    assert resumed.uncertainty_s >= 0.25
    assert DRIFT_PRIOR * 1e6 > KNOWN_PPM
