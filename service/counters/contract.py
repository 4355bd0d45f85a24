"""What every step counter promises, and how its parameters are described.

A counter eats a uniform 50 Hz stream in g, block by block, and gives back the steps that are now certain. Any cutting
of the stream into blocks gives the same steps, times and state; a snapshot taken after any sample resumes to the same
result; a block that starts later than the last one ended means a gap: filters start afresh, belief may last, no step
lies inside it. `latency_s` bounds the time from a step to its confirmation, retrospective credit included.
`tests/counters/conformance.py` holds every implementation to this.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Collection, Mapping
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from service.errors import ParameterError, SnapshotError
from service.samples import SampleBlock, Sensor, Step, Update

Snapshot = dict[str, Any]
"""Plain data (JSON-able): the counter's name, version, a hash of its parameters and its state."""


class StepCounter(Protocol):
    """A streaming step counter; `name`, `sensors`, `version` and `latency_s` are constants of an instance."""

    @property
    def name(self) -> str:
        """The registry's name of the algorithm."""

    @property
    def sensors(self) -> Collection[Sensor]:
        """What a block must hold."""

    @property
    def latency_s(self) -> float:
        """The longest time from a step to its confirmation, in seconds of device time."""

    @property
    def time_error_s(self) -> float:
        """How far a step's time may be off besides half a sample: by what its filters delay one motion or another."""

    def update(self, block: SampleBlock) -> Update:
        """Count on over `block`; blocks come in order and do not overlap."""

    def finish(self) -> Update:
        """End the stream: decide what is still pending."""

    def snapshot(self) -> Snapshot:
        """Return the whole state as plain data."""

    def restore(self, state: Snapshot) -> None:
        """Take over a snapshot's state; SnapshotError where it is another counter's."""


@runtime_checkable
class RecordingCounter(StepCounter, Protocol):
    """A counter that can also count a whole recording at once, faster and to the same steps."""

    def count(self, block: SampleBlock) -> NDArray[np.float64]:
        """Count `block` from a fresh state, as `update` and `finish` would; return a row a step."""

    def read(self, rows: NDArray[np.float64]) -> tuple[Step, ...]:
        """Return the steps that `count`'s rows say."""


def lacking(name: str, needed: Collection[Sensor], has: Collection[Sensor]) -> str | None:
    """Return the sentence that says what the counter `name` needs and the device has not; None where it has all."""
    missing = [sensor for sensor in Sensor if sensor in needed and sensor not in has]
    if not missing:
        return None
    return f"{name} needs {', '.join(missing)}; the device has {', '.join(sorted(has)) or 'none'}"


Params = TypeVar("Params")


def parameter(default: Any, *, unit: str, low: float, high: float, text: str) -> Any:  # noqa: ANN401
    """Declare a numeric field of a counter's parameters: its default, unit, range (inclusive) and meaning."""
    return dataclasses.field(default=default, metadata={"unit": unit, "low": low, "high": high, "text": text})


def choice(default: str, *, options: tuple[str, ...], text: str) -> Any:  # noqa: ANN401
    """Declare a field of a counter's parameters that takes one of a few words."""
    return dataclasses.field(default=default, metadata={"options": options, "text": text})


def ordered(params: object, lower: str, higher: str, *, equal: bool = False) -> None:
    """Raise ParameterError, which names both, unless `lower` is less than `higher` (or `equal` to it, where allowed).

    For the `__post_init__` of a counter's parameters, where they may contradict each other.
    """
    low, high = getattr(params, lower), getattr(params, higher)
    if low > high or (low == high and not equal):
        unit = {f.name: f for f in dataclasses.fields(params)}[higher].metadata["unit"]  # type: ignore[arg-type]
        raise ParameterError(lower, low, f"{'at most' if equal else 'less than'} {higher}, which is {high:g} {unit}")


def with_overrides(params: Params, overrides: Mapping[str, object]) -> Params:
    """Return `params` with `overrides` (values or their text), each checked, then all together.

    ParameterError says what is wrong, or which two contradict each other.
    """
    fields = {f.name: f for f in dataclasses.fields(params)}  # type: ignore[arg-type]
    changed: dict[str, object] = {}
    for name, value in overrides.items():
        if name not in fields:
            raise ParameterError(name, value, f"no such parameter; there are {', '.join(sorted(fields))}")
        changed[name] = _checked(fields[name], value)
    return dataclasses.replace(params, **changed)  # type: ignore[type-var]


def _checked(field: dataclasses.Field[Any], value: object) -> object:
    options = field.metadata.get("options")
    if options is not None:
        if value not in options:
            raise ParameterError(field.name, value, f"one of {', '.join(options)}")
        return value
    low, high, unit = (field.metadata[key] for key in ("low", "high", "unit"))
    whole = isinstance(field.default, int)
    try:
        number = float(str(value))
    except ValueError:
        raise ParameterError(field.name, value, f"a number from {low} to {high} {unit}") from None
    if whole and number % 1:
        raise ParameterError(field.name, value, f"a whole number from {low} to {high} {unit}")
    if not low <= number <= high:
        raise ParameterError(field.name, value, f"from {low} to {high} {unit}")
    return int(number) if whole else number


def params_hash(params: object) -> str:
    """Return a short hash of a counter's parameters, so that a snapshot fits only the counter that made it."""
    text = json.dumps(dataclasses.asdict(params), sort_keys=True)  # type: ignore[call-overload]
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def check_snapshot(state: Snapshot, *, name: str, version: int, params: object) -> None:
    """Raise SnapshotError unless `state` was made by this counter, version and parameters."""
    wanted = {"counter": name, "version": version, "params": params_hash(params)}
    for key, value in wanted.items():
        if state.get(key) != value:
            raise SnapshotError(f"snapshot has {key} {state.get(key)!r}, this counter {value!r}")
