"""What a paper tested and what it printed, as values: conditions, tables, claims.

The synthetic conditions were written down before any counter ran on them and stay as they are: a counter is judged by
them, they are not chosen for it. What walkers do in them is measured on real recordings (`device_sim.gait_profiles`,
`device_sim.gait_poses`, where each row says on which, or that nobody recorded it).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from service.samples import SampleBlock

Prepare = Callable[[SampleBlock, SampleBlock | None, Any], Mapping[str, Any]]
"""(the walk, the calibration walk, parameters) → parameters that the paper takes from the walker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One activity of `device_sim.gait`: `steps` steps, or `duration_s` where nobody steps."""

    activity: str
    steps: int = 0
    duration_s: float = 0.0
    cadence_spm: float | None = None


def walk(activity: str, steps: int, cadence_spm: float | None = None) -> Part:
    """Return a walk of so many steps, at the activity's own cadence unless another is given."""
    return Part(activity=activity, steps=steps, cadence_spm=cadence_spm)


def do(activity: str, duration_s: float) -> Part:
    """Return so many seconds of something that is no step."""
    return Part(activity=activity, duration_s=duration_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What a table prints of one condition: means and variances of steps, accuracy in percent; None where it does not.

    Of a single walk there are only the means. `low` and `high` are the least and the greatest accuracy over walkers.
    """

    true: float | None = None
    counted: float | None = None
    accuracy: float | None = None
    true_var: float | None = None
    counted_var: float | None = None
    accuracy_var: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A counter as a table names it: `params` over its preset; on the other wrist where `mirrored`.

    `by_axis`: it leaves an axis out, so a recording that holds nothing but the magnitude says nothing about it.
    """

    label: str
    counter: str
    params: Mapping[str, Any] = field(default_factory=dict)
    mirrored: bool = False
    by_axis: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One row: `walkers` people do `parts`, the sensor carried in `pose`; `published` is by the method's label.

    `disturbed` adds a passing magnet's field.
    """

    label: str
    parts: tuple[Part, ...]
    pose: str = "wrist"
    walkers: int = 1
    disturbed: bool = False
    published: Mapping[str, Figures] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """True steps of each walker."""
        return sum(part.steps for part in self.parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table: its rows, its methods, and `noise_g`, the sensor's white noise where it is part of the experiment."""

    title: str
    methods: tuple[Method, ...]
    rows: tuple[Condition, ...]
    note: str = ""
    noise_g: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the text says: an accuracy of `percent` by `method`, in the rows that hold `rows` of the tables `tables`.

    It is of their mean, of the least mean of a row, or of the least walker (`of`: "mean", "least mean", "least").
    `about` is what it concerns in a word or two, for a figure, and where there are several methods the same for all.
    """

    text: str
    method: str
    percent: float
    of: str
    tables: tuple[int, ...]
    about: str
    rows: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Real:
    """Real recordings of a condition: those whose `placement` and `activity` match these regular expressions.

    `claims` are published accuracies in percent, by the method's label.
    """

    label: str
    placement: str
    activity: str = ".*"
    claims: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """One paper: where it is from, its tables, its claims, what of it real recordings can show.

    `elapsed_s` is the published time for 5,000 samples by counter. `prepare` learns a counter's
    parameters from each walker, on `calibration` where the paper has such a walk.
    """

    name: str
    title: str
    tables: tuple[Table, ...]
    claims: tuple[Claim, ...]
    real: tuple[Real, ...]
    elapsed_s: Mapping[str, float] = field(default_factory=dict)
    calibration: Condition | None = None
    prepare: Prepare | None = None
