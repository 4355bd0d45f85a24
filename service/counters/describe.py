"""The counters and their parameters as tables for people: for the command line and for the guide.

Everything is read from the registry, so that a table cannot say anything else than what is checked and run.
"""

from __future__ import annotations

import dataclasses
import re
import sys
import textwrap
from collections.abc import Sequence
from typing import Any, Final

from service.counters import registry
from service.counters.registry import CounterKind

OVERVIEW: Final = ("counter", "needs", "confirms within, paper and tuned", "source")
PARAMETERS: Final = ("parameter", "paper", "tuned", "range", "unit", "meaning")

SOURCE_COLUMNS: Final = 30
"""Of a source in a terminal; the guide has it whole."""

Line = tuple[str, ...]


def overview(*, whole: bool = False) -> list[Line]:
    """Return a line for each counter: name, sensors, longest time from a step to its confirmation, where it is from.

    Its source is shortened to the authors, or `whole`.
    """
    return [
        (
            kind.name,
            ", ".join(sorted(kind.sensors)),
            f"{latency_s(kind, 'paper'):.1f}, {latency_s(kind, 'tuned'):.1f} s",
            source(kind) if whole else _authors(kind),
        )
        for kind in registry.COUNTERS.values()
    ]


def parameters(name: str) -> list[Line]:
    """Return a line for each parameter of a counter; CounterError where there is no such counter."""
    kind = registry.kind(name)
    return [_parameter(field, kind) for field in dataclasses.fields(kind.params)]


def markdown() -> str:
    """Return the tables of all counters as a part of the guide."""
    parts = [_table(OVERVIEW, [(f"`{name}`", *rest) for name, *rest in overview(whole=True)])]
    for name in registry.COUNTERS:
        lines = [(f"`{key}`", *rest) for key, *rest in parameters(name)]
        parts.append(f"## {name}\n\n{_table(PARAMETERS, lines)}")
    return "\n\n".join(parts) + "\n"


def latency_s(kind: CounterKind, preset: str) -> float:
    """Return the longest time from a step to its confirmation with the parameters of a preset."""
    return round(kind.build(kind.presets[preset]).latency_s, 3)


def source(kind: CounterKind) -> str:
    """Return the first sentence of the counter's module, which names its paper."""
    text = sys.modules[kind.build.__module__].__doc__ or ""
    return text.split("\n\n", maxsplit=1)[0].split("\n", maxsplit=1)[0].strip()


def _authors(kind: CounterKind) -> str:
    """Return what stands before the paper's DOI, without what the counter is called."""
    before = source(kind).partition(", doi ")[0]
    return textwrap.shorten(re.split(": | of ", before)[-1], SOURCE_COLUMNS, placeholder=" …")


def _parameter(field: dataclasses.Field[Any], kind: CounterKind) -> Line:
    meta = field.metadata
    values = [_value(getattr(kind.presets[preset], field.name)) for preset in ("paper", "tuned")]
    options = meta.get("options")
    span = " or ".join(options) if options else f"{meta['low']:g} to {meta['high']:g}"
    return (field.name, *values, span, meta.get("unit", ""), meta["text"])


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows)
