"""Trials as the table that Wang 2018 prints (Table 4): a line a device and trial, then the mean of each device."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Final

from service.pipeline.trial import Count, State, Trial, mean

COLUMNS: Final = (
    "device",
    "wrist",
    "counter",
    "test item",
    "true steps",
    "counted steps",
    "error (steps)",
    "accuracy (%)",
    "note",
)
"""The paper's, with where and how each device counted, and what makes a count doubtful."""

_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
"""A text that begins so would be computed by a spreadsheet."""


def table_csv(trials: Iterable[Trial]) -> str:
    """Return the done ones of `trials` as CSV; what is unknown is empty."""
    done = [trial for trial in trials if trial.state is State.DONE]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\r\n")
    table.writerow(COLUMNS)
    table.writerows(_line(trial, count) for trial in done for count in trial.counts.values())
    devices = dict.fromkeys(device for trial in done for device in trial.counts)
    table.writerows(_mean_line(device, [trial for trial in done if device in trial.counts]) for device in devices)
    return text.getvalue()


def _line(trial: Trial, count: Count) -> list[object]:
    entry = count.entry
    return [
        _text(entry.device),
        entry.wrist or "",
        entry.counter,
        _text(trial.name),
        _number(trial.true_steps),
        count.steps,
        _number(trial.error(count)),
        _number(trial.accuracy_percent(count), "{:.2f}"),
        _text(count.note(trial.ended_ns or 0) or ""),
    ]


def _mean_line(device: str, trials: Sequence[Trial]) -> list[object]:
    """Return a device's mean over its trials whose true number is known."""
    known = [(trial, trial.counts[device]) for trial in trials if trial.true_steps is not None]
    return [
        _text(device),
        "",
        "",
        "mean",
        _number(mean([trial.true_steps for trial, _ in known]), "{:.2f}"),
        _number(mean([count.steps for _, count in known]), "{:.2f}"),
        _number(mean([trial.error(count) for trial, count in known]), "{:.2f}"),
        _number(mean([trial.accuracy_percent(count) for trial, count in known if trial.true_steps]), "{:.2f}"),
        f"over {len(known)} of {len(trials)} trials" if len(known) < len(trials) else "",
    ]


def _number(value: float | None, form: str = "{}") -> str:
    return "" if value is None else form.format(value)


def _text(words: str) -> str:
    return f"'{words}" if words.startswith(_FORMULA) else words
