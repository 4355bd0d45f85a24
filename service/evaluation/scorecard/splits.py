"""Recordings that an `index.csv` sets apart: a scorecard of one split must not look at those of another.

A folder of data sets may hold an `index.csv` with the columns `split`, `dataset` and `recording`. What it lists with
another split than the one asked for is left out, before anything of it is read; what no index lists is taken.
"""

from __future__ import annotations

import csv
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from service.evaluation.choices import Found

INDEX: Final = "index.csv"
DEFAULT: Final = "dev"
_COLUMNS: Final = {"split", "dataset", "recording"}


def of_split(found: Sequence[Found], split: str) -> tuple[list[Found], list[Found]]:
    """Return the files to take, and those that are left out."""
    taken: list[Found] = []
    apart: list[Found] = []
    for file in found:
        listed = _splits(file.path.absolute().parent.parent).get((file.dataset, file.path.stem), split)
        (taken if listed == split else apart).append(file)
    return taken, apart


@functools.cache
def _splits(folder: Path) -> Mapping[tuple[str, str], str]:
    try:
        with (folder / INDEX).open(encoding="utf-8", newline="") as file:
            lines = csv.DictReader(file)
            if not _COLUMNS.issubset(lines.fieldnames or ()):
                return {}
            return {(line["dataset"], line["recording"]): line["split"] for line in lines}
    except (OSError, UnicodeDecodeError, csv.Error):
        return {}
