"""Rows as text tables: by dataset, placement and activity, the counters side by side, and what was not counted."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final

from service.evaluation.metrics import Summary, summarise
from service.evaluation.rows import Row

EACH_RECORDING_UP_TO: Final = 20
"""So many recordings are listed one by one too."""

ERRORS_SHOWN: Final = 10

UNKNOWN: Final = "–"

LEGEND: Final = """\
rec. recordings; true, steps, error = steps − true: of those that hold steps; false: steps counted where there are none,
false/h: an hour; untold: steps counted where the true number is unknown (beside others whose is known). accuracy =
1 − |error|/true, the mean over recordings, and pooled (all their steps together); MAPE = 100 − accuracy; bias =
Σerror/Σtrue; precision, recall, F1 at ±0.15 s where step times are known; blind: F1 of as many evenly spread steps."""

COLUMNS: Final = (
    "counter", "rec.", "hours", "true", "steps", "error", "accuracy %", "pooled %", "MAPE %", "bias %", "false",
    "false/h", "untold", "precision", "recall", "F1", "blind",
)  # fmt: skip


def report(rows: Sequence[Row]) -> str:
    """Return everything there is to say about `rows`, for a terminal."""
    counted = [row for row in rows if row.error is None]
    parts = []
    if counted:
        parts = [_asked(rows), *(table(counted, name, key) for name, key in _groupings(counted)), LEGEND]
    parts += _notes(counted)
    parts += _errors(rows)
    return "\n\n".join(parts)


def table(rows: Iterable[Row], name: str, key: Callable[[Row], str]) -> str:
    """Return a table of `rows` grouped by `key`, a line for each group and counter.

    Figures that no line has are left out.
    """
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[key(row), row.counter].append(row)
    lines = [
        [group, counter, *_cells(summarise(score for row in found if (score := row.score())))]
        for (group, counter), found in sorted(groups.items(), key=lambda item: item[0][0])
    ]
    for before, line in reversed(list(pairwise(lines))):
        if before[0] == line[0]:
            line[0] = ""
    cells = [[name, *COLUMNS], *lines]
    used = [column for column in zip(*cells, strict=True) if any(column[1:])]
    return aligned(list(zip(*used, strict=True)), left=2)


def aligned(lines: Sequence[Sequence[str]], *, left: int) -> str:
    """Return `lines` with their cells in columns, the first `left` of them to the left, a rule under the first line."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    texts = [
        "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    return "\n".join([texts[0], "─" * max(map(len, texts)), *texts[1:]])


def _asked(rows: Sequence[Row]) -> str:
    """Say with which parameters: the preset, and what was changed of it."""
    changed = {f"{row.counter}.{key}={row.params[key]}" for row in rows for key in row.changed}
    taught = ["calibrated"] if any(row.calibration for row in rows) else []
    return " ".join([f"preset {' '.join(sorted({row.preset for row in rows}))}", *taught, *sorted(changed)])


def _groupings(rows: Sequence[Row]) -> Iterator[tuple[str, Callable[[Row], str]]]:
    if len({row.path for row in rows}) <= EACH_RECORDING_UP_TO:
        yield "recording", lambda row: row.path
    yield "dataset", lambda row: row.dataset
    if any(row.placement for row in rows):
        yield "placement", lambda row: row.placement or UNKNOWN
    if any(row.activity for row in rows):
        yield "activity", lambda row: row.activity or UNKNOWN
    if len({row.dataset for row in rows}) > 1:
        yield "all", lambda _: "all"


def _cells(of: Summary) -> list[str]:
    # Where no true number is known, the count is what was asked for.
    nothing_known = of.counted is None and of.false is None
    return [
        str(of.recordings),
        f"{of.hours:.2f}",
        UNKNOWN if nothing_known else _figure(of.true, "d"),
        _figure(of.untold if nothing_known else of.counted, "d"),
        UNKNOWN if nothing_known else _figure(of.error, "+d"),
        _figure(of.accuracy, ".2f"),
        _figure(of.pooled_accuracy, ".2f"),
        _figure(of.mape, ".1f"),
        _figure(of.bias, "+.1f"),
        _figure(of.false, "d"),
        _figure(of.false_per_hour, ".0f"),
        "" if nothing_known else _figure(of.untold, "d"),
        *(_figure(value, ".3f") for value in (of.precision, of.recall, of.f1, of.blind_f1)),
    ]


def _figure(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _notes(rows: Iterable[Row]) -> list[str]:
    """Say what the tables cannot: whose sensor was at its end, and where the counts of unknown truth are."""
    rows = list(rows)
    at_end = sorted({row.path for row in rows if row.saturated})
    unknown, listed = {row.path for row in rows if row.true_steps is None}, {row.path for row in rows}
    notes = []
    if at_end:
        notes.append(f"saturated (samples pile up at the largest value, steps may be missing): {_some(at_end)}")
    untaught = sorted({row.path for row in rows if row.uncalibrated})
    if untaught:
        notes.append(f"not calibrated (no walk in the middle of it): {_some(untaught)}")
    learners = {row.counter for row in rows if row.calibration or row.uncalibrated}
    others = dict.fromkeys(row.counter for row in rows if row.counter not in learners)
    if learners and others:
        notes.append(f"learnt nothing (no method to learn so, counted as they are): {', '.join(others)}")
    if unknown and len(listed) > EACH_RECORDING_UP_TO:
        notes.append(f"the true number is unknown for {_recordings(len(unknown))}; --json FILE has the count of each")
    return notes


def _errors(rows: Sequence[Row]) -> list[str]:
    """Say what was not counted, equal reasons together."""
    failed = [row for row in rows if row.error is not None]
    if not failed:
        return []
    reasons = Counter(row.error or "" for row in failed)
    shown = [f"  {times} × {why}" if times > 1 else f"  {why}" for why, times in reasons.most_common(ERRORS_SHOWN)]
    if len(reasons) > ERRORS_SHOWN:
        shown.append(f"  … {len(reasons) - ERRORS_SHOWN} more reasons")
    return ["\n".join([f"not counted: {_how_many(rows, failed)}", *shown])]


def _how_many(rows: Sequence[Row], failed: Sequence[Row]) -> str:
    """Say how much failed: of one counter recordings, of several rows too, as most recordings fail for some only."""
    if len({row.counter for row in rows}) == 1:
        return f"{len(failed)} of {_recordings(len(rows))}"
    paths, counted = {row.path for row in failed}, {row.path for row in rows if row.error is None}
    of = f"{len(failed)} of {len(rows)} rows (recording × counter)"
    return f"{of}: {_recordings(len(paths - counted))} by no counter, {len(paths & counted)} by some only"


def _recordings(number: int) -> str:
    return f"{number} recording{'' if number == 1 else 's'}"


def _some(paths: Sequence[str]) -> str:
    more = f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    return ", ".join(paths[:3]) + more
