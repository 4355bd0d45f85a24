"""What of a scorecard is drawn: the families by their limits, what dominates the error, how it goes with what."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

from service.evaluation.families import LIMITS, WALKS, Family
from service.evaluation.scorecard import budget, wire
from service.evaluation.scorecard.card import Scorecard
from service.evaluation.scorecard.chart import Bars, Chart
from service.evaluation.scorecard.measured import Measured

SHARES: Final = ("activities", "recordings")
"""What dominates the error, by the figure's name; each counter has its own."""
PERCENT: Final = "% of the true steps"
PER_HOUR: Final = "false steps/h"

Levels = Callable[[Iterable[Measured]], list[budget.Level]]

LEVELS: Final[dict[str, tuple[str, Levels]]] = {
    "cadence": ("Error by cadence", budget.by_cadence),
    "placement": ("Error by placement", budget.by_placement),
    "native_rate": ("Error by rate of the device", budget.by_native_rate),
    "rate": ("Error at a lowered rate", lambda rows: budget.sweep(rows, "rate")),
    "saturated": ("Error where the range ended", budget.by_saturation),
    "range": ("Error in a narrower range", lambda rows: budget.sweep(rows, "range")),
    "bits": ("Error with fewer bits over ±8 g", lambda rows: budget.sweep(rows, "bits")),
    "loss": ("Error with packets lost", lambda rows: budget.sweep(rows, wire.AXIS)),
}
"""Error by level, by the figure's name."""


def charts(cards: Sequence[Scorecard]) -> dict[str, Chart]:
    """Return the charts that have bars, by name."""
    made = {
        "walks": _families(cards, [family for family in Family if family in WALKS], "Walks", PERCENT),
        "quiet": _families(cards, [family for family in Family if family not in WALKS], "Without steps", PER_HOUR),
        **{
            f"{name}_{card.counter}": _shares(card, title)
            for name, title in zip(SHARES, budget.RANKINGS, strict=True)
            for card in cards
        },
    }
    made |= {name: _levels(cards, title, levels) for name, (title, levels) in LEVELS.items()}
    return {name: chart for name, chart in made.items() if chart.groups}


def _series(cards: Sequence[Scorecard]) -> list[str]:
    return [card.counter for card in cards]


def _families(cards: Sequence[Scorecard], families: Sequence[Family], title: str, unit: str) -> Chart:
    def bars() -> Iterator[Bars]:
        for family in families:
            found = [card.families.get(family) for card in cards]
            if any(found):
                limit = LIMITS[family].must if family in LIMITS else None
                values = [None if score is None else score.value for score in found]
                yield Bars(name=family.value, values=values, limit=limit)

    return Chart(title=title, unit=f"{unit}; line: limit", series=_series(cards), groups=list(bars()))


def _shares(card: Scorecard, title: str) -> Chart:
    parts = budget.RANKINGS[title](card.rows)
    groups = [Bars(name=f"{part.family.value}: {_short(part.name)}", values=[part.share]) for part in parts]
    short, unit = f"{title.partition(' ')[0]}: {card.counter}", "% of the family's error or false steps"
    return Chart(title=short, unit=unit, series=[card.counter], groups=groups)


def _short(name: str) -> str:
    """Leave the data set out: the family says enough."""
    return re.split(r": |/", name, maxsplit=1)[-1]


def _levels(cards: Sequence[Scorecard], title: str, levels: Levels) -> Chart:
    found = [{level.name: level for level in levels(card.rows)} for card in cards]
    groups = []
    for name in dict.fromkeys(name for each in found for name in each):
        here = [each.get(name) for each in found]
        recordings = max(level.recordings for level in here if level is not None)
        values = [None if level is None else level.error for level in here]
        groups.append(Bars(name=f"{name} ({recordings} rec.)", values=values))
    return Chart(title=title, unit=PERCENT, series=_series(cards), groups=groups)
