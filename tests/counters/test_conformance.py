"""Every counter and preset of the registry against the public suite."""

from __future__ import annotations

from functools import partial

import pytest
from counters import conformance
from counters.conformance import Make, Signal, cut_signals, signals, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import registry

VARIANTS = [
    (name, preset)
    for name, kind in registry.COUNTERS.items()
    for preset, params in kind.presets.items()
    if preset == "tuned" or params != kind.presets["tuned"]
]
"""A preset that is the same as `tuned` would be checked twice."""

SLACK = {("double_threshold", "paper"): 24, ("fusion", "paper"): 3}
"""T_L = L lets only valleys under their own mean pass, and on an even walk half of them are not. The suite's arm turns
and its gravity does not, so displacements are uneven, and 0.6 of their mean is not always reached."""

MOMENT = {"gyro_zero_crossing": 0.0}
"""A step is where the turning changes its direction, and the suite's arm turns as acceleration begins to rise."""

OUTSIDE = {
    ("adaptive_peak", "paper"): lambda step_hz, swing_g: swing_g <= 0.2 or step_hz < 1 / 0.8,
    ("conventional_peak", "paper"): lambda step_hz, swing_g: swing_g <= 0.2 or step_hz > 1 / 0.4,
    ("steplink", "tuned"): lambda step_hz, swing_g: step_hz > 2.5 and swing_g < 0.3,
}
"""Walks that a paper's own limits exclude: peaks up to 1.2 g; steps outside 0.3 to 0.8 s, and 0.4 to 1 s.

steplink takes a pure sine as fast as a run and as weak as that for no run: it counts 0 of 40 at 2.9 Hz and 0.2 g, and
40 at 0.6 g. That is what its weights do and not a limit that it declares.
"""

TOLD_WITHIN = {("double_threshold", "paper"): 2, "autocorrelation": None, "steplink": None}
"""Samples after a crest's end, 1 if nothing else is said: its N = 2 falls; a period that is not yet over decides;
steplink names crests of a certain walk only, and those of a walk's start are first told when they are confirmed.

What fusion sees coming may go and come again when another filter takes over.
"""

few = settings(max_examples=40, deadline=None)


@pytest.fixture(
    params=[pytest.param(v, marks=pytest.mark.full if v[1] == "paper" else ()) for v in VARIANTS],
    ids=[f"{name}-{preset}" for name, preset in VARIANTS],
    scope="module",
)
def make(request: pytest.FixtureRequest) -> Make:
    return partial(registry.make, *request.param)


@few
@given(cut=cut_signals())
def test_any_cutting_gives_the_same(make, cut):
    conformance.check_cutting(make, *cut)


@few
@given(signal=signals(), share=st.floats(0, 1))
def test_resumes_from_a_snapshot_after_any_sample(make, signal, share):
    conformance.check_resume(make, signal, round(share * (len(signal) - 1)))


@few
@given(signal=signals())
def test_steps_agree_with_each_other_and_with_the_trace(make, signal):
    conformance.check_steps(make, signal)


@few
@given(signal=signals())
def test_declared_latency_holds(make, signal):
    conformance.check_latency(make, signal)


@few
@given(cut=cut_signals())
def test_every_step_is_told_soon_and_before_it_is_confirmed(make, cut):
    within = TOLD_WITHIN.get(make.args, TOLD_WITHIN.get(make.args[0], 1))
    conformance.check_told(make, *cut, within=within, anew=make.args[0] == "fusion")


@few
@given(signal=signals(), share=st.floats(0, 1), gap=st.integers(31, 600))
def test_no_step_in_a_gap(make, signal, share, gap):
    conformance.check_gap(make, signal, round(share * (len(signal) - 1)), gap)


@pytest.mark.full  # numba takes seconds to compile each kernel
@settings(max_examples=8, deadline=None)
@given(signal=signals(), samples=st.integers(2100, 6000))
def test_a_long_block_equals_packets(make, signal, samples):
    conformance.check_long_block(make, signal, samples)


@settings(max_examples=4, deadline=None)
@given(signal=signals(), samples=st.integers(2100, 6000))
@pytest.mark.full
def test_a_long_block_of_the_default_counter_equals_packets(signal, samples):
    conformance.check_long_block(partial(registry.make, registry.DEFAULT), signal, samples)


@few
@given(signal=signals())
def test_nothing_pends_after_the_end(make, signal):
    conformance.check_finished(make, signal)


@pytest.mark.parametrize("value_g", [0.0, 0.1, 1.0, -0.7])
def test_silence_has_no_steps(make, value_g):
    conformance.check_silence(make, value_g)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e308])
def test_a_sample_that_is_no_measurement_costs_what_is_near_it(make, bad):
    conformance.check_bad_sample(make, bad)


@pytest.mark.parametrize("step_hz", [1.1, 1.7, 2.1, 2.9])
@pytest.mark.parametrize("swing_g", [0.2, 0.6])
def test_a_clean_walk_is_counted(make, step_hz, swing_g):
    if OUTSIDE.get(make.args, lambda *_: False)(step_hz, swing_g):
        conformance.check_walk_outside(make, step_hz, swing_g)
        return
    conformance.check_walk(make, step_hz, swing_g, slack=SLACK.get(make.args, 2), moment=MOMENT.get(make.args[0], 0.25))


def test_foreign_snapshots_are_refused(make):
    state = make().snapshot()
    others = [registry.make(name, preset) for name, preset in VARIANTS]
    assert len(others) > 1
    conformance.check_foreign_snapshot(make, [o for o in others if o.snapshot()["params"] != state["params"]])


def test_the_suite_catches_a_counter_that_confirms_what_it_has_not_told():
    class Silent:
        def __new__(cls):
            counter = registry.make("double_threshold")
            counter._named = lambda _: []
            return counter

    signal = Signal(walk(600, 2.0, 0.6))
    with pytest.raises(AssertionError):
        conformance.check_told(Silent, signal, [0, 600], within=1)


def test_the_suite_catches_a_counter_that_loses_the_packet_border():
    class Forgetful:
        def __new__(cls):
            counter = registry.make("double_threshold")
            update = counter.update
            counter.update = lambda block: (counter.finish(), update(block))[1]
            return counter

    signal = Signal(walk(600, 2.0, 0.6))
    with pytest.raises(AssertionError):
        conformance.check_cutting(Forgetful, signal, [0, 150, 300, 600])
