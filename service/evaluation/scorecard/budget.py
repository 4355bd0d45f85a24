"""Where the error comes from: which recordings and activities dominate it, and how it goes with what was measured how.

A family's error is a mean over its recordings, so a recording's share of it is its own percentage over the sum of all;
of a step-free family it is its false steps over all of them. The error by rate, range, resolution and loss is that of
the same walks, disturbed: only those to which every level of the axis applies, so that the levels can be compared.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from service.evaluation.families import WALKS, Family
from service.evaluation.metrics import error_percent
from service.evaluation.scorecard import wire
from service.evaluation.scorecard.disturbances import DISTURBANCES, NATIVE
from service.evaluation.scorecard.measured import Measured

SHOWN: Final = 3
"""Recordings, and activities, of each family that are named."""
CADENCES_HZ: Final = (1.4, 1.6, 1.8, 2.0, 2.2)
"""Between two of these lies a band of cadence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A recording's or an activity's part of a family's error; `share` in %, `recordings` it is of."""

    family: Family
    name: str
    recordings: int
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """The mean absolute percentage error of the walks of one level."""

    name: str
    recordings: int
    error: float


Ranking = Callable[[Iterable[Measured]], list[Part]]


def by_recording(rows: Iterable[Measured]) -> list[Part]:
    """Return, by family, the recordings with the largest shares of its error."""
    return _parts(rows, lambda row: row.name)


def by_activity(rows: Iterable[Measured]) -> list[Part]:
    """Return, by family, the activities with the largest shares of its error; of walks, with where it was worn."""

    def name(row: Measured) -> str:
        what = (row.activity or "?").replace("_", " ")
        return f"{row.file.dataset}: {what}" + (
            f", {(row.placement or '?').replace('_', ' ')}" if _is_phone(row) else ""
        )

    return _parts(rows, name)


def _is_phone(row: Measured) -> bool:
    return row.outcome().family in {Family.PHONE, Family.HANDLING}


def _parts(rows: Iterable[Measured], key: Callable[[Measured], str]) -> list[Part]:
    families: dict[Family, list[Measured]] = defaultdict(list)
    for row in rows:
        if (family := row.outcome().family) is not None:
            families[family].append(row)
    return [part for family in Family for part in _largest(family, families[family], key)]


def _largest(family: Family, rows: Sequence[Measured], key: Callable[[Measured], str]) -> list[Part]:
    held: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        held[key(row)].append(_error(row) if family in WALKS else float(row.steps or 0))
    total = sum(map(sum, held.values()))
    if not total:
        return []
    parts = [
        Part(family=family, name=name, recordings=len(values), share=100.0 * sum(values) / total)
        for name, values in held.items()
        if any(values)
    ]
    return sorted(parts, key=lambda part: (-part.share, part.name))[:SHOWN]


RANKINGS: Final[dict[str, Ranking]] = {
    "Activities that dominate the error": by_activity,
    "Recordings that dominate the error": by_recording,
}


def by_cadence(rows: Iterable[Measured]) -> list[Level]:
    """Return the error by cadence, true steps over the whole time: pauses make it less than the walker's own."""

    def band(row: Measured) -> str:
        hz = (row.true_steps or 0) / row.duration_s
        place = sum(hz >= edge for edge in CADENCES_HZ)
        if place == 0:
            return f"under {CADENCES_HZ[0]:g} steps/s"
        if place == len(CADENCES_HZ):
            return f"{CADENCES_HZ[-1]:g} steps/s and more"
        return f"{CADENCES_HZ[place - 1]:g} to {CADENCES_HZ[place]:g} steps/s"

    return _levels(rows, band, order=lambda row: (row.true_steps or 0) / row.duration_s)


def by_placement(rows: Iterable[Measured]) -> list[Level]:
    """Return the error by where the sensor was worn."""
    return _levels(rows, lambda row: (row.placement or "unknown").replace("_", " "))


def by_native_rate(rows: Iterable[Measured]) -> list[Level]:
    """Return the error by the rate that was recorded: other people and sensors at each, so not the rate's doing."""
    return _levels(rows, lambda row: f"{row.rate_hz:g} Hz", order=lambda row: row.rate_hz)


def by_saturation(rows: Iterable[Measured]) -> list[Level]:
    """Return the error of recordings whose sensor was at the end of its range, and of the others."""
    return _levels(rows, lambda row: "at its end" if row.saturated else "within it", order=lambda row: row.saturated)


def _levels(
    rows: Iterable[Measured], key: Callable[[Measured], str], order: Callable[[Measured], float] | None = None
) -> list[Level]:
    groups: dict[str, list[Measured]] = defaultdict(list)
    for row in sorted(rows, key=order or key):
        if row.true_steps and row.steps is not None and row.duration_s:
            groups[key(row)].append(row)
    return [
        Level(name=name, recordings=len(found), error=sum(map(_error, found)) / len(found))
        for name, found in groups.items()
    ]


def sweep(rows: Iterable[Measured], axis: str) -> list[Level]:
    """Return the error of the same walks at each level of a disturbance, the undisturbed first."""
    if axis == wire.AXIS:
        names = [wire.ONCE, *map(wire.loss_name, wire.LOSSES_PERCENT)]
    else:
        names = [each.name for each in DISTURBANCES if each.axis == axis]
    able = [row for row in rows if row.true_steps and all(name in row.disturbed for name in names)]
    if not able:
        return []
    made = [] if axis == wire.AXIS else [_level(NATIVE, able, [row.steps or 0 for row in able])]
    return made + [_level(name, able, [row.disturbed[name] for row in able]) for name in names]


def _level(name: str, rows: Sequence[Measured], counted: Sequence[int]) -> Level:
    errors = [error_percent(steps, row.true_steps or 1) for row, steps in zip(rows, counted, strict=True)]
    return Level(name=name, recordings=len(rows), error=sum(errors) / len(errors))


def _error(row: Measured) -> float:
    return error_percent(row.steps or 0, row.true_steps or 1)
