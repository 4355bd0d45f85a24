"""A counter's scorecard: what was measured of it, put together, each part in the unit in which it is asked for."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from service.evaluation.families import WALKS, Family, FamilyScore, Share, scores, within_range
from service.evaluation.metrics import Matches, error_percent
from service.evaluation.scorecard import splices, wire
from service.evaluation.scorecard.disturbances import DISTURBANCES, MUST_PERCENT, NONE_ABOVE_PERCENT
from service.evaluation.scorecard.measured import Measured
from service.evaluation.scorecard.situations import SituationRow, Walked, real, table
from service.evaluation.scorecard.splices import FamilySpliced, Spliced

ASKED_DISTURBANCES = (
    *(each.name for each in DISTURBANCES if each.asked),
    wire.TWICE,
    wire.loss_name(wire.ASKED_PERCENT),
)
"""What the limits hold for, in the order they are told."""
_SENT = {wire.TWICE, *map(wire.loss_name, wire.LOSSES_PERCENT)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What a disturbance does to the counts of walks: mean absolute and largest change, in % of the undisturbed."""

    disturbance: str
    recordings: int
    changed: int
    mean: float
    largest: float
    where: str
    above: int
    """How many changed by more than NONE_ABOVE_PERCENT."""

    @property
    def met(self) -> bool:
        """Whether the limits are kept; packets re-sent must not change any count."""
        if self.disturbance == wire.TWICE:
            return not self.changed
        return self.mean <= MUST_PERCENT and self.largest <= NONE_ABOVE_PERCENT


@dataclass(frozen=True, slots=True, kw_only=True)
class Timed:
    """How well the steps' times fit, of one data set or of one subject of it: F1 at ±0.15 s, and a metronome's."""

    dataset: str
    subject: str
    recordings: int
    f1: float
    metronome: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """A splice, or the walkers of a situation, that could not be counted."""

    what: str
    why: str


class Scorecard:
    """All that was measured of one counter; each part is put together when it is asked for."""

    def __init__(
        self,
        counter: str,
        preset: str,
        rows: Sequence[Measured],
        spliced: Sequence[Spliced],
        walked: Sequence[Walked],
        lost: Sequence[Lost] = (),
    ) -> None:
        self.counter = counter
        self.preset = preset
        self.rows = [row for row in rows if row.steps is not None]
        self.errors = [row for row in rows if row.error is not None]
        self.lost = lost
        self._spliced = spliced
        self._walked = walked

    @cached_property
    def families(self) -> dict[Family, FamilyScore]:
        """The score of each family."""
        return scores(row.outcome() for row in self.rows)

    @cached_property
    def shares(self) -> dict[str, Share]:
        """How many counts lie within what the truth allows, by data set."""
        return within_range(row.outcome() for row in self.rows)

    @cached_property
    def spliced(self) -> dict[Family, FamilySpliced]:
        """False steps an hour of clips between two walks, by family."""
        return splices.by_family(self._spliced)

    @cached_property
    def timed(self) -> list[Timed]:
        """How well the steps' times fit: each data set that knows them, then its subjects."""
        groups: dict[tuple[str, str], list[Measured]] = defaultdict(list)
        for row in self.rows:
            if row.matches is not None:
                groups[row.file.dataset, ""].append(row)
                groups[row.file.dataset, row.subject or "?"].append(row)
        return [_timed(*key, rows) for key, rows in sorted(groups.items())]

    @cached_property
    def changes(self) -> list[Change]:
        """What each disturbance that limits hold for does to walks."""
        return [found for name in ASKED_DISTURBANCES if (found := _change(name, self.rows)) is not None]

    @cached_property
    def disturbed(self) -> dict[Family, dict[str, float]]:
        """False steps an hour of each step-free family under each of those disturbances that applies to all of it."""
        quiet = [row for row in self.rows if row.true_steps == 0]
        found: dict[Family, dict[str, float]] = defaultdict(dict)
        for name in ASKED_DISTURBANCES:
            # Where a rate is none below a recording's own, it is counted as it is.
            counted = [row.outcome(row.disturbed.get(name, row.steps)) for row in quiet]
            for family, score in scores(counted).items():
                found[family][name] = score.value
        return {family: found[family] for family in Family if family in found and family not in WALKS}

    @cached_property
    def situations(self) -> list[SituationRow]:
        """A row for each situation."""
        return table([*self._walked, *real(self.rows)])

    def as_json(self) -> Iterable[dict[str, Any]]:
        """Yield every figure as a row of plain data: `part` and `counter` say what it is."""
        parts = {
            **self._parts(),
            "recording": [_recording(row) for row in self.rows],
            "not counted": [{"what": row.name, "why": row.error} for row in self.errors]
            + [asdict(of) for of in self.lost],
        }
        for part, found in parts.items():
            for row in found:
                yield {"part": part, "counter": self.counter, "preset": self.preset, **row}

    def _parts(self) -> Mapping[str, list[dict[str, Any]]]:
        families = [
            {
                "family": score.family.value,
                "unit": "percent" if score.is_error else "false steps/h",
                "recordings": score.recordings,
                "hours": score.hours,
                "value": score.value,
                "over_sources": score.over_sources,
                "by_source": dict(score.by_source),
                "must": score.limit and score.limit.must,
                "aim": score.limit and score.limit.aim,
            }
            for score in self.families.values()
        ]
        return {
            "family": families,
            "within range": [{"dataset": name, **asdict(share)} for name, share in self.shares.items()],
            "splice": [asdict(found) for found in self.spliced.values()],
            "step times": [asdict(found) for found in self.timed],
            "disturbance": [asdict(found) for found in self.changes],
            "disturbed family": [
                {"family": family.value, "disturbance": name, "value": value}
                for family, values in self.disturbed.items()
                for name, value in values.items()
            ],
            "situation": [asdict(found) for found in self.situations],
        }


def _recording(row: Measured) -> dict[str, Any]:
    return {
        "recording": row.name,
        "path": row.file.shown,
        "placement": row.placement,
        "activity": row.activity,
        "true_steps": row.true_steps,
        "steps": row.steps,
        "duration_s": row.duration_s,
        "disturbed": dict(row.disturbed),
    }


def _timed(dataset: str, subject: str, rows: Sequence[Measured]) -> Timed:
    f1, metronome = (
        _f1([found for row in rows if (found := getattr(row, which)) is not None]) for which in ("matches", "blind")
    )
    return Timed(dataset=dataset, subject=subject, recordings=len(rows), f1=f1, metronome=metronome)


def _f1(found: Sequence[Matches]) -> float:
    whole = Matches(tp=sum(m.tp for m in found), fp=sum(m.fp for m in found), fn=sum(m.fn for m in found))
    return whole.f1 or 0.0


def _change(name: str, rows: Sequence[Measured]) -> Change | None:
    """Compare walks with their undisturbed count; of packets re-sent all recordings, as no count may change."""
    found = [
        (_changed_percent(row, name), row.name)
        for row in rows
        if name in row.disturbed and (row.true_steps or name == wire.TWICE)
    ]
    if not found:
        return None
    largest, where = max(found)
    return Change(
        disturbance=name,
        recordings=len(found),
        changed=sum(percent > 0 for percent, _ in found),
        mean=sum(percent for percent, _ in found) / len(found),
        largest=largest,
        where=where,
        above=sum(percent > NONE_ABOVE_PERCENT for percent, _ in found),
    )


def _changed_percent(row: Measured, name: str) -> float:
    """Return the change in % of the count of the same way of sending; 100 where that was none and now is some."""
    plain = row.disturbed[wire.ONCE] if name in _SENT else row.steps or 0
    return error_percent(row.disturbed[name], plain) if plain else 100.0 * bool(row.disturbed[name])
