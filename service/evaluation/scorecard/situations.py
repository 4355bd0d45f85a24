"""Situations that people ask about, a row each: from real recordings where there are any, else from walkers.

A real one is found by what its activity is called; walkers are those of the papers' tables, ten people each, and each
row of theirs says in `device_sim.gait_profiles` what it was measured on, or that nobody recorded it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from service.errors import CounterError
from service.evaluation.counting import count
from service.evaluation.metrics import error_percent
from service.evaluation.papers import people
from service.evaluation.papers.conditions import Condition, do, walk
from service.evaluation.rows import Choice
from service.evaluation.scorecard.measured import Measured

SYNTHETIC: Final = "walkers"
PEOPLE: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """`activity` names real recordings (a regular expression, the whole name), `walkers` what ten people do."""

    label: str
    activity: str | None = None
    walkers: Condition | None = None


def _walkers(label: str, *parts: tuple[str, int, float | None], pause_s: float = 0.0, pose: str = "wrist") -> Condition:
    """Lay out walks of (activity, steps, steps a minute) with a pause of so many seconds after each."""
    laid = []
    for activity, steps, cadence_spm in parts:
        laid.append(walk(activity, steps, cadence_spm))
        if pause_s:
            laid.append(do("rest", pause_s))
    return Condition(label=label, parts=tuple(laid), pose=pose, walkers=PEOPLE)


SITUATIONS: Final = (
    Situation(label="slow, 0.8 steps/s", walkers=_walkers("0.8 steps/s", ("very_slow", 60, 48.0))),
    Situation(label="slow", activity=r"walk_slow|slow-walking", walkers=_walkers("slow", ("slow", 100, None))),
    Situation(label="normal", walkers=_walkers("normal", ("normal", 100, None))),
    Situation(label="barefoot", activity=r"walk_barefoot"),
    Situation(label="running", activity=r"run|jog", walkers=_walkers("3.2 steps/s", ("run", 160, 192.0))),
    Situation(
        label="stairs up",
        activity=r"walk_upstairs.*",
        walkers=_walkers("stairs up", *[("stairs_up", 20, None)] * 4, pause_s=3.0),
    ),
    Situation(
        label="stairs down",
        activity=r".*steps_down",
        walkers=_walkers("stairs down", *[("stairs_down", 20, None)] * 4, pause_s=3.0),
    ),
    Situation(
        label="five-step walks",
        activity=r"five_steps",
        walkers=_walkers("five steps", *[("normal", 5, None)] * 10, pause_s=10.0),
    ),
    Situation(
        label="start-stop",
        activity=r"mixed_indoor",
        walkers=_walkers("start-stop", *[("normal", 15, None)] * 8, pause_s=6.0),
    ),
    Situation(
        label="hand in pocket",
        activity=r"walk_hands_in_pocket",
        walkers=_walkers("hand in pocket", ("pocket", 100, None)),
    ),
    Situation(label="pushing a trolley", walkers=_walkers("pushing a trolley", ("trolley", 100, None))),
    Situation(label="stepping in place", walkers=_walkers("stepping in place", ("in_place", 100, None))),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Walked:
    """One walk of a situation, real or not (`source`), and what a counter made of it."""

    label: str
    source: str
    counter: str
    true: int
    counted: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SituationRow:
    """All walks of one situation and source: mean absolute error, bias and worst, in % of the true steps."""

    label: str
    source: str
    walks: int
    true: int
    counted: int
    error: float
    bias: float
    worst: float


def synthetic(situation: Situation, chosen: Sequence[Choice]) -> list[Walked]:
    """Return what each counter makes of the situation's walkers; empty where it has none."""
    made: list[Walked] = []
    condition = situation.walkers
    for k in range(condition.walkers) if condition is not None else ():
        assert condition is not None  # noqa: S101  # asked above
        block = people.block(condition, k)
        for choice in chosen:
            try:
                counted = count(block, choice.counter, choice.preset, choice.overrides).steps
            except CounterError:
                continue
            made.append(
                Walked(
                    label=situation.label,
                    source=SYNTHETIC,
                    counter=choice.counter,
                    true=condition.steps,
                    counted=counted,
                )
            )
    return made


def real(rows: Iterable[Measured]) -> list[Walked]:
    """Return the real recordings of each situation."""
    return [
        Walked(
            label=situation.label,
            source=row.file.dataset,
            counter=row.counter,
            true=row.true_steps,
            counted=row.steps,
        )
        for row in rows
        if row.true_steps and row.steps is not None
        for situation in SITUATIONS
        if situation.activity is not None and re.fullmatch(situation.activity, row.activity or "")
    ]


def table(walked: Iterable[Walked]) -> list[SituationRow]:
    """Return a row for each situation and source, in the situations' order, real ones first."""
    groups: dict[tuple[str, str], list[Walked]] = defaultdict(list)
    for each in walked:
        groups[each.label, each.source].append(each)
    order = [situation.label for situation in SITUATIONS]
    keys = sorted(groups, key=lambda key: (order.index(key[0]), key[1] == SYNTHETIC, key[1]))
    return [_row(*key, groups[key]) for key in keys]


def _row(label: str, source: str, walked: Sequence[Walked]) -> SituationRow:
    errors = [error_percent(each.counted, each.true) for each in walked]
    true, counted = sum(each.true for each in walked), sum(each.counted for each in walked)
    return SituationRow(
        label=label,
        source=source,
        walks=len(walked),
        true=true,
        counted=counted,
        error=sum(errors) / len(errors),
        bias=100.0 * (counted - true) / true,
        worst=max(errors),
    )
