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
