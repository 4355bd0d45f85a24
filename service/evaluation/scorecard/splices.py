"""Step-free clips between two walks: a person who walks, stops, does it, and walks on.

Silence in a clip that is shorter than a cautious counter's warm-up proves little. So all the clips of one subject (and
place of the sensor) are put in a row between two pieces of a real walk: the counter has just believed a walk, and what
it still counts is false. The walk is of the same place; of the subject's own if there is one, else of the same source,
else of a sensor of the nearest rate, the candidates taken by turns. All lies on the 50 Hz grid, acceleration alone.

At a joint a person stands still for JOINT_S. A clip is turned as a whole, so that its first moments' mean gravity is
where the last moments before left it; the motion fades out, gravity stays, the clip's motion fades in. A step counted
up to TOLERANCE_S into a joint is the walk's last, one counted as long before the other walk its first: neither is
false. Hours are those of the clips.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from service.errors import CounterError
from service.evaluation.choices import Found
from service.evaluation.counting import count, grid_block
from service.evaluation.families import Family
from service.evaluation.metrics import SECONDS_PER_HOUR
from service.evaluation.rows import Choice
from service.evaluation.scorecard.disturbances import FEWEST_STEPS
from service.evaluation.scorecard.measured import Measured
from service.evaluation.scorecard.sampled import Floats, columns, rotation_onto, stacked
from service.recordings import read
from service.samples import GRID_HZ, SampleBlock

WALK_S: Final = 30.0
"""Of a walk, before the clips and after them: longer than any counter's warm-up."""
JOINT_S: Final = 1.0
FADE_S: Final = 0.25
ATTITUDE_S: Final = 1.0
"""Gravity is the mean over so long."""
TOLERANCE_S: Final = JOINT_S / 2

_KINDS: Final = frozenset({"negatives", "walk", "wrist", "watch", "handling"})
"""Words of a data set's name that tell what is in it, not where it is from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Splice:
    """The clips of one subject, and the walk they are put into."""

    family: Family
    dataset: str
    subject: str
    clips: tuple[Found, ...]
    walk: Found


@dataclass(frozen=True, slots=True, kw_only=True)
class Spliced:
    """What a counter made of a splice: steps in the clips, their length, and steps in both pieces of the walk."""

    splice: Splice
    counter: str
    false: int
    walked: int
    clips_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilySpliced:
    """A family's splices, or those of one counter that can count them."""

    family: Family
    subjects: int
    clips: int
    hours: float
    false_per_hour: float


def splices(rows: Iterable[Measured]) -> list[Splice]:
    """Return a splice for each subject, sensor place and family that holds no step; none where no walk fits."""
    rows = list({row.name: row for row in rows if row.duration_s}.values())
    walks = sorted((row for row in rows if _is_walk(row)), key=lambda row: row.name)
    groups: dict[tuple[str, str, str, Family], list[Measured]] = defaultdict(list)
    for row in rows:
        family = row.outcome().family
        if row.true_steps == 0 and family is not None:
            groups[row.file.dataset, row.subject or "", row.placement or "", family].append(row)
    made = []
    for turn, ((dataset, subject, _, family), clips) in enumerate(sorted(groups.items())):
        if (walk := _walk_for(clips[0], walks, turn)) is not None:
            files = tuple(clip.file for clip in sorted(clips, key=lambda row: row.name))
            made.append(Splice(family=family, dataset=dataset, subject=subject, clips=files, walk=walk.file))
    return made


def _is_walk(row: Measured) -> bool:
    return (row.true_steps or 0) >= FEWEST_STEPS and row.duration_s >= 2 * WALK_S / 3


def _walk_for(clip: Measured, walks: Sequence[Measured], turn: int) -> Measured | None:
    """Return the nearest walk; among equally near ones, another at each turn."""
    placed = [walk for walk in walks if walk.placement == clip.placement]
    if not placed:
        return None

    def far(walk: Measured) -> tuple[bool, bool, float]:
        related = bool(_source(walk) & _source(clip))
        rate = abs(np.log(walk.rate_hz / clip.rate_hz))
        return not (related and walk.subject == clip.subject), not related, 0.0 if related else round(float(rate), 3)

    nearest = min(map(far, placed))
    equal = [walk for walk in placed if far(walk) == nearest]
    return equal[turn % len(equal)]


def _source(row: Measured) -> set[str]:
    return set(row.file.dataset.split("_")) - _KINDS


def spliced(splice: Splice, chosen: Sequence[Choice], lsb_per_g: float) -> list[Spliced]:
    """Build a splice and count it with each counter that needs acceleration alone."""
    walk = _acc_g(splice.walk, lsb_per_g)
    half = min(len(walk) // 2, round(WALK_S * GRID_HZ))
    middle = len(walk) // 2
    clips = [_acc_g(clip, lsb_per_g) for clip in splice.clips]
    whole, (first, last) = joined(walk[middle - half : middle], clips, walk[middle : middle + half])
    block = SampleBlock(start=0, acc_g=columns(whole))
    made = []
    for choice in chosen:
        try:
            step_t_s = count(block, choice.counter, choice.preset, choice.overrides).step_t_s
        except CounterError:  # it needs another sensor
            continue
        inside = (step_t_s > first / GRID_HZ - TOLERANCE_S) & (step_t_s < last / GRID_HZ + TOLERANCE_S)
        false = int(np.count_nonzero(inside))
        made.append(
            Spliced(
                splice=splice,
                counter=choice.counter,
                false=false,
                walked=len(step_t_s) - false,
                clips_s=sum(map(len, clips)) / GRID_HZ,
            )
        )
    return made


def joined(before: Floats, clips: Sequence[Floats], after: Floats) -> tuple[Floats, tuple[int, int]]:
    """Return walk, clips and walk in one piece (n×3, g), and where the first clip begins and the last one ends."""
    whole = before
    begins: list[int] = []
    ends: list[int] = []
    for piece in (*clips, after):
        whole, begin = _appended(whole, piece)
        begins.append(begin)
        ends.append(len(whole))
    return whole, (begins[0], ends[-2])


def _appended(whole: Floats, piece: Floats) -> tuple[Floats, int]:
    """Return `whole`, a joint, and `piece` turned to meet it; and where the piece begins."""
    attitude, joint = round(ATTITUDE_S * GRID_HZ), round(JOINT_S * GRID_HZ)
    at_end = whole[-attitude:].mean(axis=0)
    turned = piece @ rotation_onto(piece[:attitude].mean(axis=0), at_end).T
    at_start = turned[:attitude].mean(axis=0)
    eased = _eased(joint)[:, None]
    still = (1 - eased) * at_end + eased * at_start
    fade = np.zeros((joint, 1))
    ramp = _eased(round(FADE_S * GRID_HZ))[:, None]
    fade[: len(ramp)] = 1 - ramp
    # Motion does not stop at once: the last samples before, and the first after, die away into the joint.
    out = fade * _mirrored(whole[-joint:][::-1] - at_end, joint)
    into = fade[::-1] * _mirrored(turned[:joint] - at_start, joint)[::-1]
    return np.concatenate([whole, still + out + into, turned]), len(whole) + joint


def _mirrored(values: Floats, n: int) -> Floats:
    """Return the first `n` samples; what is missing is the last one again."""
    return np.pad(values[:n], ((0, n - min(len(values), n)), (0, 0)), mode="edge")


def _eased(n: int) -> Floats:
    """Go from 0 to 1 along half a cosine."""
    eased: Floats = (1 - np.cos(np.pi * (np.arange(n) + 0.5) / n)) / 2
    return eased


def _acc_g(file: Found, lsb_per_g: float) -> Floats:
    recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping, rate_hz=file.rate_hz)
    return stacked(grid_block(recording).acc_g)


def by_family(made: Iterable[Spliced]) -> dict[Family, FamilySpliced]:
    """Return the false steps an hour of the clips, by family."""
    groups: Mapping[Family, list[Spliced]] = defaultdict(list)
    for each in made:
        groups[each.splice.family].append(each)
    return {family: _summed(family, groups[family]) for family in Family if family in groups}


def _summed(family: Family, made: Sequence[Spliced]) -> FamilySpliced:
    hours = sum(each.clips_s for each in made) / SECONDS_PER_HOUR
    return FamilySpliced(
        family=family,
        subjects=len(made),
        clips=sum(len(each.splice.clips) for each in made),
        hours=hours,
        false_per_hour=sum(each.false for each in made) / hours,
    )
