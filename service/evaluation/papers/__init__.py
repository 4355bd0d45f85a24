"""The papers' own tables, counted again: their figures beside ours, on synthetic walkers and on real recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from service.evaluation.papers import chen2015, jayalath2013, khedr2017, wang2018
from service.evaluation.papers.conditions import Paper

__all__ = ["PAPERS", "Paper"]

PAPERS: Final[Mapping[str, Paper]] = {
    paper.name: paper for paper in (wang2018.PAPER, chen2015.PAPER, jayalath2013.PAPER, khedr2017.PAPER)
}
