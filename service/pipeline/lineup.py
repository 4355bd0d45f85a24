"""Which counters run on a device's stream, with which parameters, and whose count is the device's `steps`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from service.counters import registry
from service.counters.contract import StepCounter
from service.errors import ParameterError

NO_OTHER: Final = "none"
"""In place of a counter's name: nothing runs beside the primary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CounterChoice:
    """A counter of the registry with a preset and overrides; called, it makes one.

    Checked when it is made: overrides given as text are then the values that they say.
    """

    name: str
    preset: str = "tuned"
    overrides: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        checked = registry.parameters(self.name, self.preset, self.overrides)
        object.__setattr__(self, "overrides", {key: getattr(checked, key) for key in self.overrides})

    def __call__(self) -> StepCounter:
        """Return a fresh counter."""
        return registry.make(self.name, self.preset, self.overrides)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lineup:
    """The counters of one device: the primary first, each name once."""

    choices: tuple[CounterChoice, ...]

    def __post_init__(self) -> None:
        names = [choice.name for choice in self.choices]
        if not names:
            raise ParameterError("counters", names, "at least one counter")
        if len(set(names)) < len(names):
            raise ParameterError("counters", names, "each counter once")

    @property
    def primary(self) -> str:
        """Name of the counter whose count is the device's."""
        return self.choices[0].name

    def choice(self, name: str) -> CounterChoice:
        """Return how that counter runs, or would: with the primary's preset where it does not run yet."""
        return self.makers.get(name) or CounterChoice(name=name, preset=self.choices[0].preset)

    def taught(self, name: str, params: Mapping[str, object]) -> Lineup:
        """Return the lineup in which that counter goes on with `params` changed, and runs beside if it did not run."""
        known = self.choice(name)
        changed = CounterChoice(name=name, preset=known.preset, overrides={**known.overrides, **params})
        if name not in self.makers:
            return Lineup(choices=(*self.choices, changed))
        return Lineup(choices=tuple(changed if choice.name == name else choice for choice in self.choices))

    def plain(self) -> list[dict[str, object]]:
        """Return it as plain data, to be kept."""
        return [{"name": one.name, "preset": one.preset, "params": dict(one.overrides)} for one in self.choices]

    @classmethod
    def from_plain(cls, choices: Sequence[Mapping[str, Any]]) -> Lineup:
        """Return what `plain` returned; CounterError or ParameterError where this steplink knows it no more."""
        return cls(
            choices=tuple(
                CounterChoice(name=one["name"], preset=one["preset"], overrides=one["params"]) for one in choices
            )
        )

    @property
    def makers(self) -> dict[str, CounterChoice]:
        """What makes each counter, by name."""
        return {choice.name: choice for choice in self.choices}


def lineup(primary: str, *, beside: Iterable[str] = (), preset: str = "tuned", params: Sequence[str] = ()) -> Lineup:
    """Return the lineup that a command line asks for; `params` are NAME.KEY=VALUE.

    CounterError and ParameterError name what is unknown, wrong or out of range.
    """
    names = list(dict.fromkeys([primary, *(name for name in beside if name != NO_OTHER)]))
    overrides: dict[str, dict[str, object]] = {name: {} for name in names}
    for text in params:
        path, equals, value = text.partition("=")
        name, dot, key = path.partition(".")
        if equals and dot and key and name in registry.COUNTERS and name not in overrides:
            raise ParameterError("param", text, f"{name} does not run: add --beside {name}")
        if not (equals and dot and key) or name not in overrides:
            raise ParameterError("param", text, f"NAME.KEY=VALUE with NAME one of {', '.join(names)}")
        overrides[name][key] = value
    return Lineup(choices=tuple(CounterChoice(name=name, preset=preset, overrides=overrides[name]) for name in names))
