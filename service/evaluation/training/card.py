"""The model card: a page of the guide about the network that ships, written by the training that made it.

Its figures are those the training measured, its numbers are read from what was run, and the digest at its head is that
of the weights: a test compares it with the file that ships, so that the card cannot be of another network. What was not
measured is said to be so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from service.counters import steplink
from service.counters import steplink_front as front
from service.counters import steplink_network as network
from service.counters import steplink_rhythm as rhythm
from service.evaluation.choices import Found
from service.evaluation.training import folds, motion, recipe, sources, validation
from service.evaluation.training.card_text import ABOUT_FIGURES, DIGEST_BEFORE, HEAD, LIMITS, NOT_MEASURED, RECIPE, USE
from service.evaluation.training.clips import CLIP, PAUSE_S
from service.evaluation.training.material import EXERCISES, SYNTHETIC, WEIGHTS, Material
from service.evaluation.training.runs import shares
from service.evaluation.training.validation import Validation
from service.samples import GRID_HZ

DATA_HEAD: Final = ("set", "holds", "from", "licence", "recordings", "minutes", "steps", "learnt from")
MADE: Final = (SYNTHETIC, EXERCISES)
"""What is made up."""
POOL_HEAD: Final = ("source", "of it", "share")
KINDS: Final = {"walk": "walks", "still": "no steps", "doubt": "none, perhaps a hidden step"}
SECONDS_PER_MINUTE: Final = 60.0

Line = tuple[str, ...]


def text(
    digest: str,
    about: Mapping[str, Any],
    teaching: Sequence[Material],
    unseen: Sequence[Material],
    apart: Sequence[Found],
    measured: Sequence[Validation],
) -> str:
    """Return the card of weights: what their file says of them, what they learnt from, and what was measured."""
    parts = [
        _head(digest),
        USE,
        "## Data",
        _data(teaching, unseen, apart, about),
        "## How it was trained",
        _recipe(about, teaching),
        "## Figures",
        _figures(measured),
        "## Limits",
        _limits(teaching),
    ]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _head(digest: str) -> str:
    frame_s = network.FRAME_ROWS * front.EVERY / GRID_HZ
    return HEAD.format(
        digest=digest,
        parameters=f"{sum((layer.taps * layer.inputs + 1) * layer.outputs for layer in network.LAYERS):,}",
        frame_s=f"{frame_s:g}",
        rate_hz=f"{GRID_HZ:g}",
        delay_s=f"{network.DELAY * frame_s:.2f}",
    )


def _limits(teaching: Sequence[Material]) -> str:
    people = {folds.person(one) for one in teaching}
    return LIMITS.format(
        slowest=f"{rhythm.SLOWEST_HZ:g}",
        fastest=f"{rhythm.SLOWEST_HZ + rhythm.SPAN_HZ:g}",
        walked=_walked(teaching),
        least=steplink.TUNED.least_steps,
        people=len(people),
        sources=len({source for source, _ in people}),
        latency_s=f"{steplink.latency_s(steplink.TUNED):.1f}",
    )


def _walked(teaching: Sequence[Material]) -> str:
    """Return the cadence of the middle 90 % of the steps whose times are known."""
    gaps = [np.diff(one.step_s) for one in teaching if one.step_s is not None]
    steps_hz = [1.0 / gap for gap in np.concatenate(gaps or [np.empty(0)]) if 0.0 < gap < PAUSE_S]
    if not steps_hz:
        return "unknown"
    low, high = np.percentile(steps_hz, (5, 95))
    return f"{low:.1f} to {high:.1f}"


def _data(
    teaching: Sequence[Material], unseen: Sequence[Material], apart: Sequence[Found], about: Mapping[str, Any]
) -> str:
    lines = [*_inventory(teaching, "yes"), *_inventory(unseen, "no: measured only")]
    lines += [
        _described(name, (str(number), "", "", "no: kept for the end"))
        for name, number in sorted(Counter(file.dataset for file in apart).items())
    ]
    taught = about.get("sources", {})
    lines += [_described(name, (str(taught[name]), "", "", "yes")) for name in MADE if name in taught]
    return f"{_table(DATA_HEAD, lines)}\n\n{sources.WHY}"


def _inventory(material: Sequence[Material], learnt: str) -> list[Line]:
    lines = []
    for name in sorted({one.source for one in material}):
        held = [one for one in material if one.source == name]
        minutes = sum(one.duration_s for one in held) / SECONDS_PER_MINUTE
        steps = sum(one.true_steps for one in held)
        lines.append(_described(name, (str(len(held)), f"{minutes:.1f}", f"{steps:,}", learnt)))
    return lines


def _described(name: str, figures: Line) -> Line:
    known = sources.source(name)
    return (f"`{name}`", known.holds, known.origin, known.licence, *figures)


def _recipe(about: Mapping[str, Any], teaching: Sequence[Material]) -> str:
    drawn = shares(teaching) | {pool: WEIGHTS[pool] for pool in (f"{SYNTHETIC}/walk", f"{EXERCISES}/still")}
    pools = [_pool(pool, share / sum(drawn.values())) for pool, share in sorted(drawn.items()) if share]
    told = RECIPE.format(
        made=_made(about),
        batch=recipe.BATCH,
        rate=f"{recipe.HIGHEST_RATE:g}",
        decay=f"{recipe.DECAY:g}",
        averaged=f"{100 * recipe.AVERAGED:g}",
        exact=f"{100 * (1 - recipe.EXACT_FROM):g}",
        clip_s=f"{CLIP / GRID_HZ:g}",
        range_g=f"{motion.FULL_SCALE_G:g}",
        rates=", ".join(f"{rate:g}" for rate in motion.RATES_HZ),
    )
    return f"{told.strip()}\n\n{_table(POOL_HEAD, pools)}"


def _made(about: Mapping[str, Any]) -> str:
    if not about:
        return "How many steps, with which seed and versions these weights took is not recorded in their file."
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return f"Steps {about['steps']}, seed {about['seed']}, mean loss of the last of them {about['loss']}; {versions}."


def _pool(pool: str, share: float) -> Line:
    name, _, kind = pool.partition("/")
    return f"`{name}`", KINDS.get(kind, kind), f"{100.0 * share:.0f} %"


def _figures(measured: Sequence[Validation]) -> str:
    if not measured:
        return NOT_MEASURED
    parts = [ABOUT_FIGURES.strip("\n")]
    for each in measured:
        seeds = f"Seeds {', '.join(map(str, each.outcomes))}.\n\n" if len(each.outcomes) > 1 else ""
        parts.append(f"### {each.title}\n\n{seeds}{_table(validation.HEAD, each.lines())}")
        parts += [
            f"Of `{name}`, whose wearers knew their steps within limits, {share.within} of {share.recordings} counts"
            f" ({share.percent:.0f} %) lie within them."
            for name, share in each.within().items()
        ]
    return "\n\n".join(parts)


def _table(head: Line, lines: Sequence[Line]) -> str:
    rows = [head, ("---",) * len(head), *lines]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows)


def said_digest(card: str) -> str | None:
    """Return the digest that a card names; None where it names none."""
    _, found, after = card.partition(DIGEST_BEFORE)
    return after.partition("`")[0] if found else None
