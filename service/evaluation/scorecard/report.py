"""The scorecard as tables, once for the terminal and the guide: the counters side by side, each figure by its limit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from service.evaluation.families import LIMITS, WALKS, Family, Limit
from service.evaluation.scorecard import budget
from service.evaluation.scorecard.card import ASKED_DISTURBANCES, Scorecard
from service.evaluation.scorecard.disturbances import MUST_PERCENT, NATIVE, NONE_ABOVE_PERCENT
from service.evaluation.tables import aligned

F1_MUST: Final = 0.9
REASONS_SHOWN: Final = 3
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
        """Return it for a terminal; what is repeated from the line above is left out."""
        lines = [list(line) for line in self.lines]
        for before, line in reversed(list(pairwise(lines))):
            if before[0] == line[0]:
                line[0] = ""
        parts = [self.title, *([self.note] if self.note else []), aligned([list(self.columns), *lines], left=self.left)]
        return "\n".join(parts)

    def markdown(self) -> str:
        """Return it for the guide."""
        rule = ["---"] * self.left + ["---:"] * (len(self.columns) - self.left)
        lines = [self.columns, rule, *self.lines]
        parts = [f"### {self.title}", *([self.note] if self.note else [])]
        return "\n\n".join([*parts, "\n".join(f"| {' | '.join(line)} |" for line in lines)])


def text(cards: Sequence[Scorecard]) -> str:
    """Return everything for a terminal."""
    asked = "; ".join(f"{card.counter} (preset {card.preset})" for card in cards)
    return "\n\n".join([f"scorecard of {asked}", *(table.text() for table in tables(cards)), *errors(cards)])


def tables(cards: Sequence[Scorecard]) -> list[Table]:
    """Return every table that has lines."""
    made = [
        families(cards), _sources(cards), _ranges(cards), _splices(cards), _timed(cards), _changes(cards),
        _disturbed(cards), _situations(cards), *budget_tables(cards),
    ]  # fmt: skip
    return [table for table in made if table.lines]


def budget_tables(cards: Sequence[Scorecard]) -> list[Table]:
    """Return which activities and recordings dominate the error."""
    note = "Share of the family's error, or of its false steps, in %: the largest of each family."
    columns = ("family", "counter", "what", "rec.", "share %")
    return [
        Table(title=title, columns=columns, lines=_shares(cards, parts), note=note, left=3)
        for title, parts in (
            ("Activities that dominate the error", budget.by_activity),
            ("Recordings that dominate the error", budget.by_recording),
        )
    ]


def families(cards: Sequence[Scorecard]) -> Table:
    """Return the families' values beside their limits."""
    lines = []
    for family in Family:
        for card in cards:
            if (score := card.families.get(family)) is not None:
                figures = [_figure(score.value, family), _figure(score.over_sources, family)]
                cells = [str(score.recordings), f"{score.hours:.2f}", *figures, *_limits(score.limit)]
                lines.append([family.value, _unit(family), card.counter, *cells, _met(met=score.met)])
    return Table(
        title="Families",
        note="Mean absolute error over the recordings in % of the true steps, or false steps an hour; beside it the "
        "mean over the sources.",
        columns=("family", "in", "counter", "rec.", "hours", "value", "over sources", "must", "aim", "met?"),
        lines=lines,
        left=3,
    )


def _sources(cards: Sequence[Scorecard]) -> Table:
    lines = [
        [family.value, _unit(family), source, card.counter, _figure(value, family)]
        for family in Family
        for source in sorted(
            {name for card in cards if family in card.families for name in card.families[family].by_source}
        )
        for card in cards
        if (value := _by_source(card, family).get(source)) is not None
    ]
    return Table(title="Sources", columns=("family", "in", "data set", "counter", "value"), lines=lines, left=4)


def _by_source(card: Scorecard, family: Family) -> Mapping[str, float]:
    return card.families[family].by_source if family in card.families else {}


def _ranges(cards: Sequence[Scorecard]) -> Table:
    lines = [
        [dataset, card.counter, str(share.recordings), str(share.within), f"{share.percent:.1f}"]
        for dataset in sorted({name for card in cards for name in card.shares})
        for card in cards
        if (share := card.shares.get(dataset)) is not None
    ]
    return Table(
        title="Counts within what the truth allows",
        columns=("data set", "counter", "rec.", "within", "%"),
        lines=lines,
    )


def _splices(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for family in Family:
        for card in cards:
            if (found := card.spliced.get(family)) is not None:
                alone = card.families[family].value if family in card.families else None
                figures = [_rate(found.false_per_hour), "" if alone is None else _rate(alone)]
                cells = [str(found.subjects), str(found.clips), f"{found.hours:.2f}", *figures]
                lines.append([family.value, card.counter, *cells, *_limits(LIMITS.get(family))])
    return Table(
        title="Step-free clips between two walks",
        note="All clips of a subject in a row, between two pieces of a walk; false steps an hour of the clips.",
        columns=("family", "counter", "subjects", "clips", "hours", "false/h", "alone", "must", "aim"),
        lines=lines,
    )


def _timed(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for dataset, subject in dict.fromkeys((row.dataset, row.subject) for card in cards for row in card.timed):
        for card in cards:
            for row in card.timed:
                if (row.dataset, row.subject) == (dataset, subject):
                    cells = [str(row.recordings), f"{row.f1:.3f}", f"{row.metronome:.3f}"]
                    lines.append([dataset, subject or "all", card.counter, *cells])
    return Table(
        title="Step times",
        note=f"F1 at ±0.15 s (must be {F1_MUST:.2f} on oxford_opt), all steps together; the metronome ticks as often, "
        "evenly spread.",
        columns=("data set", "subject", "counter", "rec.", "F1", "metronome"),
        lines=lines,
        left=3,
    )


def _changes(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for name in ASKED_DISTURBANCES:
        for card in cards:
            for row in card.changes:
                if row.disturbance == name:
                    figures = [str(row.changed), f"{row.mean:.2f}", f"{row.largest:.1f}", str(row.above)]
                    where = row.where if row.largest else ""
                    lines.append([name, card.counter, where, str(row.recordings), *figures, _met(met=row.met)])
    return Table(
        title="Disturbed walks",
        note=f"Absolute change of the count in %: the mean must not exceed {MUST_PERCENT:g}, none "
        f"{NONE_ABOVE_PERCENT:g}; packets re-sent must change nothing. 8 bits are over ±8 g; rates are lowered without "
        "a filter.",
        columns=("disturbance", "counter", "largest at", "rec.", "changed", "mean", "largest", "> 10 %", "met?"),
        lines=lines,
        left=3,
    )


def _disturbed(cards: Sequence[Scorecard]) -> Table:
    lines = []
    for family in Family:
        for card in cards:
            if (found := card.disturbed.get(family)) is not None:
                limit, plain = LIMITS.get(family), card.families[family].value
                met = None if limit is None else all(value <= limit.must for value in (plain, *found.values()))
                cells = [_rate(plain), *(_rate(found[name]) for name in ASKED_DISTURBANCES)]
                lines.append(
                    [family.value, card.counter, *cells, "" if limit is None else f"{limit.must:g}", _met(met=met)]
                )
    return Table(
        title="Disturbed, without steps",
        note="False steps an hour; a recording whose own rate is no higher is counted as it is.",
        columns=("family", "counter", NATIVE, *ASKED_DISTURBANCES, "must", "all met?"),
        lines=lines,
    )


def _situations(cards: Sequence[Scorecard]) -> Table:
    keys = dict.fromkeys((row.label, row.source) for card in cards for row in card.situations)
    lines = []
    for label, source in keys:
        for card in cards:
            for row in card.situations:
                if (row.label, row.source) == (label, source):
                    figures = [f"{row.error:.1f}", f"{row.bias:+.1f}", f"{row.worst:.1f}"]
                    cells = [str(row.walks), str(row.true), str(row.counted), *figures]
                    lines.append([label, source, card.counter, *cells])
    return Table(
        title="Situations",
        note="Mean absolute error, bias and largest error in % of the true steps; `walkers` are synthetic.",
        columns=("situation", "source", "counter", "walks", "true", "counted", "error %", "bias %", "largest %"),
        lines=lines,
        left=3,
    )


def _shares(cards: Sequence[Scorecard], parts: budget.Ranking) -> list[list[str]]:
    found = {card.counter: parts(card.rows) for card in cards}
    return [
        [family.value, counter, part.name, str(part.recordings), f"{part.share:.1f}"]
        for family in Family
        for counter, ranked in found.items()
        for part in ranked
        if part.family is family
    ]


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
    return _rate(value)


def _rate(per_hour: float) -> str:
    return f"{per_hour:.0f}" if per_hour >= WHOLE_FROM else f"{per_hour:.1f}"


def _limits(limit: Limit | None) -> list[str]:
    return ["", ""] if limit is None else [f"{limit.must:g}", f"{limit.aim:g}"]


def _met(*, met: bool | None) -> str:
    return "" if met is None else "yes" if met else "no"
