"""A whole paper: its synthetic walkers here, the real recordings over all cores, then its report."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Sequence
from typing import Final

from service.counters import registry
from service.errors import ParameterError
from service.evaluation.choices import Found, find
from service.evaluation.papers import PAPERS
from service.evaluation.papers.conditions import Paper
from service.evaluation.papers.real import Measured, choice, measured, methods, wanted
from service.evaluation.papers.report import Report
from service.evaluation.papers.results import Result, results, timings, walkers
from service.evaluation.pool import Progress
from service.evaluation.run import evaluate

DATA: Final = "STEPLINK_DATA"
PRESET: Final = "paper"
"""The published parameters, where none are asked for."""


def asked(name: str, counters: Sequence[str], params: Sequence[str]) -> Paper:
    """Return the paper of that name; ParameterError where there is none, or where its counters are chosen too."""
    if name not in PAPERS:
        raise ParameterError("paper", name, f"one of {', '.join(PAPERS)}")
    if counters or params:
        raise ParameterError("paper", name, "it says itself which counters: leave --counter and --param out")
    return PAPERS[name]


def recordings(paths: Sequence[str]) -> list[Found]:
    """Return the recordings at `paths`, else those of the folder that STEPLINK_DATA names, else none."""
    folder = os.environ.get(DATA)
    named = list(paths) or ([folder] if folder else [])
    return find(named)[0] if named else []


async def report(
    of: Paper, found: Sequence[Found], preset: str = PRESET, *, jobs: int, lsb_per_g: float, progress: Progress
) -> Report:
    """Count a paper's conditions on synthetic walkers and on those of the recordings `found` that have them.

    Recordings that cannot be read are passed over. When cancelled it stops within a walk.
    """
    made = await _synthetic(of, preset, progress)
    real = await _real(of, found, preset, jobs, lsb_per_g, progress) if found else None
    return Report(paper=of, preset=preset, results=made, measured=real, timings=timings(of, preset))


async def _synthetic(of: Paper, preset: str, progress: Progress) -> list[Result]:
    made, done, total = [], 0, walkers(of)
    for result in results(of, preset):
        if result is None:
            done += 1
            progress(done, total)
            await asyncio.sleep(0)  # lets a Ctrl-C in
        else:
            made.append(result)
    return made


async def _real(
    of: Paper, found: Sequence[Found], preset: str, jobs: int, lsb_per_g: float, progress: Progress
) -> list[Measured]:
    used = [method for method in methods(of) if method.counter in registry.COUNTERS]
    files = await asyncio.to_thread(wanted, of, found, lsb_per_g)
    if not used or not files:
        return []
    chosen = [choice(method, preset) for method in used]
    rows = await evaluate([each.file for each in files], chosen, jobs=jobs, lsb_per_g=lsb_per_g, progress=progress)
    counted = zip([(each, method) for each in files for method in used], rows, strict=True)
    return measured(of, [(method, row) for (each, method), row in counted if each.takes(method)])
