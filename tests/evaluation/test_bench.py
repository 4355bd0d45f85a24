"""The bench: every figure there, from work that really counts; fast ones only where numba is."""

import numpy as np
import pytest

from service.counters import registry
from service.evaluation import bench, yardsticks
from service.evaluation.counting import count
from service.signals.compiled import compiled

SAMPLES = 6000


@pytest.fixture
def once(monkeypatch):
    """A bench that takes its time only once, over little."""
    monkeypatch.setattr(bench, "RUNS", 1)
    monkeypatch.setattr(bench, "LIVE_FROM", 5)
    monkeypatch.setattr(bench, "LIVE_PACKETS", 10)
    monkeypatch.setattr(bench, "SESSIONS", 2)
    monkeypatch.setattr(bench, "SESSION_PACKETS", 24)
    monkeypatch.setattr(bench.steplink_fast, "kernel", lambda: None)  # takes seconds to compile


@pytest.mark.usefixtures("once")
def test_the_names_and_units_are_those_fixed_for_tools():
    found = {figure.name: figure for figure in bench.figures(["double_threshold"], SAMPLES)}
    assert {name: figure.unit for name, figure in found.items()} == {
        "find_peaks": "samples/s",
        "minimal loop": "samples/s",
        "double_threshold offline fast": "samples/s",
        "double_threshold offline fast / find_peaks": "ratio",
        "double_threshold offline fast / minimal loop": "ratio",
        "double_threshold offline plain": "samples/s",
        "double_threshold live": "us/packet",
        f"{registry.DEFAULT} live from bytes": "us/packet",
        "double_threshold offline fast with reading and resampling": "samples/s",
    }
    assert all(0 < figure.value < 1e12 for figure in found.values())
    speed = found["double_threshold offline fast"].value / found["find_peaks"].value
    assert found["double_threshold offline fast / find_peaks"].value == pytest.approx(speed)


@pytest.mark.usefixtures("once")
def test_every_counter_is_measured_without_numba_too(monkeypatch):
    monkeypatch.setattr(bench, "available", lambda: False)
    names = [figure.name for figure in bench.figures(list(registry.COUNTERS), SAMPLES)]
    assert not [name for name in names if "fast" in name or "minimal" in name]
    assert {name for name in registry.COUNTERS if f"{name} live" in names} == set(registry.COUNTERS)
    assert {name for name in registry.COUNTERS if f"{name} offline plain" in names} == set(registry.COUNTERS)
    measured = [name.split()[0] for name in names if name.endswith("/ Chen 2015")]
    assert measured == [name for name in registry.COUNTERS if name in bench.PAPER_S]


@pytest.mark.usefixtures("once")
def test_our_own_counter_has_its_model_and_a_hundred_sessions_measured_too(monkeypatch):
    taken = []
    monkeypatch.setattr(bench, "available", lambda: False)
    monkeypatch.setattr(bench.steplink_fast, "compile_live", lambda: taken.append("compiled"))
    found = {figure.name: figure for figure in bench.figures(["steplink"], SAMPLES)}
    assert taken == ["compiled"]
    assert found["model load"].unit == "ms"
    assert found["steplink live a hundred sessions"].unit == "us/packet"
    assert 0 < found["steplink live a hundred sessions"].value < 1e6


def test_a_round_of_sessions_counts_as_the_best_of_its_kind(monkeypatch):
    clock = iter(range(1000))
    monkeypatch.setattr(bench, "SESSIONS", 2)
    monkeypatch.setattr(bench, "LIVE_FROM", 0)
    monkeypatch.setattr(bench, "ROUNDS", 2)
    monkeypatch.setattr(bench, "SESSION_PACKETS", 4)
    monkeypatch.setattr(bench.steplink_fast, "kernel", lambda: None)
    monkeypatch.setattr(bench.time, "perf_counter", lambda: float(next(clock)) ** 2)
    figure = bench._sessions("steplink", yardsticks.walk(100))
    assert figure.value == pytest.approx((1 + 5) / 2 / 2 * 1e6)  # rounds of 1, 5, 9, 13 seconds


def test_the_best_of_each_is_taken_by_turns(monkeypatch):
    called, clock = [], iter(range(1000))
    monkeypatch.setattr(bench.time, "perf_counter", lambda: float(next(clock)) ** 1.5)
    found = bench.best_of_each_s({"a": lambda: called.append("a"), "b": lambda: called.append("b")})
    assert called == ["a", "b"] * (1 + bench.RUNS)
    assert found == {"a": 1.0, "b": 3**1.5 - 2**1.5}


def test_packets_are_timed_after_the_first_ones_only(monkeypatch):
    taken, clock = [], iter(range(1000))
    monkeypatch.setattr(bench, "LIVE_FROM", 3)
    monkeypatch.setattr(bench.time, "perf_counter", lambda: (taken.append("clock"), float(next(clock)))[1])
    figure = bench._per_packet("x", list(range(7)), lambda: taken.append)
    assert taken[:9] == [0, 1, 2, "clock", 3, 4, 5, 6, "clock"]
    assert figure.value == pytest.approx(1e6 / 4)


def test_the_walk_is_as_long_as_asked_holds_all_sensors_and_is_counted():
    block = yardsticks.walk(35_000)
    columns = [*block.acc_g, *block.gyro_rad_s, *block.mag_ut]
    assert {len(column) for column in columns} == {35_000}
    assert all(column.dtype == np.float64 and column.flags.c_contiguous for column in columns)
    assert np.array_equal(block.acc_g[0][30_000:], block.acc_g[0][:5000])
    assert len(yardsticks.head(block, 100)) == len(yardsticks.head(block, 100).mag_ut[2]) == 100
    steps = count(yardsticks.head(block, 30_000), "double_threshold").steps
    assert 800 < steps < 1300


def test_both_yardsticks_do_the_same_job():
    block, sos = yardsticks.walk(30_000), yardsticks.band()
    steps = yardsticks.textbook(block, sos)
    assert 800 < steps < 1300
    assert compiled(yardsticks.minimal)(*block.acc_g, sos) == pytest.approx(steps, rel=0.01)


def test_live_packets_are_a_bracelets():
    made = list(yardsticks.packets(100, 10))
    assert [len(packet.data) for packet in made[4:]] == [8 + 6 * 10] * 10


def test_counting_a_file_ends_with_the_steps_of_the_signal(monkeypatch):
    counted = []
    monkeypatch.setattr(
        bench, "_count_fast", lambda name, block: counted.append((name, len(block), count(block, name).steps))
    )
    monkeypatch.setattr(bench, "RUNS", 1)
    block = yardsticks.walk(3000)
    names = ["double_threshold", "gyro_zero_crossing"]
    assert len(list(bench._from_file(names, block))) == 2
    assert counted == [(name, 3000, count(block, name).steps) for name in names for _ in range(2)]
