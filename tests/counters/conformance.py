"""What every step counter must pass, whatever it computes: the contract as checks over any signal.

A check takes `make` (a fresh counter each call) and plain data from the strategies here; `test_conformance.py` runs
them for each counter and preset of the registry. Signals carry all three sensors.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, isfinite, pi

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from service.counters.contract import StepCounter
from service.counters.streaming import COMPILED_FROM
from service.errors import SnapshotError
from service.samples import GRID_HZ, Band, Likely, SampleBlock, Step, Update

Make = Callable[[], StepCounter]

ROUNDING_S = 1e-9


@dataclass(frozen=True)
class Signal:
    """n × 9 values on the grid: acceleration in g, angular rate in rad/s, field in µT."""

    values: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.values)

    def block(self, first: int = 0, last: int | None = None, *, offset: int = 0, arrays: bool = False) -> SampleBlock:
        """Samples `first` to `last` as a block that starts at grid index `first + offset`."""
        part = self.values[first:last]
        columns = [np.ascontiguousarray(column) if arrays else column.tolist() for column in part.T]
        acc, gyro, mag = (tuple(columns[i : i + 3]) for i in (0, 3, 6))
        return SampleBlock(start=first + offset, acc_g=acc, gyro_rad_s=gyro, mag_ut=mag)

    def pieces(self) -> list[SampleBlock]:
        """Return all of it in blocks short enough for plain Python: numba takes seconds to compile a kernel."""
        return [self.block(first, first + COMPILED_FROM) for first in range(0, len(self), COMPILED_FROM)]


@dataclass
class Outcome:
    """All that a counter said over a stream, and its state after it."""

    steps: list[Step]
    bands: list[Band]
    trace: list[float]
    state: object


def walk(n: int, step_hz: float, swing_g: float, rest_g: float = 1.0) -> NDArray[np.float64]:
    """Return n × 9 of a clean walk: acceleration once a step, arm and field once in two steps; without swing, rest."""
    phase = 2 * pi * step_hz * np.arange(n) / GRID_HZ
    values = np.zeros((n, 9))
    values[:, 2] = rest_g + swing_g * np.sin(phase)
    values[:, 3] = 2.0 * np.sin(phase / 2) if swing_g else 0.0
    values[:, 6] = 40.0 + 10.0 * np.cos(phase / 2)
    return values


@st.composite
def signals(draw: st.DrawFn, *, pieces: int = 4) -> Signal:
    """Walks, silence and noise one after the other, some with noise on top."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    parts = []
    for _ in range(draw(st.integers(1, pieces))):
        n = draw(st.integers(1, 350))
        noise_g = draw(st.sampled_from([0.0, 0.02, 0.3]))
        if draw(st.booleans()):
            part = walk(n, draw(st.floats(0.5, 4.0)), draw(st.floats(0.05, 1.5)))
        else:
            part = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 40.0, 0.0, 0.0], (n, 1))
        parts.append(part + noise_g * rng.standard_normal(part.shape))
    return Signal(np.concatenate(parts))


@st.composite
def cut_signals(draw: st.DrawFn) -> tuple[Signal, list[int]]:
    """A signal and where to cut it; a cut may come twice (an empty block)."""
    signal = draw(signals())
    cuts = draw(st.lists(st.integers(0, len(signal)), max_size=12))
    return signal, [0, *sorted(cuts), len(signal)]


def collect(counter: StepCounter, blocks: Iterable[SampleBlock], *, finish: bool = False) -> Outcome:
    """Feed `blocks`; the outcome's state is taken before `finish`."""
    updates: list[Update] = [counter.update(block) for block in blocks]
    state = json.loads(json.dumps(counter.snapshot()))
    if finish:
        updates.append(counter.finish())
    return Outcome(
        steps=[step for update in updates for step in update.steps],
        bands=[band for update in updates for band in update.bands],
        trace=[float(value) for update in updates for value in update.trace],
        state=state,
    )


def blocks_of(signal: Signal, cuts: Sequence[int], *, arrays: bool = False) -> list[SampleBlock]:
    return [signal.block(a, b, arrays=arrays) for a, b in pairwise(cuts)]


def check_cutting(make: Make, signal: Signal, cuts: Sequence[int]) -> None:
    """Any cutting of the stream gives the same steps, view and state, and so do arrays for lists."""
    whole = collect(make(), [signal.block()], finish=True)
    assert collect(make(), blocks_of(signal, cuts), finish=True) == whole
    assert collect(make(), blocks_of(signal, cuts, arrays=True), finish=True) == whole


def check_resume(make: Make, signal: Signal, at: int) -> None:
    """A snapshot after any sample, through JSON, goes on to the same steps and state."""
    first = make()
    before = collect(first, [signal.block(0, at)])
    second = make()
    second.restore(before.state)  # type: ignore[arg-type]
    assert json.loads(json.dumps(second.snapshot())) == before.state
    rest = [signal.block(at)]
    assert collect(second, rest, finish=True) == collect(first, rest, finish=True)


def check_steps(make: Make, signal: Signal) -> None:
    """Steps come in order, inside the stream, with finite fields that agree with each other and with the trace."""
    outcome = collect(make(), [signal.block()], finish=True)
    from_s = make().update(signal.block()).trace_from_s
    for before, step in zip([None, *outcome.steps], outcome.steps, strict=False):
        assert 0.0 <= step.at_s < len(signal) / GRID_HZ
        assert step.strength >= 0.0
        assert all(isfinite(v) for v in (step.strength, step.peak or 0.0, step.valley or 0.0))
        if before is not None:
            assert step.at_s > before.at_s
        if step.interval_s is not None:
            assert before is not None
            assert step.interval_s == pytest.approx(step.at_s - before.at_s, abs=ROUNDING_S)
        if step.peak is not None:
            assert outcome.trace[round((step.at_s - from_s) * GRID_HZ)] == step.peak


def check_latency(make: Make, signal: Signal) -> None:
    """No step is confirmed later than `latency_s` after it happened."""
    counter = make()
    for k in range(len(signal)):
        for step in counter.update(signal.block(k, k + 1)).steps:
            assert k / GRID_HZ - step.at_s <= counter.latency_s + ROUNDING_S


def check_told(make: Make, signal: Signal, cuts: Sequence[int], *, within: int | None, anew: bool = False) -> None:
    """Every step was named likely before, `within` samples after its crest ends on the trace, and never taken back.

    What is named depends on the samples so far, and not on how they were cut. None: a counter that cannot promise it.
    With `anew` a step may have been taken back, if it was named again.
    """
    counter = make()
    trace: list[float] = []
    named: list[list[Likely]] = []
    told: dict[float, int] = {}
    gone: set[float] = set()
    for k in range(len(signal)):
        update = counter.update(signal.block(k, k + 1))
        from_s = update.trace_from_s - k / GRID_HZ
        trace += [float(value) for value in update.trace]
        confirmed = {step.at_s for step in update.steps}
        now = {at_s for at_s, *_ in update.likely}
        gone |= {at_s for at_s, *_ in (named[-1] if named else [])} - now - confirmed
        if anew:
            gone -= now
        if within is not None:
            assert confirmed <= set(told)
            assert not confirmed & gone
            for at_s in confirmed:
                at = ceil((at_s - from_s) * GRID_HZ - ROUNDING_S)
                end = next(i for i in range(at + 1, k + 1) if trace[i] != trace[at])
                assert told[at_s] - end < within
        named.append(list(update.likely))
        assert update.pending == sum(passes for _, _, passes in update.likely)
        for at_s, strength, _ in update.likely:
            assert strength >= 0.0
            assert at_s < (k + 1) / GRID_HZ
            told.setdefault(at_s, k)
    other = make()
    for a, b in pairwise(cuts):
        likely = list(other.update(signal.block(a, b)).likely)
        assert likely == (named[b - 1] if b else [])


def check_gap(make: Make, signal: Signal, at: int, gap: int) -> None:
    """No step lies in a gap, and what came before it is as if the stream had ended there."""
    counter = make()
    collect(counter, [signal.block(0, at)])
    over = collect(counter, [signal.block(at, offset=gap)], finish=True)
    for step in over.steps:
        assert not at / GRID_HZ <= step.at_s < (at + gap) / GRID_HZ
    ended = make()
    before = collect(ended, [signal.block(0, at)], finish=True).steps
    again = make()
    late = collect(again, [signal.block(0, at)]).steps + [step for step in over.steps if step.at_s < at / GRID_HZ]
    assert late == before


def check_long_block(make: Make, signal: Signal, samples: int) -> None:
    """A whole recording at once (compiled, where numba is there) is what packets of ten gave, bit for bit."""
    long = Signal(np.tile(signal.values, (samples // len(signal) + 1, 1)))
    live = collect(make(), blocks_of(long, [*range(0, len(long), 10), len(long)]), finish=True)
    assert collect(make(), [long.block(arrays=True)], finish=True) == live
    middle = len(long) // 2 + 3
    assert collect(make(), [long.block(0, middle, arrays=True), long.block(middle)], finish=True) == live


def check_finished(make: Make, signal: Signal) -> None:
    """After `finish` nothing is pending, and finishing again says nothing."""
    counter = make()
    counter.update(signal.block())
    assert counter.finish().pending == 0
    assert counter.finish() == Update()


def check_silence(make: Make, value_g: float) -> None:
    """A device at rest makes no step and promises none."""
    values = np.zeros((1500, 9))
    values[:, 1] = value_g
    update = make().update(Signal(values).block())
    assert update.steps == ()
    assert update.pending == 0


def check_bad_sample(make: Make, bad: float) -> None:
    """One sample that is no measurement costs no more than what lies near it: the steps after it are as they were."""
    clean = walk(2400, 2.0, 0.5)
    broken = clean.copy()
    broken[900] = bad
    counts = []
    for values in (clean, broken):
        outcome = collect(make(), Signal(values).pieces(), finish=True)
        assert all(isfinite(step.at_s) and isfinite(step.strength) for step in outcome.steps)
        counts.append(sum(step.at_s > 36.0 for step in outcome.steps))
    assert counts[0] >= 10
    assert abs(counts[1] - counts[0]) <= 1


def check_walk(make: Make, step_hz: float, swing_g: float, *, slack: int, moment: float = 0.25) -> None:
    """On a clean walk of 40 steps between two rests at most `slack` are missed or too many.

    `moment` is where in a step's cycle the counter places it: at the crest of acceleration, if nothing else is said.
    """
    true_steps = 40
    rest = walk(100, step_hz, 0.0)
    moving = walk(round(true_steps / step_hz * GRID_HZ), step_hz, swing_g)
    signal = Signal(np.concatenate([rest, moving, rest]))
    outcome = collect(make(), signal.pieces(), finish=True)
    assert abs(len(outcome.steps) - true_steps) <= slack
    at_s = np.array([step.at_s for step in outcome.steps]) - len(rest) / GRID_HZ
    off_s = (at_s - moment / step_hz + 0.5 / step_hz) % (1 / step_hz) - 0.5 / step_hz
    assert np.abs(np.median(off_s)) <= 1.5 / GRID_HZ


def check_walk_outside(make: Make, step_hz: float, swing_g: float) -> None:
    """A clean walk outside a counter's declared limits is missed, in half or more, and not counted otherwise."""
    true_steps = 40
    signal = Signal(walk(round(true_steps / step_hz * GRID_HZ), step_hz, swing_g))
    assert len(collect(make(), signal.pieces(), finish=True).steps) <= true_steps / 2


def check_foreign_snapshot(make: Make, others: Iterable[StepCounter]) -> None:
    """A snapshot of another version, parameter set or counter is refused."""
    counter = make()
    state = counter.snapshot()
    for foreign in ({**state, "version": -1}, {**state, "counter": "none"}, *(other.snapshot() for other in others)):
        with pytest.raises(SnapshotError):
            counter.restore(foreign)
