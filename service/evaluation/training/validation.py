"""What a training is worth on what it did not learn: families of recordings, by source and by subject held back.

A validation may be repeated with other seeds; a family's value is then the mean over them, with their range beside it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from service.evaluation.families import Family, FamilyScore, Outcome, Share, scores, within_range
from service.evaluation.training.material import Material
from service.evaluation.training.runs import Trained

HEAD: Final = ("family", "rec.", "hours", "value", "must", "aim", "mean of sources", "of each source")

Line = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Recordings that were not learnt from, counted once for each seed."""

    title: str
    outcomes: Mapping[int, Sequence[Outcome]]
    """By seed."""

    def lines(self) -> list[Line]:
        """Return a line for each family."""
        by_seed = [scores(outcomes) for outcomes in self.outcomes.values()]
        return [_line([found[family] for found in by_seed]) for family in Family if family in by_seed[0]]

    def within(self) -> Mapping[str, Share]:
        """Return, by data set, how many counts lie in the range that the truth allows, with all seeds together."""
        return within_range(outcome for found in self.outcomes.values() for outcome in found)


def outcome(one: Material, counted: float) -> Outcome:
    """Return what was counted of a recording."""
    return Outcome(
        dataset=one.source,
        true=one.true_steps,
        counted=counted,
        duration_s=one.duration_s,
        placement=one.placement,
        activity=one.activity,
        quality=one.quality,
        within=one.steps_range,
    )


def validation(title: str, trained: Iterable[Trained], material: Sequence[Material]) -> Validation:
    """Return what runs found in what they held back, of each of their seeds."""
    found: dict[int, dict[int, Outcome]] = defaultdict(dict)
    for one in trained:
        for place, counted in one.kept[-1].counted.items():
            found[one.run.seed][place] = outcome(material[place], counted)
    in_order = {seed: [held[place] for place in sorted(held)] for seed, held in sorted(found.items())}
    return Validation(title=title, outcomes=in_order)


def _line(found: Sequence[FamilyScore]) -> Line:
    first = found[0]
    unit = " %" if first.is_error else "/h"
    limit = first.limit
    sources = "; ".join(f"{name} {_mean([one.by_source[name] for one in found])}" for name in first.by_source)
    return (
        first.family.value,
        str(first.recordings),
        f"{first.hours:.2f}",
        _spread([one.value for one in found]) + unit,
        "" if limit is None else f"{limit.must:g}{unit}",
        "" if limit is None else f"{limit.aim:g}{unit}",
        _mean([one.over_sources for one in found]),
        sources,
    )


def _spread(values: Sequence[float]) -> str:
    if len(values) == 1:
        return _mean(values)
    return f"{_mean(values)} ({min(values):.1f}–{max(values):.1f})"


def _mean(values: Sequence[float]) -> str:
    return f"{sum(values) / len(values):.1f}"
