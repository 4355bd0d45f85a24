"""The scorecards of several counters over many recordings, over all cores.

First each recording is counted, plainly and disturbed; then, with what is known of all of them, the splices and the
synthetic walkers. A process reads a recording once for all counters.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from service.evaluation.choices import Found
from service.evaluation.pool import ENDED, Progress, mapped
from service.evaluation.rows import Choice
from service.evaluation.scorecard.card import Lost, Scorecard
from service.evaluation.scorecard.measured import Measured, failed, measure, told
from service.evaluation.scorecard.situations import SITUATIONS, Situation, Walked, synthetic
from service.evaluation.scorecard.splices import Splice, Spliced, spliced, splices


async def measured(
    found: Sequence[Found], chosen: Sequence[Choice], *, jobs: int, lsb_per_g: float, progress: Progress
) -> list[Measured]:
    """Count every recording with every counter, `jobs` recordings at a time."""
    by_file = await mapped(
        partial(measure, chosen=chosen, lsb_per_g=lsb_per_g),
        found,
        jobs=jobs,
        progress=progress,
        ended=lambda file: failed(file, chosen, ENDED),
    )
    return [row for made in by_file for row in made]


async def scorecards(
    rows: Sequence[Measured], chosen: Sequence[Choice], *, jobs: int, lsb_per_g: float, progress: Progress
) -> list[Scorecard]:
    """Count splices and walkers too, and return a scorecard for each counter, in the order given."""
    items: list[Splice | Situation] = [*splices(rows), *(each for each in SITUATIONS if each.walkers is not None)]
    work = partial(counted, chosen=chosen, lsb_per_g=lsb_per_g)
    made = [each for found in await mapped(work, items, jobs=jobs, progress=progress, ended=_ended) for each in found]
    return [
        Scorecard(
            choice.counter,
            choice.preset,
            [row for row in rows if row.counter == choice.counter],
            [each for each in made if isinstance(each, Spliced) and each.counter == choice.counter],
            [each for each in made if isinstance(each, Walked) and each.counter == choice.counter],
            lost=[each for each in made if isinstance(each, Lost)],
        )
        for choice in chosen
    ]


def counted(item: Splice | Situation, chosen: Sequence[Choice], lsb_per_g: float) -> list[Spliced | Walked | Lost]:
    """Count one splice, or the walkers of one situation."""
    try:
        return [*spliced(item, chosen, lsb_per_g)] if isinstance(item, Splice) else [*synthetic(item, chosen)]
    except Exception as error:  # one of them must not end the others
        return [Lost(what=_name(item), why=told(error))]


def _ended(item: Splice | Situation) -> list[Spliced | Walked | Lost]:
    return [Lost(what=_name(item), why=ENDED)]


def _name(item: Splice | Situation) -> str:
    return f"splice of {item.dataset} {item.subject}" if isinstance(item, Splice) else f"walkers: {item.label}"
