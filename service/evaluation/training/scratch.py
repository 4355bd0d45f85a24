"""A training from nothing: one run on everything that may teach, and the cross-validations that say what it is worth.

The first run makes the weights, and counts the sources whose licence keeps them from teaching: unseen ones. A
cross-validation holds back each source, or a part of the subjects, from runs of the same recipe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from service.evaluation.training import folds
from service.evaluation.training.material import Material, exercises, synthetic
from service.evaluation.training.recipe import ARMS, STEPS, WEARERS
from service.evaluation.training.runs import Run, Trained
from service.evaluation.training.validation import Validation, validation

WEARERS_SEED: Final = 5
ARMS_SEED: Final = 6

UNSEEN: Final = "Sources that never taught"
TITLES: Final = {folds.SOURCES: "Each source held back", folds.SUBJECTS: "Subjects held back, part by part"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is to be trained; `material` begins with the `teaching` recordings, and the first run makes the weights."""

    material: Sequence[Material]
    teaching: int
    runs: Sequence[Run]
    kinds: Sequence[str]
    """Of each run after the first: which cross-validation it belongs to."""


def plan(
    teaching: Sequence[Material],
    unseen: Sequence[Material],
    *,
    wanted: Sequence[str] = (),
    steps: int = STEPS,
    seed: int = 1,
    seeds: int = 1,
) -> Plan:
    """Return the runs: cross-validations as `wanted`, each with so many `seeds`. ParameterError where one cannot be."""
    made = [*synthetic(WEARERS, seed=WEARERS_SEED), *exercises(ARMS, seed=ARMS_SEED)]
    material = [*teaching, *made, *unseen]
    n = len(teaching)
    always = tuple(range(n, n + len(made)))

    def run(name: str, taught: tuple[int, ...], held: tuple[int, ...], number: int = seed) -> Run:
        return Run(name=name, taught=(*taught, *always), held=held, seed=number, steps=steps, checkpoints=(steps,))

    runs = [run("all that teaches", tuple(range(n)), tuple(range(n + len(made), len(material))))]
    kinds: list[str] = []
    for kind in dict.fromkeys(wanted):
        for fold in folds.by_source(teaching) if kind == folds.SOURCES else folds.by_subject(teaching):
            for number in range(seed, seed + seeds):
                runs.append(run(f"{kind} without {fold.name}", fold.taught(teaching), fold.held, number))
                kinds.append(kind)
    return Plan(material=material, teaching=n, runs=runs, kinds=kinds)


def validations(plan: Plan, trained: Sequence[Trained]) -> list[Validation]:
    """Return what the runs found in what they were not taught."""
    final, *others = trained
    found = [
        validation(TITLES[kind], (one for one, of in zip(others, plan.kinds, strict=True) if of == kind), plan.material)
        for kind in dict.fromkeys(plan.kinds)
    ]
    if final.run.held:
        found.append(validation(UNSEEN, [final], plan.material))
    return found
