"""The rate a device samples at by its own clock: what is told bounds the truth, at any time and any rate."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.samples import TICK_EVERY, TICK_HZ
from service.signals.rate import SPAN_S, RateSpan


def told(true_hz, seconds, *, since=0, begun=0.0, span=None):
    """A span after the ticks of so many seconds; device time was `begun` at stretch `since`."""
    span = span or RateSpan()
    for stretch in range(since, since + int(seconds * true_hz / TICK_EVERY) + 1):
        span.observe(stretch, int((begun + (stretch - since) * TICK_EVERY / true_hz) * TICK_HZ))
    return span


def test_one_tick_tells_no_rate():
    assert RateSpan().rate is None
    assert told(50, 1).rate is None
    assert told(50, 3).rate is not None


@given(true_hz=st.floats(12.4, 102), begun=st.floats(0, 1e6), seconds=st.floats(25, 100))
def test_the_true_rate_is_always_within_the_uncertainty(true_hz, begun, seconds):
    rate = told(true_hz, seconds, begun=begun).rate
    assert abs(rate.hz - true_hz) <= rate.uncertainty_hz * (1 + 1e-3)
    assert rate.uncertainty_hz / true_hz < 1.1 / TICK_HZ / (seconds - 2 * TICK_EVERY / true_hz)


@pytest.mark.parametrize("ppm", [-20_000, -200, 0, 200, 20_000])
@pytest.mark.parametrize(("seconds", "within_ppm"), [(10, 140), (60, 18), (600, 1.7), (5000, 1.7)])
def test_how_well_it_is_known_after_ten_seconds_a_minute_and_ten(ppm, seconds, within_ppm):
    true_hz = 50 * (1 + ppm * 1e-6)
    rate = told(true_hz, seconds).rate
    assert abs(rate.hz / true_hz - 1) * 1e6 <= rate.uncertainty_hz / true_hz * 1e6 < within_ppm


def test_it_is_the_rate_of_the_last_ten_to_twenty_minutes():
    span = told(50, 3600)
    since, begun_s = int(3600 * 50 / TICK_EVERY) + 1, 3600.0
    told(50.01, 2 * SPAN_S, since=since, begun=begun_s, span=span)
    assert span.rate.hz == pytest.approx(50.01, abs=2 * span.rate.uncertainty_hz)


def test_after_a_long_outage_the_rate_is_measured_anew():
    span = told(50, 300)
    told(51, 60, since=1_000_000, begun=1_000_000 * TICK_EVERY / 50.5, span=span)
    assert span.rate.hz == pytest.approx(51, abs=span.rate.uncertainty_hz)


@pytest.mark.parametrize("per_stretch", [0, -100])
def test_a_clock_that_stands_still_or_runs_back_tells_no_rate(per_stretch):
    span = told(50, 300)
    for stretch in range(200, 300):
        span.observe(stretch, 307_200 + per_stretch * stretch)
        assert span.rate is None or stretch == 200
    told(50, 60, since=300, begun=100.0, span=span)
    assert span.rate.hz == pytest.approx(50, abs=span.rate.uncertainty_hz)


def test_a_short_outage_is_spanned():
    span = told(50, 300)
    before = span.rate.uncertainty_hz
    told(50, 5, since=300, begun=300 * TICK_EVERY / 50, span=span)
    assert span.rate.uncertainty_hz < before / 2


def test_its_attributes_are_its_state():
    one, other = told(50.2, 700), RateSpan()
    vars(other).update(json.loads(json.dumps(vars(one))))
    assert other.rate == one.rate
    told(50.2, 700, since=400, begun=400 * TICK_EVERY / 50.2, span=one)
    told(50.2, 700, since=400, begun=400 * TICK_EVERY / 50.2, span=other)
    assert other.rate == one.rate
