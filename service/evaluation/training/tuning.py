"""Fine-tuning: the network goes on learning from somebody's own recordings, and it is told whether that helped.

Few steps at a low rate, so that little of what it knew is lost; synthetic walks, and motion without a step, are mixed
in for the same reason. The recordings are dealt out into folds; each is held back once from a training on the others
and counted before and after, so that every figure is of a recording that was not learnt from. How long to train is
chosen among CHECKPOINTS, for each fold by the other folds alone, so that the choice flatters no figure. What is written
has learnt from all recordings, for as long as was best over all folds.

One unit compares walks and motion without steps: wrong steps a minute, |counted − true| of a recording over its length.
It helped where their mean falls, more recordings got better than worse, and the synthetic walks, of wearers not mixed
in, did not suffer (by more than LOST_PER_MIN).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from service.counters.steplink_network import Weights
from service.evaluation.families import false_per_hour
from service.evaluation.metrics import error_percent
from service.evaluation.training.folds import Fold, of_own
from service.evaluation.training.material import Material, of_walker, synthetic
from service.evaluation.training.recipe import TUNING_RATE
from service.evaluation.training.runs import Arrays, Checkpoint, Run, Trained, counted
from service.evaluation.training.validation import outcome

CHECKPOINTS: Final = (0.25, 0.5, 1.0)
"""Shares of the steps."""

WEARERS: Final = 12
MIXED_SEED: Final = 11
ASIDE_SEED: Final = 12
QUIET: Final = (
    "brush:30,rest:6,type:25,knock:6,rest:5",
    "drive:40,rest:4,gesture:30",
    "sit:8,type:30,stand:8,gesture:20,turn_round:8",
)
"""What synthetic wearers do without a step, in seconds each."""

LOST_PER_MIN: Final = 0.5
"""Wrong steps a minute that synthetic walks may gain: one in two hundred."""

FINAL: Final = "all of them"
SECONDS_PER_MINUTE: Final = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is to be trained: `material` begins with the `own` recordings; the last run is of all of them."""

    material: Sequence[Material]
    own: int
    folds: Sequence[Fold]
    runs: Sequence[Run]


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """Counts of the same recordings, before or after."""

    walks_percent: float | None
    """Mean absolute error of those that hold steps."""
    false_per_hour: float | None
    """Of those that hold none."""
    wrong_per_min: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdict:
    """Whether it helped, and the figures it is taken from."""

    before: Side
    after: Side
    synthetic_before: Side
    synthetic_after: Side
    better: int
    worse: int
    recordings: int
    chosen: Checkpoint
    """Weights that have learnt from all."""

    @property
    def helped(self) -> bool:
        """Whether the counter is better for these recordings, and about as good elsewhere."""
        gained = self.after.wrong_per_min < self.before.wrong_per_min and self.better > self.worse
        return gained and not self.forgot

    @property
    def forgot(self) -> bool:
        """Whether synthetic walks suffered."""
        return self.synthetic_after.wrong_per_min > self.synthetic_before.wrong_per_min + LOST_PER_MIN


def plan(own: Sequence[Material], start: Arrays, *, steps: int, seed: int) -> Plan:
    """Return the runs; ParameterError where there are too few recordings."""
    folds = of_own(own)
    mixed = [*synthetic(WEARERS, seed=MIXED_SEED), *quiet(WEARERS, seed=MIXED_SEED)]
    aside = [*synthetic(WEARERS, seed=ASIDE_SEED), *quiet(WEARERS, seed=ASIDE_SEED)]
    material = [*own, *mixed, *aside]
    always = tuple(range(len(own), len(own) + len(mixed)))
    kept_aside = tuple(range(len(own) + len(mixed), len(material)))
    checkpoints = tuple(sorted({max(round(share * steps), 1) for share in CHECKPOINTS}))

    def run(name: str, taught: tuple[int, ...], held: tuple[int, ...]) -> Run:
        return Run(
            name=name,
            taught=(*taught, *always),
            held=held,
            seed=seed,
            steps=steps,
            checkpoints=checkpoints,
            start=start,
            rate=TUNING_RATE,
        )

    runs = [run(fold.name, fold.taught(own), fold.held) for fold in folds]
    return Plan(
        material=material, own=len(own), folds=folds, runs=[*runs, run(FINAL, tuple(range(len(own))), kept_aside)]
    )


def verdict(plan: Plan, trained: Sequence[Trained], start: Weights) -> Verdict:
    """Return whether it helped: `trained` are the plan's runs, `start` the weights they started from."""
    *folds, final = trained
    own = range(plan.own)
    before = {place: counted(plan.material[place], start) for place in own}
    by_checkpoint = [
        {place: found for one in folds for place, found in one.kept[number].counted.items()}
        for number in range(len(final.kept))
    ]
    after = {
        place: by_checkpoint[_best(plan, by_checkpoint, [other for other in own if other not in fold.held])][place]
        for fold in plan.folds
        for place in fold.held
    }
    chosen = final.kept[_best(plan, by_checkpoint, list(own))]
    known = {place: counted(plan.material[place], start) for place in chosen.counted}
    wrong = [(_wrong(plan.material[place], before[place]), _wrong(plan.material[place], after[place])) for place in own]
    return Verdict(
        before=_side(plan.material, before),
        after=_side(plan.material, after),
        synthetic_before=_side(plan.material, known),
        synthetic_after=_side(plan.material, chosen.counted),
        better=sum(now < then for then, now in wrong),
        worse=sum(now > then for then, now in wrong),
        recordings=plan.own,
        chosen=chosen,
    )


def _best(plan: Plan, by_checkpoint: Sequence[Mapping[int, int]], places: Sequence[int]) -> int:
    """Return which checkpoint has the fewest wrong steps at these places, the earliest of equals."""

    def wrong(number: int) -> float:
        return sum(_wrong(plan.material[place], by_checkpoint[number][place]) for place in places)

    return min(range(len(by_checkpoint)), key=wrong)


def _wrong(one: Material, counted: int) -> float:
    return abs(counted - one.true_steps) / one.duration_s * SECONDS_PER_MINUTE


def _side(material: Sequence[Material], found: Mapping[int, int]) -> Side:
    outcomes = [outcome(material[place], count) for place, count in found.items()]
    walks = [error_percent(one.counted, one.true) for one in outcomes if one.true]
    still = [one for one in outcomes if not one.true]
    wrong = [_wrong(material[place], count) for place, count in found.items()]
    return Side(
        walks_percent=sum(walks) / len(walks) if walks else None,
        false_per_hour=false_per_hour(still) if still else None,
        wrong_per_min=sum(wrong) / len(wrong),
    )


def quiet(wearers: int, *, seed: int) -> list[Material]:
    """Return synthetic motion at the wrist without a step."""
    from device_sim.gait import Walker  # noqa: PLC0415

    made = []
    for number in range(wearers):
        rng = np.random.default_rng([seed, number, 0])
        walker = Walker(
            QUIET[number % len(QUIET)], seed=int(rng.integers(2**31)), noise_g=float(rng.uniform(0.002, 0.02))
        )
        made.append(of_walker(walker, number))
    return made


LINES: Final = ("error of walks", "false steps an hour", "wrong steps a minute")


def table(found: Verdict) -> list[tuple[str, ...]]:
    """Return the figures before and after, as lines for people; what no recording has is left out."""
    head = ("", "before", "after")
    own = zip(LINES, _cells(found.before), _cells(found.after), strict=True)
    other = zip(LINES, _cells(found.synthetic_before), _cells(found.synthetic_after), strict=True)
    lines = [line for line in own if line[1]]
    return [head, *lines, *((f"synthetic: {name}", then, now) for name, then, now in other)]


def _cells(side: Side) -> tuple[str, str, str]:
    walks, false = side.walks_percent, side.false_per_hour
    return (
        "" if walks is None else f"{walks:.1f} %",
        "" if false is None else f"{false:.0f}",
        f"{side.wrong_per_min:.2f}",
    )


def sentence(found: Verdict) -> str:
    """Return the verdict in words."""
    counts = f"of {found.recordings} recordings held back, {found.better} got better and {found.worse} worse"
    if found.helped:
        return f"It helped: {counts}."
    if found.forgot:
        return f"It did not help: the network forgot what it knew of other walks ({counts})."
    return f"It did not help: {counts}. More recordings, or of more kinds, may."
