"""Chen, Li, Zhang 2015: adaptive peak detection against conventional peaks and autocorrelation.

Eleven combinations: six poses (A flat on the palm, B in use, C swinging in the hand, D pocket, E backpack, F shoulder
bag) by walking at changing speed (1), and B…F by running (2), on two sensors strapped together, a phone (Table 2) and
a 3DM-GX3 (Table 3). Our copy has the tables' captions only: published beside ours are the text's claims. The length of
the walks is ours. Not steps, said to be excluded by the time test: getting up, sitting down, turning, gestures.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from service.evaluation.papers.conditions import Claim, Condition, Method, Paper, Real, Table, do, walk

_METHODS: Final = (
    Method(label="adaptive", counter="adaptive_peak"),
    Method(label="conventional", counter="conventional_peak"),
    Method(label="autocorrelation", counter="autocorrelation"),
)
_POSES: Final = (
    ("A", "flat on the palm", "flat"),
    ("B", "in use", "flat"),
    ("C", "swinging in the hand", "swinging"),
    ("D", "pocket", "pocket"),
    ("E", "backpack", "backpack"),
    ("F", "shoulder bag", "bag"),
)
_WALKING: Final = {"adaptive": 99.0, "conventional": 97.0, "autocorrelation": 99.0}
_RUNNING: Final = {"adaptive": 99.0, "conventional": 70.0, "autocorrelation": 50.0}
"""Figure 12, as the text says it."""

GX3_NOISE_G: Final = 0.0004
"""80 µg/√Hz over 25 Hz, the data sheet's of the 3DM-GX3-25."""
_TWO_SENSORS: Final = """\
Strapped together: the walks of Table 2, with the data sheet's noise in place of a phone's. White noise is all that
differs here, and it is small beside the roughness of the gait: like counts say nothing about a phone's offset, steps of
resolution or uneven clock."""
CALCULATION_S: Final = {"adaptive_peak": 0.036, "conventional_peak": 0.046, "autocorrelation": 0.131}
"""Figure 13: 5,000 samples in MATLAB at 2.27 GHz."""


def _combinations() -> Iterable[Condition]:
    changing = (walk("slow", 60), walk("normal", 80), walk("fast", 80), walk("normal", 80))
    for letter, label, pose in _POSES:
        yield Condition(label=f"{letter}1 {label}, walking", parts=changing, pose=pose)
    for letter, label, pose in _POSES[1:]:
        yield Condition(label=f"{letter}2 {label}, running", parts=(walk("run", 300),), pose=pose)


_NOT_STEPS: Final = (
    Condition(label="getting up and sitting down", parts=(do("stand", 8), do("sit", 8)) * 5, pose="flat", walkers=5),
    Condition(label="turning round", parts=(do("turn_round", 60),), pose="flat", walkers=5),
    Condition(label="gestures", parts=(do("gesture", 60),), pose="flat", walkers=5),
)


def _claims() -> Iterable[Claim]:
    walking, running = (
        {"adaptive": 99, "conventional": 97, "autocorrelation": 99},
        {
            "adaptive": 99,
            "conventional": 70,
            "autocorrelation": 50,
        },
    )
    for rows, figures, comparison in (("walking", walking, "and more"), ("running", running, "")):
        for method, percent in figures.items():
            text = f"{method}, {rows}: {percent:g} % {comparison}".rstrip()
            yield Claim(text=text, method=method, percent=percent, of="mean", tables=(1, 2), about=rows, rows=rows)


PAPER: Final = Paper(
    name="chen2015",
    title="Pedometer method based on adaptive peak detection algorithm (Chen, Li, Zhang)",
    tables=(
        Table(title="Table 2. Smartphone, 50 Hz", methods=_METHODS, rows=tuple(_combinations())),
        Table(
            title="Table 3. 3DM-GX3, 50 Hz",
            methods=_METHODS,
            rows=tuple(_combinations()),
            note=_TWO_SENSORS,
            noise_g=GX3_NOISE_G,
        ),
        Table(title="Not steps, said to be excluded (no table)", methods=_METHODS, rows=_NOT_STEPS),
    ),
    claims=tuple(_claims()),
    real=(
        Real(label="A, B in the hand", placement="hand(_using)?", activity="walk.*", claims=_WALKING),
        Real(label="C swinging in the hand", placement="hand_swinging", activity="walk.*", claims=_WALKING),
        Real(label="D pocket", placement=".*_pocket", activity="walk.*", claims=_WALKING),
        Real(label="E backpack", placement="backpack", activity="walk.*", claims=_WALKING),
        Real(label="F shoulder bag", placement="bag", activity="walk.*", claims=_WALKING),
        Real(label="C, run, on the wrist", placement="wrist", activity="run|jog", claims=_RUNNING),
        Real(label="phone handled, standing", placement=".*", activity=".*handling.*"),
    ),
    elapsed_s=CALCULATION_S,
)
