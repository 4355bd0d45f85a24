"""The commands that end by themselves with a result: `steplink evaluate`, `bench`, `counters`.

What is asked for is checked before any work is done, and files are written before anything is printed.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from service.cli_options import mapping
from service.cli_output import say
from service.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

    from service.evaluation.choices import Found
    from service.evaluation.papers.report import Bar
    from service.evaluation.rows import Choice, Row

NOTHING_COUNTED = 1


async def evaluate(options: argparse.Namespace) -> int:
    """Count recordings and compare with their true steps."""
    from service.evaluation import choices, json_file  # noqa: PLC0415
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415
    from service.evaluation.run import evaluate as run  # noqa: PLC0415
    from service.evaluation.tables import report  # noqa: PLC0415

    if options.scorecard:
        return await _scorecard(options)
    if options.guide is not None:
        raise ParameterError("guide", options.guide, "it is the page of a scorecard: --scorecard is wanted too")
    if options.paper is not None:
        await _evaluate_paper(options)
        return 0
    names, paths = choices.counters_and_paths(options.counter, options.path)
    chosen = choices.choices(names, options.preset or "tuned", options.param)
    found, passed = choices.find(paths, mapping(options), options.rate_hz)
    chosen = _calibrated(chosen, options)
    output, folder = json_file.checked_path(options.json), _figures_folder(options)
    if passed:
        print(f"steplink: passed over texts without acceleration: {', '.join(passed)}{_hint(options)}", file=sys.stderr)
    with ProgressBar() as progress:
        rows = await run(found, chosen, jobs=options.jobs, lsb_per_g=options.lsb_per_g, progress=progress)
    json_file.write_json(output, (row.as_json() for row in rows))
    say(report(rows))
    _draw(folder, rows, found, options)
    return NOTHING_COUNTED if all(row.error for row in rows) else 0


def _calibrated(chosen: list[Choice], options: argparse.Namespace) -> list[Choice]:
    """Return the counters with what they are to learn, or have learnt from a walk."""
    from service.evaluation import calibration, counting  # noqa: PLC0415
    from service.recordings import read  # noqa: PLC0415

    if options.calibrate is None:
        return chosen
    if options.calibrate == calibration.EACH_MIDDLE:
        return calibration.from_middle(chosen)
    walk = read(options.calibrate, lsb_per_g=options.lsb_per_g, rate_hz=options.rate_hz, mapping=mapping(options))
    return calibration.from_walk(chosen, counting.grid_block(walk), options.calibrate)


def _hint(options: argparse.Namespace) -> str:
    return "" if options.columns else " (--columns names those of another table)"


async def _evaluate_paper(options: argparse.Namespace) -> None:
    """Print a paper's tables, its figures beside ours."""
    from service.evaluation import json_file  # noqa: PLC0415
    from service.evaluation.papers import run  # noqa: PLC0415
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415

    if options.calibrate is not None:
        raise ParameterError("calibrate", options.calibrate, "a paper's tables say themselves how its counter learns")
    asked = run.asked(options.paper, options.counter, options.param)
    found = run.recordings(options.path)
    output, folder = json_file.checked_path(options.json), _figures_folder(options)
    with ProgressBar() as progress:
        made = await run.report(
            asked,
            found,
            options.preset or run.PRESET,
            jobs=options.jobs,
            lsb_per_g=options.lsb_per_g,
            progress=progress,
        )
    json_file.write_json(output, made.as_json())
    say(made.text())
    _draw(folder, made.rows, found, options, made.bars)


async def _scorecard(options: argparse.Namespace) -> int:
    """Print the scorecards of the counters."""
    from service.evaluation import choices, json_file  # noqa: PLC0415
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415
    from service.evaluation.scorecard import page, report, run  # noqa: PLC0415
    from service.evaluation.scorecard.splits import of_split  # noqa: PLC0415

    for name in ("paper", "calibrate"):
        if getattr(options, name) is not None:
            raise ParameterError(name, getattr(options, name), "a scorecard is of counters as they are: leave it out")
    names, paths = choices.counters_and_paths(options.counter, options.path)
    chosen = choices.choices(names, options.preset or "tuned", options.param)
    found, apart = of_split(choices.find(paths, mapping(options), options.rate_hz)[0], options.split)
    if not found:
        raise ParameterError("split", options.split, f"none of the {len(apart)} recordings there is of it")
    output, drawings = json_file.checked_path(options.json), page.checked(options.figures, options.guide)
    if apart:
        sets = ", ".join(sorted({file.dataset for file in apart}))
        print(f"steplink: {len(apart)} recordings of another split left out: {sets}", file=sys.stderr)
    spread = {"jobs": options.jobs, "lsb_per_g": options.lsb_per_g}
    with ProgressBar() as progress:
        rows = await run.measured(found, chosen, **spread, progress=progress)
    with ProgressBar(of="splices and walkers") as progress:
        cards = await run.scorecards(rows, chosen, **spread, progress=progress)
    json_file.write_json(output, (row for card in cards for row in card.as_json()))
    page.write(drawings, cards)
    say(report.text(cards))
    return NOTHING_COUNTED if all(row.error for row in rows) else 0


def _figures_folder(options: argparse.Namespace) -> Path | None:
    from service.evaluation.figures.canvas import checked_folder  # noqa: PLC0415

    return None if options.figures is None else checked_folder(options.figures)


def _draw(
    folder: Path | None,
    rows: Sequence[Row],
    found: Sequence[Found],
    options: argparse.Namespace,
    bars: Sequence[Bar] = (),
) -> None:
    """Draw the figures where a folder for them was named."""
    if folder is None:
        return
    from service.evaluation.figures.draw import write  # noqa: PLC0415

    written = write(folder, rows, found, lsb_per_g=options.lsb_per_g, bars=bars)
    print(f"steplink: {len(written)} figures in {folder}: {', '.join(path.stem for path in written)}", file=sys.stderr)


async def bench(options: argparse.Namespace) -> None:
    """Measure the counters' speed."""
    from service.evaluation import bench, choices, json_file  # noqa: PLC0415
    from service.signals.compiled import available  # noqa: PLC0415

    names = [choice.counter for choice in choices.choices(options.counter or ["all"], "tuned", ())]
    output = json_file.checked_path(options.json)
    if not available():
        print(bench.WITHOUT_NUMBA, file=sys.stderr)
    figures = []
    for figure in bench.figures(names, options.samples):
        figures.append(dataclasses.asdict(figure))
        read = say(f"{figure.name:<58}{figure.value:>15,.4g} {figure.unit}")
        if not read and output is None:
            return
    json_file.write_json(output, figures)


async def counters(options: argparse.Namespace) -> None:
    """Print the counters, or the parameters of one."""
    from service.counters import describe  # noqa: PLC0415
    from service.evaluation.tables import aligned  # noqa: PLC0415

    if options.markdown:
        say(describe.markdown().rstrip("\n"))
    elif options.name is None:
        say(aligned([describe.OVERVIEW, *describe.overview()], left=4))
    else:
        say(aligned([describe.PARAMETERS, *describe.parameters(options.name)], left=6))
