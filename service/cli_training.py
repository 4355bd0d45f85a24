"""The command that trains: `steplink train`, from nothing or going on from weights that there are.

What can be wrong is found before any training: the extra that is missing, files that cannot be written, recordings
that cannot be read or are too few. Weights and card are written whole, at the very end.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from service.cli_options import add_columns, mapping, number
from service.cli_output import say
from service.errors import ParameterError
from service.evaluation.training import recipe

if TYPE_CHECKING:
    from service.evaluation.choices import Found
    from service.evaluation.training.material import Material
    from service.evaluation.training.runs import Run, Trained
    from service.evaluation.training.sources import Sorted

OUT: Final = "steplink_weights.npz"
DID_NOT_HELP: Final = 1

FOLDS: Final = ("none", "sources", "subjects")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `train` takes."""
    parser.add_argument(
        "--data",
        metavar="PATH",
        nargs="+",
        action="extend",
        required=True,
        help="recordings that say how many steps they hold, or folders of them; a folder's name is the data set's",
    )
    parser.add_argument("--out", metavar="FILE", default=OUT, help=f"where the weights go (default {OUT})")
    parser.add_argument(
        "--from",
        dest="start",
        metavar="WEIGHTS",
        help="fine-tune: go on from these weights, or from `shipped`, the ones that come with steplink, with few steps"
        " at a low rate, and tell whether it helped; if not, nothing is written and the exit code is 1",
    )
    parser.add_argument(
        "--steps",
        type=_whole(8, 1_000_000),
        help=f"steps of the training (default {recipe.STEPS}, with --from {recipe.TUNING_STEPS})",
    )
    parser.add_argument("--seed", type=_whole(0, 2**31 - 1), default=1, help="another seed, other weights (default 1)")
    parser.add_argument(
        "--folds",
        nargs="+",
        choices=FOLDS,
        default=["none"],
        help="cross-validate too: hold back each source, or a fifth of the subjects at a time (default none)",
    )
    parser.add_argument(
        "--seeds", type=_whole(1, 20), default=1, help="seeds of each cross-validation, from --seed on (default 1)"
    )
    parser.add_argument("--card", metavar="FILE", help="write the model card there, as a page of the guide (.md)")
    parser.add_argument(
        "--jobs", type=_whole(1, 256), default=1, help="trainings at once, a core and 1 GB of memory each (default 1)"
    )
    parser.add_argument(
        "--lsb-per-g", type=_whole(1, 65535), default=32, help="scale of recordings in raw units, LSB/g (default 32)"
    )
    add_columns(parser)


def _whole(low: int, high: int) -> Callable[[str], int]:
    within = number(low, high)

    def whole(text: str) -> int:
        int(text)
        return int(within(text))

    return whole


async def train(options: argparse.Namespace) -> int:
    """Train, or fine-tune; return the exit code."""
    from service.evaluation import choices  # noqa: PLC0415
    from service.evaluation.training import runs, sources, weights_file  # noqa: PLC0415

    runs.require_framework()
    weights_file.checked(options.out, "out")
    if options.card is not None:
        weights_file.checked(options.card, "card")
    found, _ = choices.find(options.data, mapping(options), options.rate_hz)
    files = sources.told_apart(found)
    if "none" in options.folds and len(set(options.folds)) > 1:
        raise ParameterError("folds", options.folds, "none beside others")
    if options.start is not None:
        return _fine_tune(options, files)
    _anew(options, files)
    return 0


def _anew(options: argparse.Namespace, files: Sorted) -> None:
    """Train from nothing; write the weights and, where it is wanted, the card."""
    from service.evaluation.tables import aligned  # noqa: PLC0415
    from service.evaluation.training import card, scratch, validation, weights_file  # noqa: PLC0415

    _tell(*files.notes())
    teaching, unseen = _loaded(files.teaching, options), _loaded(files.unseen, options, needed=False)
    plan = scratch.plan(
        teaching,
        unseen,
        wanted=[kind for kind in options.folds if kind != "none"],
        steps=options.steps or recipe.STEPS,
        seed=options.seed,
        seeds=options.seeds,
    )
    trained = _carried_out(plan.runs, plan.material, options.jobs)
    about = weights_file.about(trained[0], plan.material)
    digest = weights_file.write(Path(options.out), trained[0].kept[-1].arrays, about)
    found = scratch.validations(plan, trained)
    if options.card is not None:
        text = card.text(digest, about, teaching, unseen, files.apart, found)
        weights_file.replace(Path(options.card), text.encode(), "card")
    for each in found:
        say(f"{each.title}\n\n{aligned([validation.HEAD, *each.lines()], left=1)}\n")
    say(f"loss {trained[0].first_loss:.3f} → {trained[0].last_loss:.3f}")
    _say_written(options.out, digest)


def _fine_tune(options: argparse.Namespace, files: Sorted) -> int:
    """Go on from weights; write them only where that helped."""
    from service.counters import steplink_weights  # noqa: PLC0415
    from service.evaluation.tables import aligned  # noqa: PLC0415
    from service.evaluation.training import tuning, weights_file  # noqa: PLC0415

    for name, unfit in (("card", options.card), ("folds", options.folds != ["none"] and options.folds)):
        if unfit:
            raise ParameterError(name, unfit, "is of a training from nothing; --from tells by itself whether it helped")
    start = steplink_weights.shipped() if options.start == "shipped" else steplink_weights.read(Path(options.start))
    _tell(*files.notes())
    own = _loaded(files.teaching, options)
    plan = tuning.plan(
        own, steplink_weights.integers(start.weights), steps=options.steps or recipe.TUNING_STEPS, seed=options.seed
    )
    trained = _carried_out(plan.runs, plan.material, options.jobs)
    verdict = tuning.verdict(plan, trained, start.weights)
    say(aligned(tuning.table(verdict), left=1))
    say(f"\n{tuning.sentence(verdict)}")
    if not verdict.helped:
        _tell("nothing was written")
        return DID_NOT_HELP
    about = weights_file.about(trained[-1], plan.material, steps=verdict.chosen.steps, start=start.weights)
    _say_written(options.out, weights_file.write(Path(options.out), verdict.chosen.arrays, about))
    return 0


def _loaded(files: Sequence[Found], options: argparse.Namespace, *, needed: bool = True) -> list[Material]:
    """Read recordings; ParameterError where some are needed and none says how many steps it holds."""
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415
    from service.evaluation.training import sources  # noqa: PLC0415

    with ProgressBar() as progress:
        made, passed = sources.load(files, options.lsb_per_g, progress)
    if passed:
        _tell(f"passed over, too short or of no known number of steps: {', '.join(passed)}")
    if needed and not made:
        raise ParameterError("data", " ".join(options.data), "no recording there says how many steps it holds")
    return made


def _carried_out(runs: Sequence[Run], material: Sequence[Material], jobs: int) -> list[Trained]:
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415
    from service.evaluation.training import runs as training  # noqa: PLC0415

    with ProgressBar(of="steps of training") as progress:
        return training.carried_out(runs, material, jobs=jobs, progress=progress)


def _say_written(out: str, digest: str) -> None:
    say(f"weights {digest} are in {out}; `--weights {out}` of evaluate, serve and demo counts with them")


def _tell(*texts: str) -> None:
    for text in texts:
        print(f"steplink: {text}", file=sys.stderr)
