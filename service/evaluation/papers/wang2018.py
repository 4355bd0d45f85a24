"""Wang, Peng, Zhou 2018, doi 10.19734/j.issn.1001-3695.2018.11.0793: adaptive double threshold on a bracelet.

Its Tables 2 and 3 are the same twelve walks, counted on three axes and on two; Table 4 sets the bracelet (A10) on one
wrist against a Mi Band 2 on the other. In our copy of Tables 2 and 3 the names of the walks have slipped against the
numbers. Our reading goes by the steps (walks of 200, runs and climbs of 100) and by the text, which says that two axes
cost accuracy with the band in the pocket and gain it elsewhere; runs then lose too. Not steps, said to be excluded:
getting up, sitting down, typing, knocking on the table (no numbers).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from service.counters.double_threshold import DoubleThresholdParams, middle_window
from service.evaluation.papers.conditions import Claim, Condition, Figures, Method, Paper, Part, Real, Table, do, walk
from service.samples import SampleBlock

_XZ: Final = Method(label="two axes", counter="double_threshold", params={"axes": "xz"}, by_axis=True)
_NORM: Final = Method(label="three axes", counter="double_threshold", params={"axes": "norm"})
_OTHER: Final = Method(label="other wrist", counter="double_threshold", params={"axes": "xz"}, mirrored=True)


def _run(true: int, counted: int) -> Figures:
    return Figures(true=true, counted=counted, accuracy=100 * (1 - abs(counted - true) / true))


_CLAIMED: Final = {"two axes": 91.88, "three axes": 91.88}

_WALKS: Final = (
    ("slow, arm swinging", "slow", "wrist", 200, 202, 182),
    ("climbing a hill slowly", "uphill", "wrist", 100, 88, 96),
    ("climbing a hill slowly", "uphill", "wrist", 100, 88, 92),
    ("climbing a hill slowly", "uphill", "wrist", 100, 107, 99),
    ("fast, arm swinging", "fast", "wrist", 200, 154, 186),
    ("fast, arm swinging", "fast", "wrist", 200, 162, 180),
    ("slow, band in the pocket", "slow", "pocket", 200, 205, 186),
    ("slow, band in the pocket", "slow", "pocket", 200, 178, 185),
    ("slow, band in the pocket", "slow", "pocket", 200, 179, 173),
    ("run", "run", "wrist", 100, 96, 89),
    ("run", "run", "wrist", 100, 76, 80),
    ("run", "run", "wrist", 100, 103, 94),
)
"""Label, activity, pose, true steps, counted on three axes (Table 2) and on two (Table 3)."""

_PAIRS: Final = (
    ("slow, arm swinging", "slow", "wrist", (165, 147, 153, 173), ((177, 200), (77, 207), (104, 200), (142, 200))),
    ("fast, arm swinging", "fast", "wrist", (186, 165, 170, 132), ((160, 200), (190, 200), (121, 200), (173, 205))),
    (
        "slow, band in the pocket",
        "slow",
        "pocket",
        (186, 168, 173, 168),
        ((201, 200), (213, 207), (242, 200), (177, 200)),
    ),
)
"""Table 4: the bracelet's counts of 200 steps; the Mi Band's counts, each with its own true steps."""


def _walks(column: int) -> Iterable[Condition]:
    for number, row in enumerate(_WALKS, start=1):
        label, activity, pose, true, *counted = row
        figures = {(_NORM, _XZ)[column].label: _run(true, counted[column])}
        yield Condition(label=f"{number:2} {label}", parts=(walk(activity, true),), pose=pose, published=figures)


def _pairs() -> Iterable[Condition]:
    for label, activity, pose, ours, theirs in _PAIRS:
        for number, (counted, (other, true)) in enumerate(zip(ours, theirs, strict=True), start=1):
            figures = {_XZ.label: _run(200, counted), _OTHER.label: _run(true, other)}
            parts = (walk(activity, 200),)
            yield Condition(label=f"{label} {number}", parts=parts, pose=pose, published=figures)


def _not_steps() -> Iterable[Condition]:
    still: tuple[Part, ...] = (do("rest", 5),)
    for label, parts in (
        ("getting up, ten times", (do("stand", 8), *still) * 10),
        ("sitting down, ten times", (do("sit", 8), *still) * 10),
        ("typing for three minutes", (do("type", 180),)),
        ("knocking on the table for a minute", (do("knock", 60),)),
    ):
        yield Condition(label=label, parts=parts, walkers=5)


_CHANGES: Final = (
    Condition(label="run, then walk", parts=(walk("run", 100), walk("slow", 100)), walkers=5),
    Condition(label="start and stop, ten steps at a time", parts=(walk("normal", 10), do("rest", 5)) * 10, walkers=5),
    Condition(label="fast, then stop at once", parts=(walk("fast", 100), do("rest", 60)), walkers=5),
    Condition(label="walk, arm not swinging", parts=(walk("still_arm", 200),), walkers=5),
)


def _window(walked: SampleBlock, _: SampleBlock | None, params: DoubleThresholdParams) -> Mapping[str, Any]:
    """Return the window of the middle 300 samples, which the tables were made with (section 2.3)."""
    return {"window_mode": "fixed", "first_window": middle_window(walked, params)}


PAPER: Final = Paper(
    name="wang2018",
    title="Pedometer method based on self-adaptive double threshold algorithm (Wang, Peng, Zhou)",
    tables=(
        Table(title="Table 2. Test results of 3-axis data", methods=(_NORM,), rows=tuple(_walks(0))),
        Table(
            title="Table 3. Test results of 2-axis data",
            methods=(_XZ,),
            rows=tuple(_walks(1)),
            note="The walks of Table 2. On the wrist a walker's Y axis is roughness only: no walk's count changes.",
        ),
        Table(
            title="Table 4. The bracelet on one wrist, another on the other",
            methods=(_XZ, _OTHER),
            rows=tuple(_pairs()),
            note="Published beside it: Mi Band 2. Ours: the same counter on both wrists of one walker.",
        ),
        Table(
            title="Not steps, said to be excluded (no table)",
            methods=(_XZ, _NORM),
            rows=tuple(_not_steps()),
        ),
        Table(title="Changes of gait (ours; the text names them)", methods=(_XZ,), rows=_CHANGES),
    ),
    claims=(
        Claim(
            text="slow, fast and running: mean accuracy of 91.88 % and more",
            method=_XZ.label,
            percent=91.88,
            of="mean",
            tables=(2,),
            about="slow, fast, run",
        ),
    ),
    real=(
        Real(
            label="walk, band on the wrist",
            placement="wrist",
            activity=r"walk(?!.*(run|stairs|steps|pocket|slow)).*",
            claims=_CLAIMED,
        ),
        Real(label="slow walk", placement="wrist", activity=r".*slow.*", claims=_CLAIMED),
        Real(label="run", placement="wrist", activity=r"run|jog", claims=_CLAIMED),
        Real(label="stairs", placement="wrist", activity=r".*(stairs|steps_down).*"),
        Real(label="walk, run and arm work mixed", placement="wrist", activity=r".*mixed.*"),
        Real(label="hand in the pocket", placement="wrist", activity=r".*hands_in_pocket"),
        Real(label="getting up and sitting down", placement="wrist", activity=r"(standup|sitdown)_chair"),
        Real(label="desk work", placement="wrist", activity=r"desk.*"),
    ),
    prepare=_window,
)
