"""steplink's kernel: the steps and the bits of the plain way, changing over between them wherever one likes."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from counters import conformance
from counters.conformance import Signal, cut_signals, signals, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.gait import Walker
from service.counters import registry, steplink, steplink_fast
from service.counters import steplink_kernel as scalar
from service.samples import GRID_HZ
from service.signals.compiled import available

PACKET = 10


@pytest.fixture
def uncompiled(monkeypatch):
    """The kernel in plain Python: milliseconds a frame, and there without numba too."""
    monkeypatch.setattr(steplink_fast, "_live", [scalar.packet])


@pytest.fixture(scope="module")
def compiled():
    if not available():
        pytest.skip("numba is missing")
    with steplink_fast.compiled_live():
        yield


def strolled(schedule="rest:1,normal:7,rest:3"):
    walker = Walker(schedule, seed=4)
    values = walker.read(round(walker.duration_s * GRID_HZ))
    return Signal(np.hstack([values, np.zeros((len(values), 6))]))


def said(signal, kernels, *, gap_at=None):
    """What a counter says, packet by packet, with the kernel at hand for each (None: plain), and its states."""
    counter, kernels = steplink.build(), iter(kernels)
    found = []
    for k in range(0, len(signal), PACKET):
        steplink_fast._live[:] = [kernel] if (kernel := next(kernels)) is not None else []
        offset = 0 if gap_at is None or k < gap_at else 120
        found.append(counter.update(signal.block(k, k + PACKET, offset=offset)))
        found[-1] = found[-1]._replace(likely=list(found[-1].likely))
        if k % 7 == 0:
            found.append(counter.snapshot())
    return [*found, counter.finish(), counter.snapshot()]


@pytest.mark.usefixtures("uncompiled")
def test_packets_through_the_kernel_say_the_same_and_so_do_turns():
    signal = strolled("normal:6,rest:2")
    turns = [scalar.packet, scalar.packet, None, scalar.packet, None, None] * len(signal)
    plain = said(signal, [None] * len(signal), gap_at=250)
    assert said(signal, turns, gap_at=250) == plain
    assert any(update.likely for update in plain if not isinstance(update, dict))
    assert sum(len(update.steps) for update in plain if not isinstance(update, dict)) >= 6


@pytest.mark.full
@pytest.mark.usefixtures("compiled")
@settings(max_examples=30, deadline=None)
@given(signal=signals(), turns=st.lists(st.booleans(), min_size=1, max_size=12))
def test_compiled_packets_say_the_same_and_so_do_turns(signal, turns):
    kernels = [steplink_fast.kernel() if turn else None for turn in turns] * len(signal)
    before = list(steplink_fast._live)
    try:
        assert said(signal, kernels) == said(signal, [None] * len(signal))
    finally:
        steplink_fast._live[:] = before


@pytest.mark.full
@pytest.mark.usefixtures("compiled")
@settings(max_examples=30, deadline=None)
@given(cut=cut_signals(), gap=st.integers(31, 600), share=st.floats(0, 1))
def test_the_compiled_kernel_conforms(cut, gap, share):
    make = partial(registry.make, "steplink")
    signal, _ = cut
    at = round(share * (len(signal) - 1))
    assert steplink_fast.ready() is not None
    conformance.check_cutting(make, *cut)
    conformance.check_resume(make, signal, at)
    conformance.check_gap(make, signal, at, gap)


@pytest.mark.full
@pytest.mark.usefixtures("compiled")
def test_a_walk_of_an_hour_is_the_same_compiled_in_packets_and_plain():
    signal = strolled("normal:600,rest:60,fast:600,slow:300,run:120,brush:600")
    fast = conformance.collect(steplink.build(), signal.pieces(), finish=True)
    steplink_fast._live.clear()
    try:
        assert conformance.collect(steplink.build(), signal.pieces(), finish=True) == fast
    finally:
        steplink_fast.compile_live()
    assert len(fast.steps) > 2000


def test_nothing_is_compiled_before_somebody_asks(monkeypatch):
    monkeypatch.setattr(steplink_fast, "kernel", lambda: pytest.fail("compiled"))
    conformance.collect(steplink.build(), Signal(walk(600, 2.0, 0.6)).pieces())
    assert steplink_fast.ready() is None


def test_where_numba_is_missing_live_counting_stays_plain(monkeypatch):
    monkeypatch.setattr(steplink_fast, "kernel", lambda: None)
    with steplink_fast.compiled_live():
        assert steplink_fast.ready() is None
