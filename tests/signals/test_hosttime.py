"""Host time of device time: the least delay seen, bounded in age."""

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
