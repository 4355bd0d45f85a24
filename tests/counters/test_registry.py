"""The registry: names, presets, overrides and sensors."""

from __future__ import annotations

import dataclasses
from types import MappingProxyType

import pytest

from service.config import Settings
from service.counters import registry
from service.counters.double_threshold import TUNED
from service.errors import CounterError, ParameterError
from service.samples import Sensor


@pytest.mark.parametrize("name", registry.COUNTERS)
def test_every_counter_has_both_presets_and_knows_its_name(name):
    kind = registry.kind(name)
    assert set(kind.presets) == {"paper", "tuned"}
    assert all(isinstance(params, kind.params) for params in kind.presets.values())
    assert registry.make(name).name == name


@pytest.mark.parametrize("name", registry.COUNTERS)
def test_every_parameter_says_what_it_is_and_every_preset_is_in_range(name):
    kind = registry.kind(name)
    for field in dataclasses.fields(kind.params):
        assert field.metadata["text"]
        assert "options" in field.metadata or {"unit", "low", "high"} <= set(field.metadata)
    for preset, params in kind.presets.items():
        assert registry.parameters(name, preset, dataclasses.asdict(params)) == params


def test_the_default_and_what_runs_beside_it_are_there_and_are_the_options_defaults():
    assert {registry.DEFAULT, registry.BESIDE} <= registry.COUNTERS.keys()
    assert (Settings().counter, Settings().beside) == (registry.DEFAULT, (registry.BESIDE,))


def test_only_steplink_has_no_paper_and_its_presets_are_the_same():
    same = [name for name, kind in registry.COUNTERS.items() if kind.presets["paper"] == kind.presets["tuned"]]
    assert same == ["steplink"]


def test_tuned_is_the_default_preset():
    assert registry.parameters("double_threshold") == TUNED


def test_overrides_reach_the_counter():
    counter = registry.make("double_threshold", "paper", {"bout": "3"})
    assert counter.snapshot()["params"] != registry.make("double_threshold", "paper").snapshot()["params"]


def test_a_wrong_override_is_refused():
    with pytest.raises(ParameterError, match="valley_wait"):
        registry.make("double_threshold", overrides={"valley_wait": 5000})


def test_an_unknown_counter_or_preset_lists_the_known_ones():
    with pytest.raises(CounterError, match=registry.DEFAULT):
        registry.make("triple_threshold")
    with pytest.raises(CounterError, match="paper, tuned"):
        registry.make(registry.DEFAULT, "best")


def test_a_missing_sensor_is_named():
    assert registry.make("double_threshold", sensors=[Sensor.ACCELEROMETER]).name == "double_threshold"
    with pytest.raises(CounterError, match="needs accelerometer; the device has gyroscope"):
        registry.make("double_threshold", sensors=[Sensor.GYROSCOPE])
    with pytest.raises(CounterError, match="none"):
        registry.make("double_threshold", sensors=[])


def test_the_registry_cannot_be_changed():
    assert isinstance(registry.COUNTERS, MappingProxyType)
    with pytest.raises(TypeError):
        registry.kind("double_threshold").presets["paper"] = TUNED


@pytest.mark.parametrize("name", registry.COUNTERS)
def test_a_counter_itself_says_what_it_needs(name):
    assert set(registry.make(name).sensors) == registry.kind(name).sensors
