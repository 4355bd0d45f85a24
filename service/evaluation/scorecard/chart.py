"""Bars as a small SVG that is readable at a phone's width: 360 units wide, text of 12.

Plain shapes with attributes, neither styles nor scripts, so that the guide's policy has nothing to refuse; the same
bytes for the same numbers. Bars lie, so that names may be long and as many as there are; each bears its value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from service.evaluation.figures.canvas import COLOURS

WIDTH: Final = 360
MARGIN: Final = 12
TEXT: Final = 12
LINE: Final = 16
BAR: Final = 12
ROW: Final = 13
"""A bar with the room below it."""
VALUE: Final = 76
"""Room for a value to the right of the longest bar."""
WHOLE_FROM: Final = 100.0
"""A value from which on a tenth is not told."""
INK: Final = "#14212d"
SOFT: Final = "#566573"
LIMIT: Final = "#14212d"
GROUND: Final = "#ffffff"
FONT: Final = "system-ui, sans-serif"
HALO: Final = f' stroke="{GROUND}" stroke-width="3" stroke-linejoin="round" paint-order="stroke"'
"""Around letters, where a line crosses them."""
LETTER: Final = 7.0
"""A letter's width, about."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bars:
    """A group of bars, one a series, None where it has no value; `limit` is marked where there is one."""

    name: str
    values: Sequence[float | None]
    limit: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Groups of bars; `unit` is said below the title, `series` in the legend, each value is told."""

    title: str
    unit: str
    series: Sequence[str]
    groups: Sequence[Bars]

    def svg(self) -> str:
        """Return the drawing."""
        shapes = _Shapes()
        shapes.text(MARGIN, self.title, bold=True)
        shapes.text(MARGIN, self.unit, soft=True)
        if len(self.series) > 1:
            self._legend(shapes)
        shapes.y += 4
        values = [value for group in self.groups for value in (*group.values, group.limit) if value is not None]
        scale = (WIDTH - 2 * MARGIN - VALUE) / (max(values, default=0.0) or 1.0)
        for group in self.groups:
            self._group(shapes, group, scale)
        return shapes.drawing(self.title)

    def _legend(self, shapes: _Shapes) -> None:
        x = float(MARGIN)
        for number, name in enumerate(self.series):
            shapes.box(x, shapes.y + 3, 10, 10, _colour(number))
            shapes.text(x + 14, name, soft=True, ends_line=False)
            x += 26 + LETTER * len(name)
        shapes.y += LINE

    def _group(self, shapes: _Shapes, group: Bars, scale: float) -> None:
        shapes.text(MARGIN, _cut(group.name))
        lengths = [None if value is None else max(value * scale, 1.0) for value in group.values]
        for number, length in enumerate(lengths):
            if length is not None:
                shapes.box(MARGIN, shapes.y + number * ROW, length, BAR, _colour(number))
        bottom = shapes.y + len(lengths) * ROW
        if group.limit is not None:
            shapes.line(MARGIN + group.limit * scale, shapes.y - 2, bottom + 1)
        for value, length in zip(group.values, lengths, strict=True):
            if value is not None and length is not None:
                shapes.text(MARGIN + length + 5, _told(value), soft=True, at=shapes.y - 3, ends_line=False)
            shapes.y += ROW
        shapes.y = bottom + 5


def _told(value: float) -> str:
    return f"{value:.0f}" if value >= WHOLE_FROM else f"{value:.1f}"


def _cut(name: str) -> str:
    fits = int((WIDTH - 2 * MARGIN) / LETTER)
    return name if len(name) <= fits else f"{name[: fits - 1]}…"


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


class _Shapes:
    """Shapes one below the other; `y` is where the next line begins."""

    def __init__(self) -> None:
        self.y = float(MARGIN)
        self._shapes: list[str] = []

    def text(
        self,
        x: float,
        words: str,
        *,
        bold: bool = False,
        soft: bool = False,
        at: float | None = None,
        ends_line: bool = True,
    ) -> None:
        weight = ' font-weight="600"' if bold else ""
        y = (self.y if at is None else at) + TEXT
        self._shapes.append(
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{SOFT if soft else INK}"{weight}{HALO}>{escape(words)}</text>'
        )
        if ends_line:
            self.y += LINE

    def box(self, x: float, y: float, width: float, height: float, colour: str) -> None:
        self._shapes.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" fill="{colour}"/>'
        )

    def line(self, x: float, top: float, bottom: float) -> None:
        self._shapes.append(
            f'<line x1="{x:.1f}" y1="{top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}" stroke="{LIMIT}" stroke-width="2"/>'
        )

    def drawing(self, title: str) -> str:
        height = self.y + MARGIN - 5
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" width="{WIDTH}" '
            f'height="{height:.0f}" font-family="{FONT}" font-size="{TEXT}" role="img">'
        )
        ground = f'<rect width="{WIDTH}" height="{height:.0f}" rx="6" fill="{GROUND}"/>'
        return "\n".join([head, f"<title>{escape(title)}</title>", ground, *self._shapes, "</svg>", ""])
