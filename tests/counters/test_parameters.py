"""Parameters that contradict each other are refused, those that do not make a counter that works."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from counters import conformance
from counters.conformance import Signal, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import registry
from service.errors import ParameterError
from service.samples import GRID_HZ, SampleBlock

CONTRADICTIONS: list[tuple[str, dict[str, object], tuple[str, str]]] = [
    ("autocorrelation", {"t_min": 60, "t_max": 20}, ("t_min", "t_max")),
    ("autocorrelation", {"period": "stride"}, ("period", "t_min")),
    ("autocorrelation", {"t_max": 150}, ("t_max", "patience")),
    ("autocorrelation", {"period": "stride", "t_min": 30, "t_max": 150, "patience": 74}, ("t_max", "patience")),
    ("adaptive_peak", {"walk_shortest_s": 1, "walk_longest_s": 0.3}, ("walk_shortest_s", "walk_longest_s")),
    ("adaptive_peak", {"run_shortest_s": 1, "run_longest_s": 0.9}, ("run_shortest_s", "run_longest_s")),
    ("adaptive_peak", {"walk_g": 4, "run_g": 1}, ("walk_g", "run_g")),
    ("adaptive_peak", {"walk_half": 17, "walk_longest_s": 0.34}, ("walk_longest_s", "walk_half")),
    ("conventional_peak", {"least_g": 4, "most_g": 1}, ("least_g", "most_g")),
    ("conventional_peak", {"least_g": 2, "most_g": 2}, ("least_g", "most_g")),
    ("conventional_peak", {"shortest_s": 1, "longest_s": 0.5}, ("shortest_s", "longest_s")),
    ("conventional_peak", {"half": 20, "shortest_s": 0.2, "longest_s": 0.4}, ("longest_s", "half")),
    ("plus_minus", {"half": 3, "score_over": 39}, ("score_over", "half")),
    ("plus_minus", {"half": 3, "score_over": 6}, ("score_over", "half")),
    ("plus_minus", {"shortest_s": 1, "longest_s": 0.3}, ("shortest_s", "longest_s")),
    ("double_threshold", {"rest_raw": 64, "lsb_per_g": 3}, ("rest_raw", "lsb_per_g")),
    ("gyro_zero_crossing", {"refractory_s": 0.5, "max_spacing_s": 0.3}, ("refractory_s", "max_spacing_s")),
    ("fusion", {"longest_half": 80, "longest_step": 20}, ("longest_half", "longest_step")),
]

AGREE: list[tuple[str, dict[str, object]]] = [
    ("autocorrelation", {"t_min": 46, "t_max": 46}),
    ("autocorrelation", {"period": "stride", "t_min": 30, "t_max": 150}),
    ("adaptive_peak", {"walk_half": 17, "walk_longest_s": 0.36}),
    ("conventional_peak", {"shortest_s": 0.5, "longest_s": 0.5}),
    ("plus_minus", {"half": 3, "score_over": 5}),
    ("double_threshold", {"rest_raw": 64, "lsb_per_g": 4}),
]


def _drawn(field: dataclasses.Field[Any]) -> st.SearchStrategy[object]:
    meta = field.metadata
    if "options" in meta:
        return st.sampled_from(meta["options"])
    if isinstance(field.default, int):
        return st.integers(int(meta["low"]), int(meta["high"]))
    return st.floats(meta["low"], meta["high"])


def overrides(name: str) -> st.SearchStrategy[dict[str, object]]:
    """Some of a counter's parameters, each within its range."""
    fields = dataclasses.fields(registry.kind(name).params)
    return st.fixed_dictionaries({}, optional={field.name: _drawn(field) for field in fields})


def accepted(name: str, preset: str, chosen: dict[str, object]) -> Any:
    """Return the parameters, or None where they are refused: by a sentence that names two of them."""
    try:
        return registry.parameters(name, preset, chosen)
    except ParameterError as fault:
        names = {field.name for field in dataclasses.fields(registry.kind(name).params)}
        assert fault.name.removeprefix(f"{name}.") in names
        assert sum(word in names for word in re.split(r"[\s.:,=]+", str(fault))) >= 2
        return None


@pytest.mark.parametrize(("name", "chosen", "both"), CONTRADICTIONS)
def test_a_contradiction_is_refused_and_both_are_named(name, chosen, both):
    for preset in ("paper", "tuned"):
        with pytest.raises(ParameterError) as fault:
            registry.parameters(name, preset, chosen)
        assert fault.value.name == f"{name}.{both[0]}"
        assert both[1] in fault.value.why


@pytest.mark.parametrize(("name", "chosen"), AGREE)
def test_what_lies_just_within_is_taken(name, chosen):
    assert registry.make(name, "paper", chosen).name == name


def test_parameters_cannot_be_made_without_the_check():
    paper = registry.parameters("autocorrelation", "paper")
    with pytest.raises(ParameterError, match="t_max"):
        dataclasses.replace(paper, t_min=60)
    with pytest.raises(ParameterError, match="t_max"):
        type(paper)(t_min=60)


@pytest.mark.parametrize("name", registry.COUNTERS)
@settings(max_examples=25, deadline=None)
@given(data=st.data(), preset=st.sampled_from(["paper", "tuned"]), step_hz=st.floats(1, 3), swing_g=st.floats(0.1, 1.5))
def test_parameters_that_pass_make_a_counter_that_works(name, data, preset, step_hz, swing_g):
    params = accepted(name, preset, data.draw(overrides(name)))
    if params is None:
        return
    signal = Signal(walk(500, step_hz, swing_g))
    build = registry.kind(name).build
    conformance.check_resume(lambda: build(params), signal, data.draw(st.integers(0, len(signal) - 1)))


@pytest.mark.full
@pytest.mark.parametrize("name", registry.COUNTERS)
@settings(max_examples=60, deadline=None)
@given(data=st.data(), preset=st.sampled_from(["paper", "tuned"]), signal=conformance.signals())
def test_parameters_that_pass_keep_the_contract(name, data, preset, signal):
    params = accepted(name, preset, data.draw(overrides(name)))
    if params is None:
        return
    build = registry.kind(name).build
    conformance.check_steps(lambda: build(params), signal)
    conformance.check_latency(lambda: build(params), signal)
    conformance.check_finished(lambda: build(params), signal)


@settings(max_examples=40, deadline=None)
@given(data=st.data(), name=st.sampled_from(["adaptive_peak", "conventional_peak"]))
def test_peaks_within_a_peak_counters_limits_are_counted(data, name):
    """Thirty even peaks as far apart and as high as the parameters say are steps: none of the limits shuts all out."""
    p = accepted(name, "paper", data.draw(overrides(name)))
    if p is None:
        return
    walking = name == "adaptive_peak"
    least_g, most_g = (p.walk_g, p.run_g) if walking else (p.least_g, p.most_g)
    spacing = round((p.walk_longest_s if walking else p.longest_s) * GRID_HZ)
    height_g = (least_g + most_g) / 2
    norm = np.tile(np.sin(2 * np.pi * np.arange(spacing) / spacing), 30)
    smooth = np.convolve(norm, np.ones(p.smoothing) / p.smoothing, "valid").max()
    norm = height_g + min(0.3, height_g / 3) * (norm - smooth)
    if not least_g < height_g < most_g or height_g < 0.01 or most_g - least_g < 1e-6:
        return
    zero = np.zeros(len(norm)).tolist()
    counter = registry.kind(name).build(p)
    steps = counter.update(SampleBlock(start=0, acc_g=(zero, zero, norm.tolist()))).steps
    assert len(steps) >= 10
