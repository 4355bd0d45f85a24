"""Every counter by name: its parameters, presets, calibrations, the sensors it needs and how it is built.

A new counter is its own file and one line in `_KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from service.counters import (
    adaptive_peak,
    autocorrelation,
    conventional_peak,
    double_threshold,
    fusion,
    gyro_zero_crossing,
    plus_minus,
    steplink,
    steplink_fast,
)
from service.counters.contract import StepCounter, lacking, with_overrides
from service.counters.learning import MIDDLE, SLOWEST_WALK, WALK, Method
from service.errors import CounterError, ParameterError
from service.samples import Sensor

DEFAULT: Final = "steplink"
"""The counter that runs where none is asked for."""

BESIDE: Final = "double_threshold"
"""The counter that runs beside it, so that one sees what it refused."""

ACCELEROMETER: Final = frozenset({Sensor.ACCELEROMETER})
GYROSCOPE: Final = frozenset({Sensor.GYROSCOPE})


@dataclass(frozen=True, slots=True, kw_only=True)
class CounterKind:
    """One algorithm: `presets` holds its parameter sets `paper` and `tuned`, `build` makes a counter of one.

    Both names are known for every counter, since tools ask for either of all; ours has no paper, and both are the same.
    """

    name: str
    params: type
    presets: Mapping[str, Any]
    sensors: frozenset[Sensor]
    build: Callable[[Any], StepCounter]
    calibrations: Mapping[str, Method]
    """Ways to learn some of its parameters from a walk, by name."""
    compile_live: Callable[[], object] | None = None
    """Compiles what a live session is quicker with, for seconds; those that run go on with it, and count the same."""

    def calibration(self, name: str) -> Method:
        """Return the method of that name; CounterError lists those it has."""
        if name not in self.calibrations:
            has = ", ".join(self.calibrations) or "none"
            raise CounterError(f"{self.name} has no calibration {name!r}; it has {has}")
        return self.calibrations[name]


def _kind(
    name: str,
    build: Callable[[Any], StepCounter],
    *,
    paper: object,
    tuned: object,
    sensors: frozenset[Sensor],
    calibrations: tuple[Method, ...] = (),
    compile_live: Callable[[], object] | None = None,
) -> CounterKind:
    return CounterKind(
        name=name,
        params=type(paper),
        presets=MappingProxyType({"paper": paper, "tuned": tuned}),
        sensors=sensors,
        build=build,
        calibrations=MappingProxyType({method.name: method for method in calibrations}),
        compile_live=compile_live,
    )


_KINDS: Final = (
    _kind(
        "steplink",
        steplink.build,
        paper=steplink.TUNED,
        tuned=steplink.TUNED,
        sensors=ACCELEROMETER,
        compile_live=steplink_fast.compile_live,
    ),
    _kind(
        "double_threshold",
        double_threshold.build,
        paper=double_threshold.PAPER,
        tuned=double_threshold.TUNED,
        sensors=ACCELEROMETER,
        calibrations=(WALK, MIDDLE),
    ),
    _kind(
        "autocorrelation",
        autocorrelation.build,
        paper=autocorrelation.PAPER,
        tuned=autocorrelation.TUNED,
        sensors=ACCELEROMETER,
    ),
    _kind(
        "gyro_zero_crossing",
        gyro_zero_crossing.build,
        paper=gyro_zero_crossing.PAPER,
        tuned=gyro_zero_crossing.TUNED,
        sensors=GYROSCOPE,
        calibrations=(SLOWEST_WALK,),
    ),
    _kind("fusion", fusion.build, paper=fusion.PAPER, tuned=fusion.TUNED, sensors=frozenset(Sensor)),
    _kind(
        "adaptive_peak",
        adaptive_peak.build,
        paper=adaptive_peak.PAPER,
        tuned=adaptive_peak.TUNED,
        sensors=ACCELEROMETER,
    ),
    _kind(
        "conventional_peak",
        conventional_peak.build,
        paper=conventional_peak.PAPER,
        tuned=conventional_peak.TUNED,
        sensors=ACCELEROMETER,
    ),
    _kind("plus_minus", plus_minus.build, paper=plus_minus.PAPER, tuned=plus_minus.TUNED, sensors=ACCELEROMETER),
)

COUNTERS: Final[Mapping[str, CounterKind]] = MappingProxyType({kind.name: kind for kind in _KINDS})


def kind(name: str) -> CounterKind:
    """Return the counter of that name; CounterError lists the known ones."""
    if name not in COUNTERS:
        raise CounterError(f"no counter {name!r}; there are {', '.join(COUNTERS)}")
    return COUNTERS[name]


def parameters(name: str, preset: str = "tuned", overrides: Mapping[str, object] | None = None) -> Any:  # noqa: ANN401
    """Return a preset's parameters with `overrides`, each checked; CounterError, or ParameterError for an override."""
    presets = kind(name).presets
    if preset not in presets:
        raise CounterError(f"{name} has no preset {preset!r}; there are {', '.join(presets)}")
    try:
        return with_overrides(presets[preset], overrides or {})
    except ParameterError as error:  # several counters have a parameter of that name
        raise ParameterError(f"{name}.{error.name}", error.value, error.why) from None


def require_sensors(name: str, sensors: Collection[Sensor] | None) -> None:
    """Raise CounterError where a device with `sensors` lacks what the counter needs; None: nobody knows yet."""
    why = None if sensors is None else lacking(name, kind(name).sensors, sensors)
    if why is not None:
        raise CounterError(why)


def make(
    name: str,
    preset: str = "tuned",
    overrides: Mapping[str, object] | None = None,
    sensors: Collection[Sensor] | None = None,
) -> StepCounter:
    """Build a counter; where `sensors` says what the device has, CounterError names those that are missing."""
    require_sensors(name, sensors)
    return kind(name).build(parameters(name, preset, overrides))
