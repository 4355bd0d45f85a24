"""A whole paper: its synthetic walkers here, the real recordings over all cores, then its report."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Final

from service.counters import registry
from service.errors import ParameterError
from service.evaluation.choices import Found
from service.evaluation.papers import PAPERS
from service.evaluation.papers.conditions import Paper
from service.evaluation.papers.real import Measured, choice, measured, methods, wanted
from service.evaluation.papers.report import Report
from service.evaluation.papers.results import Result, results, timings, walkers
from service.evaluation.run import Progress, evaluate

PRESET: Final = "paper"
"""The published parameters, where none are asked for."""


def paper(name: str) -> Paper:
    """Return the paper of that name; ParameterError lists the known ones."""
    if name not in PAPERS:
        raise ParameterError("paper", name, f"one of {', '.join(PAPERS)}")
    return PAPERS[name]


async def report(
    name: str, found: Sequence[Found], preset: str = PRESET, *, jobs: int, lsb_per_g: float, progress: Progress
) -> Report:
    """Count a paper's conditions on synthetic walkers and on those of the recordings `found` that have them.

    ParameterError where there is no such paper; recordings that cannot be read are passed over. When cancelled it
    stops within a walk.
    """
    asked = paper(name)
    made = await _synthetic(asked, preset, progress)
    real = await _real(asked, found, preset, jobs, lsb_per_g, progress) if found else None
    return Report(paper=asked, preset=preset, results=made, measured=real, timings=timings(asked, preset))


async def _synthetic(asked: Paper, preset: str, progress: Progress) -> list[Result]:
    made, done, total = [], 0, walkers(asked)
    for result in results(asked, preset):
        if result is None:
            done += 1
            progress(done, total)
            await asyncio.sleep(0)  # lets a Ctrl-C in
        else:
            made.append(result)
    return made


async def _real(
    asked: Paper, found: Sequence[Found], preset: str, jobs: int, lsb_per_g: float, progress: Progress
) -> list[Measured]:
    used = [method for method in methods(asked) if method.counter in registry.COUNTERS]
    files = await asyncio.to_thread(wanted, asked, found, lsb_per_g)
    if not used or not files:
        return []
    chosen = [choice(method, preset) for method in used]
    rows = await evaluate(files, chosen, jobs=jobs, lsb_per_g=lsb_per_g, progress=progress)
    return measured(asked, list(zip(used * len(files), rows, strict=True)))
