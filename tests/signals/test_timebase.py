"""Device time: packets of any size, any rate and any drift give one grid, and what was emitted never changes."""

import itertools
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.samples import TICK_EVERY, RawBlock
from service.signals.timebase import FILL_S, Timebase

WRAP = 1 << 16


def value(i):
    return math.sin(0.3 * i)


def block(index, n, true_hz, *, tick=True, array=False, boot_tick=0):
    column = [value(i) for i in range(index, index + n)]
    if array:
        column = np.array(column)
    low = (boot_tick + int(1024 * (index - index % TICK_EVERY) / true_hz)) % WRAP
    return RawBlock(boot=1, index=index, tick=low if tick else None, acc_g=(column, column, column))


def run(timebase, sizes, true_hz, *, start=0, skip=(), **how):
    """Feed blocks of these sizes; return grid samples by index, and the gaps."""
    grid, gaps, index = {}, [], start
    for n in sizes:
        if index not in skip:
            samples, gap = timebase.feed(block(index, n, true_hz, **how))
            grid.update(zip(itertools.count(samples.start), samples.acc_g[0], strict=False))
            gaps += [gap] if gap else []
        index += n
    return grid, gaps


def test_a_device_on_the_grid_passes_through_untouched():
    grid, gaps = run(Timebase(50), [10] * 200, 50)
    assert grid == {k: value(k) for k in range(2000)}
    assert gaps == []


@pytest.mark.parametrize(
    ("nominal", "true"), [(50, 50.01), (50, 49.2), (100, 104), (25, 25), (12.5, 12.49), (52, 52.3)]
)
@given(seed=st.integers(0, 1000))
def test_packet_size_changes_nothing(nominal, true, seed):
    sizes = np.random.default_rng(seed).integers(1, 85, 60).tolist()
    total = sum(sizes)
    by_ten = [10] * (total // 10) + [total % 10] * (total % 10 > 0)
    one, _ = run(Timebase(nominal), sizes, true)
    other, _ = run(Timebase(nominal), by_ten, true)
    assert one == other


def test_lists_and_arrays_give_the_same_bits():
    live, _ = run(Timebase(100), [10] * 300, 101.3)
    whole, _ = run(Timebase(100), [50] * 60, 101.3, array=True)
    assert live == whole


@pytest.mark.parametrize("ppm", [-200, 0, 200])
def test_eight_hours_of_drift_stay_within_three_milliseconds(ppm):
    true_hz, n = 50 * (1 + ppm * 1e-6), 84
    timebase, worst = Timebase(50), 0.0
    for index in range(0, 8 * 3600 * 50, n):
        timebase.feed(block(index, n, true_hz, array=True))
        worst = max(worst, abs(timebase.now_s - (index + n - 1) / true_hz))
    assert worst < 3e-3
    assert timebase.measured_rate_hz == pytest.approx(true_hz, rel=20e-6)


def test_a_rate_far_from_nominal_is_found_within_seconds():
    timebase = Timebase(50)
    run(timebase, [10] * 300, 52)
    assert timebase.measured_rate_hz == pytest.approx(52, rel=1e-3)
    assert timebase.now_s == pytest.approx(2999 / 52, abs=5e-3)


def test_a_short_hole_is_interpolated_and_told():
    grid, gaps = run(Timebase(50), [10] * 20, 50, skip={100, 110})
    (gap,) = gaps
    assert (gap.index, gap.samples, gap.filled) == (100, 20, True)
    assert (gap.from_s, gap.to_s) == (99 / 50, 120 / 50)
    assert sorted(grid) == list(range(200))
    middle = value(99) + (value(120) - value(99)) * 11 / 21
    assert grid[110] == pytest.approx(middle)


def test_a_long_hole_breaks_the_grid():
    lost = set(range(100, 140, 10))
    grid, gaps = run(Timebase(50), [10] * 30, 50, skip=lost)
    assert [gap.filled for gap in gaps] == [False]
    assert sorted(grid) == [*range(100), *range(140, 300)]
    assert all(grid[k] == value(k) for k in grid)


def test_the_limit_of_filling_is_what_it_says():
    n = int(FILL_S * 50)
    for hole, filled in ((n, True), (n + 1, False)):
        timebase = Timebase(50)
        timebase.feed(block(0, 10, 50))
        _, gap = timebase.feed(block(10 + hole, 10, 50))
        assert gap.filled is filled


def test_after_a_long_hole_the_ticks_say_where_it_goes_on():
    true_hz = 51.0
    timebase = Timebase(50)
    run(timebase, [10] * 100, true_hz)
    timebase.feed(block(180_000, 10, true_hz))
    assert timebase.now_s == pytest.approx(180_009 / true_hz, abs=0.01)


def test_joining_late_takes_the_high_bits_from_the_clock():
    true_hz, index = 52.0, 1_000_064
    timebase = Timebase(50)
    timebase.set_clock(999_936, int(1024 * 999_936 / true_hz))
    timebase.feed(block(index, 10, true_hz))
    assert timebase.now_s == pytest.approx((index + 9) / true_hz, abs=0.5)


HOUR_S = 3600


@pytest.mark.parametrize("away_s", [600, HOUR_S, 24 * HOUR_S])
@pytest.mark.parametrize("ppm", [-20_000, -200, 0, 200, 20_000])
@pytest.mark.parametrize("before_s", [6, 60])
@pytest.mark.parametrize("boot_s", [0, 63.9])
def test_however_long_it_was_away_the_clock_read_at_reconnecting_tells_the_high_bits(away_s, ppm, before_s, boot_s):
    """What rate there was time to learn before does not say which of the 64 s a tick belongs to."""
    true_hz = 50 * (1 + ppm * 1e-6)
    boot_tick = round(boot_s * 1024)
    timebase = Timebase(50)
    timebase.set_clock(0, boot_tick)
    run(timebase, [10] * (5 * before_s), true_hz, boot_tick=boot_tick)
    clock = int(50 * (before_s + away_s)) // TICK_EVERY * TICK_EVERY
    timebase.set_clock(clock, boot_tick + int(1024 * clock / true_hz))
    for since in (50, 300, 6000):
        index = clock + since
        _, gap = timebase.feed(block(index, 10, true_hz, boot_tick=boot_tick))
        assert abs(timebase.now_s - (boot_s + (index + 9) / true_hz)) < timebase.uncertainty_s
        assert gap.to_s > gap.from_s


def test_an_old_clock_says_nothing_once_ticks_are_nearer():
    """A rate 1 % off moves the high bits in 53 minutes: counted from the clock read at first they would be wrong."""
    timebase, true_hz = Timebase(50), 50.5
    timebase.set_clock(0, 0)
    index = 0
    while index < 5 * HOUR_S * 50:
        timebase.feed(block(index, 10, true_hz))
        index += 2000
    assert timebase.now_s == pytest.approx((index - 2000 + 9) / true_hz, abs=0.01)


def test_a_clock_read_after_the_index_wrapped_counts_from_there():
    """The device says u32; the timebase is fed an index that goes on."""
    true_hz, wrapped = 50.0, (1 << 32) + 5 * TICK_EVERY
    timebase = Timebase(50)
    timebase.set_clock((1 << 32) - 300 * TICK_EVERY, int(1024 * ((1 << 32) - 300 * TICK_EVERY) / true_hz))
    timebase.feed(block((1 << 32) - 300 * TICK_EVERY, 10, true_hz))
    timebase.set_clock(5 * TICK_EVERY, int(1024 * wrapped / true_hz))
    timebase.feed(block(wrapped, 10, true_hz))
    assert timebase.now_s == pytest.approx((wrapped + 9) / true_hz, abs=0.001)


@pytest.mark.parametrize("ppm", [-20_000, -200, 200, 20_000])
def test_device_time_never_stands_or_runs_back(ppm):
    """Every emitted sample is the next one of the grid, through ten wraps of the tick's low bits."""
    true_hz, timebase, last = 50 * (1 + ppm * 1e-6), Timebase(50), -1
    for index in range(0, 32_000, 50):
        before_s = timebase.now_s
        samples, gap = timebase.feed(block(index, 50, true_hz, boot_tick=WRAP - 100))
        assert timebase.now_s > before_s
        assert gap is None
        assert last < 0 or samples.start == last + 1
        last = samples.start + len(samples) - 1


def test_the_rate_it_tells_is_that_of_its_ticks_also_after_a_restart():
    true_hz, timebase = 50.01, Timebase(50)
    assert timebase.rate is None
    run(timebase, [50] * 600, true_hz)
    assert abs(timebase.rate.hz - true_hz) <= timebase.rate.uncertainty_hz < 0.0001
    assert Timebase.restored(json.loads(json.dumps(timebase.snapshot()))).rate == timebase.rate
    untold = Timebase(50)
    run(untold, [50] * 60, true_hz, tick=False)
    assert untold.rate is None


def ticked(index, tick, n=10):
    flat = [1.0] * n
    return RawBlock(boot=1, index=index, tick=tick & 0xFFFF, acc_g=(flat, flat, flat))


def test_a_clock_that_stands_still_tells_no_rate():
    timebase = Timebase(50.0)
    for index in range(0, 20_000, 10):
        timebase.feed(ticked(index, 7))
    assert 40 < timebase.measured_rate_hz < 63
    assert timebase.now_s > 0


@pytest.mark.parametrize("wrong", [-9000, -3000, 3000])
def test_a_wrong_tick_after_a_long_hole_does_not_set_the_grid_back(wrong):
    timebase, emitted = Timebase(50.0), 0
    for index in [*range(0, 2000, 10), *range(2040, 4000, 10)]:
        tick = int(index // TICK_EVERY * TICK_EVERY * 1024 / 50) + (wrong if index >= 2040 else 0)
        samples, _ = timebase.feed(ticked(index, tick))
        assert samples.start >= emitted
        emitted = samples.start + len(samples)


def test_without_ticks_the_nominal_rate_holds():
    grid, _ = run(Timebase(25), [10] * 10, 25, tick=False)
    assert grid[40] == value(20)
    assert grid[41] == pytest.approx((value(20) + value(21)) / 2)


@given(cut=st.integers(0, 59), true=st.sampled_from([50.0, 50.7, 47.0]))
def test_snapshot_and_restore_at_any_packet(cut, true):
    whole, _ = run(Timebase(50), [13] * 60, true)
    timebase = Timebase(50)
    first, _ = run(timebase, [13] * cut, true)
    resumed = Timebase.restored(json.loads(json.dumps(timebase.snapshot())))
    second, _ = run(resumed, [13] * (60 - cut), true, start=13 * cut)
    assert {**first, **second} == whole


def test_all_sensors_share_one_grid():
    column = [float(i) for i in range(10)]
    columns = (column, column, column)
    raw = RawBlock(boot=1, index=0, tick=0, acc_g=columns, gyro_rad_s=columns, mag_ut=columns)
    samples, _ = Timebase(25).feed(raw)
    assert samples.acc_g == samples.gyro_rad_s == samples.mag_ut
    assert len(samples) == 19


def test_how_well_a_moment_is_known_is_half_a_sample_and_what_the_ticks_leave_open():
    untold = Timebase(50)
    run(untold, [10] * 10, 50, tick=False)
    assert untold.uncertainty_s == 0.01
    slow = Timebase(12.5)
    run(slow, [10] * 10, 12.5, tick=False)
    assert slow.uncertainty_s == 0.04
    steady, drifting = Timebase(50), Timebase(50)
    run(steady, [10] * 100, 50)
    run(drifting, [10] * 30, 51)
    assert 0.01 < steady.uncertainty_s < 0.012
    assert drifting.uncertainty_s > 0.02


def held(index, n, *sensors):
    """A block at 25 Hz whose named sensors all hold the same values."""
    column = [value(i) for i in range(index, index + n)]
    tick = int(1024 * (index - index % TICK_EVERY) / 25) % WRAP
    columns = dict.fromkeys(("acc_g", *sensors), (column, column, column))
    return RawBlock(boot=1, index=index, tick=tick, **columns)


GYRO, MAG = "gyro_rad_s", "mag_ut"


@given(st.lists(st.tuples(st.integers(1, 30), st.sets(st.sampled_from([GYRO, MAG])), st.integers(0, 40)), max_size=12))
def test_sensors_may_come_and_go_and_keep_to_the_grid_of_the_acceleration(blocks):
    """Whatever is lost between: each block holds what came, as long as its acceleration; nothing is emitted twice."""
    mixed, plain, index, next_k = Timebase(25), Timebase(25), 0, 0
    for n, sensors, lost in blocks:
        samples, gap = mixed.feed(held(index, n, *sensors))
        alone, gap_alone = plain.feed(held(index, n))
        assert (samples.start, samples.acc_g, gap) == (alone.start, alone.acc_g, gap_alone)
        assert samples.start >= next_k
        next_k = samples.start + len(samples)
        for name in (GYRO, MAG):
            columns = getattr(samples, name)
            assert (columns is not None) == (name in sensors)
            assert columns is None or {len(column) for column in columns} == {len(samples)}
        index += n + lost


def test_a_sensor_that_comes_anew_begins_at_its_first_value():
    timebase = Timebase(25)
    timebase.feed(held(0, 10))
    samples, _ = timebase.feed(held(10, 3, GYRO))
    between = (value(10) + value(11)) / 2
    assert samples.gyro_rad_s[0][:3] == pytest.approx([value(10), value(10), between])
    assert samples.acc_g[0][:3] == pytest.approx([(value(9) + value(10)) / 2, value(10), between])


def test_what_a_sensor_last_said_is_forgotten_with_it():
    timebase = Timebase(25)
    for block_ in (held(0, 10, GYRO), held(10, 5)):
        timebase.feed(block_)
    samples, _ = timebase.feed(held(15, 3, GYRO))
    assert len(samples.gyro_rad_s[0]) == len(samples) == 6
    assert samples.gyro_rad_s[0][0] == value(15)


@given(cut=st.integers(1, 5))
def test_a_snapshot_holds_every_sensor(cut):
    blocks = [held(0, 10, GYRO), held(10, 10), held(20, 10, GYRO, MAG), held(45, 10, MAG), held(55, 10), held(65, 9)]
    whole, resumed = Timebase(25), Timebase(25)
    expected = [whole.feed(one) for one in blocks]
    first = [resumed.feed(one) for one in blocks[:cut]]
    resumed = Timebase.restored(json.loads(json.dumps(resumed.snapshot())))
    assert first + [resumed.feed(one) for one in blocks[cut:]] == expected
