"""The scorecard as tables, once for the terminal and the guide: the counters side by side, each figure by its limit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeVar

from service.evaluation.families import LIMITS, WALKS, Family
from service.evaluation.scorecard import budget
from service.evaluation.scorecard.card import ASKED_DISTURBANCES, Scorecard
from service.evaluation.scorecard.disturbances import MUST_PERCENT, NATIVE, NONE_ABOVE_PERCENT
from service.evaluation.tables import aligned

Row = TypeVar("Row")

F1_MUST: Final = 0.9
REASONS_SHOWN: Final = 3
OVER: Final = "!"
"""Beside a value that is over its limit."""
WHOLE_FROM: Final = 20.0
"""False steps an hour from which on a tenth is not told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """`left` columns hold words, the others figures; `note` says how it is read."""

    title: str
    columns: Sequence[str]
    lines: Sequence[Sequence[str]]
    note: str = ""
    left: int = 2

    def text(self) -> str:
        """Return it for a terminal."""
        parts = [self.title, *([self.note] if self.note else [])]
        return "\n".join([*parts, aligned([self.columns, *self._told_once()], left=self.left)])

    def markdown(self) -> str:
        """Return it for the guide, whose policy refuses the style that an alignment becomes."""
        rule = ["---"] * len(self.columns)
        rows = "\n".join(f"| {' | '.join(line)} |" for line in (self.columns, rule, *self._told_once()))
        return "\n\n".join([f"### {self.title}", *([self.note] if self.note else []), rows])

    def _told_once(self) -> list[list[str]]:
        """Leave out what the line above has begun with too."""
        lines = [list(line) for line in self.lines]
        for before, line in reversed(list(pairwise(lines))):
            if before[0] == line[0]:
                line[0] = ""
        return lines


def text(cards: Sequence[Scorecard]) -> str:
    """Return everything for a terminal."""
    asked = "; ".join(f"{card.counter} (preset {card.preset})" for card in cards)
    return "\n\n".join(
        [f"scorecard of {asked}", *(table.text() for table in (*tables(cards), *shares(cards))), *errors(cards)]
    )


def tables(cards: Sequence[Scorecard]) -> list[Table]:
    """Return every table that has lines."""
    made = [
        families(cards), _sources(cards), _ranges(cards), _splices(cards), _timed(cards), _changes(cards),
        _disturbed(cards), _situations(cards),
    ]  # fmt: skip
    return [table for table in made if table.lines]


def shares(cards: Sequence[Scorecard]) -> list[Table]:
    """Return which activities and which recordings dominate the error of each counter."""
    made = [
        Table(
            title=f"{title}: {card.counter}",
            columns=("family", "what", "rec.", "share %"),
            lines=[
                [part.family.value, part.name, str(part.recordings), f"{part.share:.1f}"] for part in parts(card.rows)
            ],
        )
        for title, parts in budget.RANKINGS.items()
        for card in cards
    ]
    return [table for table in made if table.lines]


def families(cards: Sequence[Scorecard]) -> Table:
    """Return the families' values beside their limits."""
    names = [card.counter for card in cards]
    lines = []
    for family in Family:
        found = [card.families.get(family) for card in cards]
        if (first := next(filter(None, found), None)) is not None:
            values = ["" if score is None else _over(score.value, family) for score in found]
            means = ["" if score is None else _figure(score.over_sources, family) for score in found]
            size = [str(first.recordings), f"{first.hours:.2f}"]
            lines.append([family.value, _unit(family), *values, *_limits(family), *means, *size])
    return Table(
        title="Families",
        note=f"Mean absolute error over the recordings in % of the true steps, or false steps an hour; {OVER} is over "
        "what it must be. Beside it the mean over the sources.",
        columns=("family", "in", *names, "must", "aim", *(f"{name}, sources" for name in names), "rec.", "hours"),
        lines=lines,
    )


def _sources(cards: Sequence[Scorecard]) -> Table:
    def by_source(card: Scorecard, family: Family) -> Mapping[str, float]:
        return card.families[family].by_source if family in card.families else {}

    lines = [
        [family.value, source, _unit(family), *values]
        for family in Family
        for source in dict.fromkeys(name for card in cards for name in by_source(card, family))
        for found in [[by_source(card, family).get(source) for card in cards]]
        for values in [["" if value is None else _figure(value, family) for value in found]]
    ]
    return Table(
        title="Sources",
        note="The same, of each data set.",
        columns=("family", "data set", "in", *(card.counter for card in cards)),
        lines=lines,
        left=3,
    )


def _ranges(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for dataset in dict.fromkeys(name for card in cards for name in card.shares):
        found = [card.shares.get(dataset) for card in cards]
        recordings = max(share.recordings for share in found if share is not None)
        lines.append([dataset, *("" if share is None else f"{share.percent:.1f}" for share in found), str(recordings)])
    return Table(
        title="Counts within what the truth allows",
        note="Where the truth is a range: % of the counts within it.",
        columns=("data set", *(card.counter for card in cards), "rec."),
        lines=lines,
        left=1,
    )


def _splices(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for family in Family:
        found = [card.spliced.get(family) for card in cards]
        if (first := next(filter(None, found), None)) is not None:
            values = ["" if each is None else _over(each.false_per_hour, family) for each in found]
            size = [str(first.subjects), str(first.clips), f"{first.hours:.2f}"]
            lines.append([family.value, *values, *_limits(family), *size])
    return Table(
        title="Step-free clips between two walks",
        note="All clips of a subject in a row, between two pieces of a walk; false steps an hour of the clips.",
        columns=("family", *(card.counter for card in cards), "must", "aim", "subjects", "clips", "hours"),
        lines=lines,
        left=1,
    )


def _timed(cards: Sequence[Scorecard]) -> Table:
    names = [card.counter for card in cards]
    lines = []
    for dataset, subject in dict.fromkeys((row.dataset, row.subject) for card in cards for row in card.timed):
        found = [_first(card.timed, dataset=dataset, subject=subject) for card in cards]
        f1 = ["" if row is None else f"{row.f1:.3f}" for row in found]
        metronome = ["" if row is None else f"{row.metronome:.3f}" for row in found]
        recordings = max(row.recordings for row in found if row is not None)
        lines.append([dataset, subject or "all", *f1, *metronome, str(recordings)])
    return Table(
        title="Step times",
        note=f"F1 at ±0.15 s (must be {F1_MUST:.2f} on oxford_opt), all steps together; the metronome ticks as often, "
        "evenly spread.",
        columns=("data set", "subject", *names, *(f"{name}, metronome" for name in names), "rec."),
        lines=lines,
    )


def _changes(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for name in ASKED_DISTURBANCES:
        found = [_first(card.changes, disturbance=name) for card in cards]
        if any(found):
            values = ["" if row is None else f"{row.mean:.2f} ({row.largest:.1f})" for row in found]
            marked = [_marked(value, met=row is None or row.met) for value, row in zip(values, found, strict=True)]
            where = [row.where if row is not None and row.largest else "" for row in found]
            recordings = max(row.recordings for row in found if row is not None)
            lines.append([name, *marked, str(recordings), *where])
    return Table(
        title="Disturbed walks",
        note="Absolute change of the count in %, the mean and in brackets the largest: they must not exceed "
        f"{MUST_PERCENT:g} and {NONE_ABOVE_PERCENT:g}, and packets re-sent must change nothing. 8 bits are over ±8 g; "
        "rates are lowered without a filter.",
        columns=("disturbance", *(card.counter for card in cards), "rec.", *(f"{card.counter} at" for card in cards)),
        lines=lines,
        left=1,
    )


def _disturbed(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for family in Family:
        for card in cards:
            if (found := card.disturbed.get(family)) is not None:
                values = (card.families[family].value, *(found[name] for name in ASKED_DISTURBANCES))
                must, _ = _limits(family)
                lines.append([family.value, card.counter, *(_over(value, family) for value in values), must])
    return Table(
        title="Disturbed, without steps",
        note="False steps an hour; a recording whose own rate is no higher is counted as it is. What goes through "
        "packets (re-sent, lost) is rounded as they are, so it may differ a little from the recording as it is; that "
        "packets re-sent change no count is measured against packets sent once.",
        columns=("family", "counter", NATIVE, *ASKED_DISTURBANCES, "must"),
        lines=lines,
    )


def _situations(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for label, source in dict.fromkeys((row.label, row.source) for card in cards for row in card.situations):
        found = [_first(card.situations, label=label, source=source) for card in cards]
        first = next(row for row in found if row is not None)
        values = ["" if row is None else f"{row.error:.1f} ({row.bias:+.1f})" for row in found]
        lines.append([label, source, *values, str(first.walks), str(first.true)])
    return Table(
        title="Situations",
        note="Mean absolute error and in brackets the bias, in % of the true steps; `walkers` are synthetic.",
        columns=("situation", "source", *(card.counter for card in cards), "walks", "true steps"),
        lines=lines,
    )


def _first(rows: Iterable[Row], **wanted: str) -> Row | None:
    """Return the row whose fields are as wanted."""
    return next((row for row in rows if all(getattr(row, name) == value for name, value in wanted.items())), None)


def errors(cards: Iterable[Scorecard]) -> list[str]:
    """Say what was not counted, by whom and why; what was lost is so for all of them."""
    made = [
        f"not counted by {card.counter}: {len(card.errors)} recordings ({_some(reasons)})"
        for card in cards
        if (reasons := [row.error or "" for row in card.errors])
    ]
    lost = dict.fromkeys(f"{each.what}: {each.why}" for card in cards for each in card.lost)
    return [*made, *([f"lost: {len(lost)} ({_some(list(lost))})"] if lost else [])]


def _some(reasons: Sequence[str]) -> str:
    once = list(dict.fromkeys(reasons))
    more = f"; and {len(once) - REASONS_SHOWN} more reasons" if len(once) > REASONS_SHOWN else ""
    return "; ".join(once[:REASONS_SHOWN]) + more


def _unit(family: Family) -> str:
    return "%" if family in WALKS else "steps/h"


def _figure(value: float, family: Family) -> str:
    if family in WALKS:
        return f"{value:.2f}"
    return f"{value:.0f}" if value >= WHOLE_FROM else f"{value:.1f}"


def _over(value: float, family: Family) -> str:
    """Tell a value, marked where it is over the family's limit."""
    return _marked(_figure(value, family), met=family not in LIMITS or value <= LIMITS[family].must)


def _marked(told: str, *, met: bool) -> str:
    return told if met else f"{told} {OVER}"


def _limits(family: Family) -> list[str]:
    limit = LIMITS.get(family)
    return ["", ""] if limit is None else [f"{limit.must:g}", f"{limit.aim:g}"]
