"""The bracelet's hardware: clocks that err, a rate that changes, a battery that drains, a register of steps."""

import asyncio
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from device_sim.rated import Rated
from device_sim.step_register import StepRegister
from service.errors import ParameterError
from service.samples import ACCELEROMETER_ONLY
from service.wearables import bracelet as wire


def ticks_a_sample(bracelet):
    return bracelet.tick(1 << 30) / (1 << 30)


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 200.0])
def test_a_fast_oscillator_hurries_samples_and_ticks_alike(radio, ppm):
    bracelet = Bracelet(radio.Endless(), drift_ppm=ppm)
    assert bracelet.true_rate_hz == pytest.approx(50 * (1 + ppm / 1e6), rel=1e-12)
    assert ticks_a_sample(bracelet) == pytest.approx(1024 / 50, rel=1e-9)


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 200.0])
def test_a_fast_sensor_shows_in_its_ticks(radio, ppm):
    bracelet = Bracelet(radio.Endless(), sensor_ppm=ppm)
    assert bracelet.true_rate_hz == pytest.approx(50 * (1 + ppm / 1e6), rel=1e-12)
    assert ticks_a_sample(bracelet) == pytest.approx(1024 / 50 / (1 + ppm / 1e6), rel=1e-9)
    assert bracelet.rate_value() == wire.encode_rate(50.0)


def test_its_utc_runs_with_its_oscillator(radio):
    bracelet = Bracelet(radio.Endless(), sensor_ppm=10_000.0, utc_ms=1_000)
    bracelet.measure(5050)
    assert bracelet.utc_ms() == 101_000


@pytest.mark.parametrize("wrong", [{"drift_ppm": 1e5}, {"sensor_ppm": math.nan}, {"history_s": 601}])
def test_hardware_that_there_is_not_is_refused(radio, wrong):
    with pytest.raises(ParameterError):
        Bracelet(radio.Endless(), **wrong)


class Waves:
    """Slow waves and their truth: anything that follows them at another rate is right."""

    sensors = ACCELEROMETER_ONLY

    def __init__(self, n=10**9, rate_hz=50.0):
        self.rate_hz, self.n, self.next = rate_hz, n, 0

    def at(self, t_s):
        return np.column_stack([np.sin(t_s), np.cos(0.5 * t_s), np.ones(len(t_s))])

    def read(self, n):
        k = np.arange(self.next, min(self.next + n, self.n))
        self.next += len(k)
        return self.at(k / self.rate_hz)

    def true_steps_until(self, t_s):
        return int(t_s)


@settings(max_examples=30)
@given(
    rate_hz=st.sampled_from([12.5, 25.0, 50.0, 100.0, 52.0]),
    chunks=st.lists(st.integers(0, 60), min_size=1, max_size=10),
)
def test_any_chunks_at_any_rate_are_the_same_signal(rate_hz, chunks):
    whole, pieces = Rated(Waves()), Rated(Waves())
    for source in (whole, pieces):
        source.read(20)
        source.set_rate(rate_hz)
    n = sum(chunks)
    parts = np.concatenate([pieces.read(chunk) for chunk in chunks])
    assert parts == pytest.approx(whole.read(n), abs=1e-9)
    step_s = 1 / rate_hz
    delay_s = max(0.0, step_s - 0.02) / 2  # the mean over a step is that of its middle
    t_s = 0.4 + np.arange(n) * step_s - delay_s
    assert parts[2:] == pytest.approx(Waves().at(t_s)[2:], abs=0.012)
    assert pieces.true_steps() == int(0.4 + n * step_s)


def test_a_rate_and_back_is_the_source_again():
    source = Rated(Waves())
    source.read(10)
    source.set_rate(25.0)
    source.read(10)
    source.set_rate(50.0)
    assert source.read(20) == pytest.approx(Waves().at((30 + np.arange(20)) / 50), abs=1e-12)


def test_a_source_that_ends_does_so_at_any_rate():
    for rate_hz, expected in ((25.0, 50), (50.0, 100), (100.0, 199)):
        source = Rated(Waves(100))
        source.set_rate(rate_hz)
        assert len(source.read(500)) == expected
        assert len(source.read(5)) == 0


def test_the_register_shows_the_true_steps_where_they_are_known():
    walker = Walker("normal:30", seed=1)
    bracelet = Bracelet(walker)
    bracelet.measure(1000)
    true = walker.true_steps_until(20.0)
    assert true > 20
    assert bracelet.register_value() == wire.encode_register(true)
    bracelet.reset()
    assert bracelet.register_value() == wire.encode_register(0)


def test_the_register_counts_roughly_where_nobody_knows():
    class Unknown(Walker):
        def true_steps_until(self, _t_s):
            return None

    source = Rated(Unknown("normal:60,rest:20", seed=1))
    register = StepRegister(source)
    register.take(source.read(3000))
    walked = register.steps
    true = Walker("normal:60", seed=1).true_steps_until(60)
    assert 0.3 * true < walked < 1.7 * true
    register.take(source.read(1000))
    assert register.steps <= walked + 2


def test_a_battery_lasts_as_long_as_it_says(radio):
    bracelet = Bracelet(radio.Endless(), battery_hours=1)
    bracelet.measure(50 * 900)
    assert bracelet.battery_value() == bytes([75])
    bracelet.measure(50 * 2699)
    assert bracelet.battery_value() == b"\x01"
    bracelet.measure(50)
    assert bracelet.battery_value() == b"\0"


@pytest.mark.full
async def test_a_battery_is_told_by_the_percent_and_when_it_is_empty_the_bracelet_is_gone(radio):
    bracelet = Bracelet(radio.Endless(), battery_hours=0.2)  # 7.2 s a percent
    async with LocalAir() as air, air.bracelet(bracelet, speed=100) as gatt, air.central() as central:
        host = await radio.Host.connect(central)
        levels = []
        await host.client.start_notify(wire.BATTERY_LEVEL, lambda _, data: levels.append(data[0]))
        bracelet.battery.charge(3)
        await radio.until(lambda: host.gone)
        assert levels[-3:] == [2, 1, 0]
        measured = gatt.statistics().measured
        await asyncio.sleep(0.05)
        assert gatt.statistics().measured == measured
        await gatt.set_battery(50)
        again = await radio.Host.connect(central)
        infos = await again.describe()
        assert infos[wire.BOOT].boot == 2
        assert 40 <= infos[wire.BATTERY_LEVEL].battery_percent <= 50  # it drains again
        await again.listen()
        await again.got(20)


@pytest.mark.full
async def test_the_register_is_told_while_somebody_walks(radio):
    bracelet = Bracelet(Walker("normal:60", seed=1, loop=True))
    async with LocalAir() as air, air.bracelet(bracelet, speed=40), air.central() as central:
        host = await radio.Host.connect(central)
        told = []
        await host.client.start_notify(
            wire.REGISTER, lambda c, data: told.append(host.decoder.feed(c.uuid, bytes(data)).register_steps)
        )
        await radio.until(lambda: len(told) >= 3)
        assert told == sorted(set(told))
