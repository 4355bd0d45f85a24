"""The papers' own tables, counted again: their figures beside ours, on synthetic walkers and on real recordings."""

from service.evaluation.papers import chen2015, jayalath2013, khedr2017, wang2018

PAPERS = {module.PAPER.name: module.PAPER for module in (wang2018, chen2015, jayalath2013, khedr2017)}

__all__ = ["PAPERS"]
