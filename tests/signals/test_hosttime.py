"""Host time of device time: the least delay seen, bounded in age, and how well that is known."""

import numpy as np
import pytest

from service.signals.hosttime import WINDOW_NS, HostClock

S = 1_000_000_000


def test_the_least_delay_wins():
    clock = HostClock()
    for device_s, delay_ms in ((0.0, 40), (0.2, 5), (0.4, 90)):
        clock.arrived(device_s, round((1000 + device_s) * S) + delay_ms * 1_000_000)
    assert clock.at_ns(0.3) == round(1000.3 * S) + 5_000_000


def test_an_old_minimum_is_forgotten():
    clock = HostClock()
    clock.arrived(0.0, 1000 * S)
    for k in range(1, 400):
        clock.arrived(k, (1000 + k) * S + 50_000_000)
    assert clock.at_ns(399.0) == (1399 * S) + 50_000_000
    assert WINDOW_NS < 399 * S


def test_before_the_first_packet_it_says_nothing():
    assert HostClock().at_ns(5.0) == 0


def heard(delays_s, *, drift=0.0):
    """A clock after packets a sixth of a second apart with these delays; `drift` is the device's, seconds a second."""
    clock = HostClock()
    for k, delay_s in enumerate(delays_s):
        clock.arrived(k * 0.16 * (1 - drift), round((1000 + k * 0.16 + delay_s) * S))
    return clock


@pytest.mark.parametrize("spread", ["uniform", "exponential"])
@pytest.mark.parametrize("mean_s", [0.005, 0.03, 0.2])
def test_the_uncertainty_covers_the_spread_of_delays(spread, mean_s):
    rng = np.random.default_rng(5)
    delays_s = rng.exponential(mean_s, 600) if spread == "exponential" else rng.uniform(0, 2 * mean_s, 600)
    delays_s += 0.04  # the least delay cannot be seen from one side
    covered = []
    for n in range(100, 600, 10):
        clock = heard(delays_s[:n])
        covered.append(delays_s[n] - delays_s[:n].min() <= clock.uncertainty_s)
        assert clock.uncertainty_s < 6 * mean_s
    assert np.mean(covered) >= 0.85


def test_it_is_wide_while_little_was_heard_and_narrows():
    assert HostClock().uncertainty_s >= 0.25
    assert heard([0.01]).uncertainty_s >= 0.25
    assert heard([0.01] * 300).uncertainty_s < 0.002


def test_a_slow_clock_is_covered():
    """200 ppm slow for 50 s: host times from the old offset are 10 ms early, and it says so."""
    clock = heard([0.01] * 312, drift=200e-6)
    true_ns = round((1000 + 311 * 0.16 + 0.01) * S)
    early_s = (true_ns - clock.at_ns(311 * 0.16 * (1 - 200e-6))) / S
    assert 0.009 < early_s < clock.uncertainty_s
