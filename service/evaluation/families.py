"""How well a counter counts, by family: kinds of walking and of step-free motion that a user would judge apart.

A family of walks has the mean over its recordings of the absolute percentage error; a step-free one the false steps
an hour, all its steps over all its hours. Beside it stands the mean over the sources (data sets), in which a source of
many recordings weighs no more than one of few. `LIMITS` says what a counter must reach and what it aims at.

A recording belongs to one family: by the data set where a family is that data set, else by what was worn where, and
of step-free motion by what its activity is called. Nothing here reads a file: whoever counts (an evaluation, a fold of
a cross-validation) brings plain values.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from service.evaluation.metrics import SECONDS_PER_HOUR, error_percent


class Family(StrEnum):
    """Kinds of recordings, in the order they are told; the first two hold steps."""

    WRIST = "wrist walks"
    PHONE = "phone walks"
    EXERCISE = "rehab exercise"
    HOUSEHOLD = "household"
    DRIVING_AND_DESK = "driving and desk"
    PEBBLE = "Pebble non-walking"
    HANDLING = "phone handling"
    TRANSITIONS = "getting up and down"
    """Apart from the household: each may hide a step."""


WALKS: Final = frozenset({Family.WRIST, Family.PHONE})


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What a family's value must not exceed, and what is aimed at: % of the true steps, or false steps an hour."""

    must: float
    aim: float


LIMITS: Final[Mapping[Family, Limit]] = MappingProxyType(
    {
        Family.WRIST: Limit(must=5.5, aim=3.0),
        Family.PHONE: Limit(must=2.2, aim=1.4),
        Family.EXERCISE: Limit(must=350.0, aim=120.0),
        Family.HOUSEHOLD: Limit(must=200.0, aim=60.0),
        Family.DRIVING_AND_DESK: Limit(must=8.0, aim=2.0),
        Family.PEBBLE: Limit(must=200.0, aim=60.0),
        Family.HANDLING: Limit(must=40.0, aim=10.0),
    }
)

APPROXIMATE: Final = "B"
"""`quality` of a recording whose truth is not certain."""

_BY_DATASET: Final = {
    "negatives_spar_watch": Family.EXERCISE,
    "negatives_hmp": Family.HOUSEHOLD,
    "negatives_banglejs": Family.DRIVING_AND_DESK,
    "pebble_wrist": Family.PEBBLE,
    "brajdic_handling": Family.HANDLING,
}
"""Of step-free recordings."""

_TRANSITION: Final = re.compile(r"get_?up|stand_?up|sit_?down|lie_?down")
_BY_ACTIVITY: Final = (
    (_TRANSITION, Family.TRANSITIONS),
    (re.compile(r"exercise|physio|rehab"), Family.EXERCISE),
    (re.compile(r"driv|desk|typing|(?<![a-z])pc|(?<![a-z])rest|reading|sitting"), Family.DRIVING_AND_DESK),
    (re.compile(r"brush|comb|drink|(?<![a-z])eat|pour|telephone|wash|dish|cook|dress|lace"), Family.HOUSEHOLD),
    (re.compile(r"handling"), Family.HANDLING),
)
"""Of step-free recordings of any other data set; the first that is found."""

_WRIST: Final = re.compile(r"wrist")
_PHONE: Final = re.compile(r"hand|pocket|pouch|bag|pack|armband|phone")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One recording and what was counted of it; `true` is None where unknown, `within` what its truth allows.

    `counted` may be a fraction, as a mean over seeds is.
    """

    dataset: str
    true: int | None
    counted: float
    duration_s: float
    placement: str | None = None
    activity: str | None = None
    quality: str | None = None
    within: tuple[int, int] | None = None

    @property
    def family(self) -> Family | None:
        """The recording's family."""
        return family(self.dataset, self.placement, self.activity, self.quality, self.true)


def family(
    dataset: str, placement: str | None, activity: str | None, quality: str | None, true_steps: int | None
) -> Family | None:
    """Return the family of a recording; None where its truth is unknown or nothing says what it is.

    >>> family("anyone", "front_pocket", "walk", "A", 100).value
    'phone walks'
    >>> family("negatives_hmp", "wrist", "getup_bed", "B", 0).value
    'getting up and down'
    """
    if true_steps is None:
        return None
    where, what = (placement or "").lower(), (activity or "").lower()
    if true_steps:
        return Family.WRIST if _WRIST.search(where) else Family.PHONE if _PHONE.search(where) else None
    known = _BY_DATASET.get(dataset)
    if known is Family.HOUSEHOLD and quality == APPROXIMATE:
        return Family.TRANSITIONS
    return known or next((found for pattern, found in _BY_ACTIVITY if pattern.search(what)), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyScore:
    """A family's value: percent of the true steps, or false steps an hour (`is_error` tells which).

    `by_source` has the same of each data set.
    """

    family: Family
    recordings: int
    hours: float
    value: float
    by_source: Mapping[str, float]

    @property
    def is_error(self) -> bool:
        """Whether the value is a percentage error; else it is false steps an hour."""
        return self.family in WALKS

    @property
    def over_sources(self) -> float:
        """Mean over the data sets."""
        return sum(self.by_source.values()) / len(self.by_source)

    @property
    def limit(self) -> Limit | None:
        """What it must reach; None where nothing is asked."""
        return LIMITS.get(self.family)

    @property
    def met(self) -> bool | None:
        """Whether it is what it must be; None where nothing is asked."""
        return None if self.limit is None else self.value <= self.limit.must


def scores(outcomes: Iterable[Outcome]) -> dict[Family, FamilyScore]:
    """Return the score of each family that has recordings, in the families' order.

    >>> walk = Outcome(dataset="a", placement="wrist", true=100, counted=90, duration_s=60.0)
    >>> other = Outcome(dataset="b", placement="wrist", true=50, counted=50, duration_s=30.0)
    >>> found = scores([walk, walk, other])[Family.WRIST]
    >>> round(found.value, 2), found.over_sources, found.met
    (6.67, 5.0, False)
    """
    members: dict[Family, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if (found := outcome.family) is not None:
            members[found].append(outcome)
    return {each: _score(each, members[each]) for each in Family if each in members}


def _score(of: Family, outcomes: Sequence[Outcome]) -> FamilyScore:
    sources: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        sources[outcome.dataset].append(outcome)
    value = _mean_error if of in WALKS else false_per_hour
    return FamilyScore(
        family=of,
        recordings=len(outcomes),
        hours=sum(outcome.duration_s for outcome in outcomes) / SECONDS_PER_HOUR,
        value=value(outcomes),
        by_source={dataset: value(found) for dataset, found in sorted(sources.items())},
    )


def _mean_error(outcomes: Sequence[Outcome]) -> float:
    return sum(error_percent(outcome.counted, outcome.true or 1) for outcome in outcomes) / len(outcomes)


def false_per_hour(outcomes: Sequence[Outcome]) -> float:
    """Return all counted steps over all hours; 0 where there is no time."""
    duration_s = sum(outcome.duration_s for outcome in outcomes)
    return SECONDS_PER_HOUR * sum(outcome.counted for outcome in outcomes) / duration_s if duration_s else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """How many of the recordings whose truth is a range were counted within it."""

    within: int
    recordings: int

    @property
    def percent(self) -> float:
        """Share of them, in percent."""
        return 100.0 * self.within / self.recordings


def within_range(outcomes: Iterable[Outcome]) -> dict[str, Share]:
    """Return, by data set, how many counts lie in the range that their truth allows.

    >>> counted = [Outcome(dataset="a", true=100, counted=n, duration_s=60.0, within=(80, 120)) for n in (79, 80, 120)]
    >>> within_range(counted)["a"]
    Share(within=2, recordings=3)
    """
    held: dict[str, list[bool]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.within is not None:
            low, high = outcome.within
            held[outcome.dataset].append(low <= outcome.counted <= high)
    return {dataset: Share(within=sum(found), recordings=len(found)) for dataset, found in sorted(held.items())}
