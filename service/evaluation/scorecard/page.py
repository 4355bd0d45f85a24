"""The scorecard as a page of the guide: its text and its figures are made at once, so that they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from service.errors import ParameterError
from service.evaluation.metrics import SECONDS_PER_HOUR
from service.evaluation.scorecard import report
from service.evaluation.scorecard.card import Scorecard
from service.evaluation.scorecard.charts import LEVELS, SHARES, charts

LEARNER: Final = "steplink"
PAGE: Final = ".md"
DRAWING: Final = ".svg"

TITLE: Final = "How accurate the counters are, and what the error is made of"
HOW: Final = """\
This page is written by

```
steplink evaluate PATH… --scorecard --counter NAME… --guide service/guide/accuracy.md
```

and by nothing else. Error = |counted − true| / true of a recording; a family's value is the mean over its recordings.
Where nobody steps, every counted step is false, and they are told an hour. A recording's times, rate and truth are as
its data set has them; a count is that of the live service, sample for sample."""
FAMILIES: Final = """\
Wrist and phone walks are all recordings with steps, by where the sensor was worn. Rehab exercise is
`negatives_spar_watch`, the household `negatives_hmp`; what of it its authors mark as uncertain (getting up, lying down,
sitting down, standing up: each may hide a step) stands apart, without a limit. Driving and desk is
`negatives_banglejs`; Pebble non-walking holds that set's own driving, reading, washing up and gestures. Phone handling
is `brajdic_handling`."""
LEARNT: Final = """\
The counter `steplink` has learnt from some of these very sets, as its model card says: there its figures are those of
recordings it has seen, and tell nothing of an unseen source. The card has those of
sources that never taught, and of a cross-validation where its training made one."""
PARTS: Final = """\
A recording's share is its own percentage over the sum of its family's, or its false steps over all of them; the largest
are drawn."""
BUDGET: Final = """\
The error by rate, range, resolution and loss is that of the same walks, changed: those of 50 steps or more to which
every level applies. By cadence, placement, the device's own rate and whether its range ended, other people and sensors
stand behind each bar, so that a difference is not that quantity's doing alone. Cadence is true steps over the whole
recording, pauses included. Packets hold ten samples: a lost one is 0.1 s of 100 Hz, and 0.8 s of 12.5 Hz, which no
counter bridges."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawings:
    """Where the figures go, and the page; None where they are not wanted."""

    folder: Path | None
    page: Path | None


def checked(folder: str | None, page: str | None) -> Drawings:
    """Return where to write, folders made; ParameterError before any work where nothing can be there."""
    if page is not None and (not page.endswith(PAGE) or not Path(page).parent.is_dir()):
        raise ParameterError("guide", page, f"a file {PAGE} in a folder that exists is wanted")
    if folder is not None:
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ParameterError("figures", folder, f"no folder can be made there: {error.strerror}") from error
    return Drawings(folder=None if folder is None else Path(folder), page=None if page is None else Path(page))


def write(to: Drawings, cards: Sequence[Scorecard]) -> None:
    """Write the figures, and the page with figures of its own name beside it; ParameterError where that fails."""
    drawn = {name: chart.svg() for name, chart in charts(cards).items()}
    files: dict[Path, str] = {}
    if to.folder is not None:
        files |= {to.folder / f"{name}{DRAWING}": text for name, text in drawn.items()}
    if to.page is not None:
        stem = to.page.with_suffix("").name
        files |= {to.page.with_name(f"{stem}_{name}{DRAWING}"): text for name, text in drawn.items()}
        files[to.page] = markdown(cards, stem)
    for path, text in files.items():
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise ParameterError("guide", str(path), error.strerror or str(error)) from error


def markdown(cards: Sequence[Scorecard], stem: str) -> str:
    """Return the page; its figures are files whose names begin with `stem`."""
    drawn = charts(cards)

    def figures(*names: str) -> list[str]:
        return [f"![{drawn[name].title}]({stem}_{name}{DRAWING})" for name in names if name in drawn]

    parts = [
        f"# {TITLE}",
        HOW,
        _of(cards),
        *report.errors(cards),
        *([LEARNT] if LEARNER in {card.counter for card in cards} else []),
        "## The scorecard",
        FAMILIES,
        *figures("walks", "quiet"),
        *(table.markdown() for table in report.tables(cards)),
        "## The error's parts",
        PARTS,
        *(figure for what in SHARES for card in cards for figure in figures(f"{what}_{card.counter}")),
        "### By what was measured, and how",
        BUDGET,
        *figures(*LEVELS),
    ]
    return "\n\n".join(parts) + "\n"


def _of(cards: Sequence[Scorecard]) -> str:
    """Say which recordings these are."""
    rows = cards[0].rows
    sets = ", ".join(f"`{name}`" for name in sorted({row.file.dataset for row in rows}))
    hours = sum(row.duration_s for row in rows) / SECONDS_PER_HOUR
    counters = ", ".join(f"`{card.counter}` ({card.preset})" for card in cards)
    return f"Counters: {counters}. Recordings: {len(rows)} of {hours:.1f} hours, of {sets}."
