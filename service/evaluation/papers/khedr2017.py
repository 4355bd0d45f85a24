"""Khedr, El-Sheimy 2017, Sensors 17(11) 2573, by the document on it: accelerometer, gyroscope and magnetometer.

Ten people by six poses by four gaits by 100 steps; accuracies in the text, no table. Neither poses nor gaits are listed
in our copy: it names typing, calling, swinging in the hand and pocket, and slow, fast and running; ours are these, two
bags and a normal walk. The worst case is read as the mean of its ten people. What the text calls low dynamic we take
for typing, calling and both bags, high dynamic for swinging and pocket. The document's author adds five runs of his
own. Not steps: shaking and rotating the phone on the spot, a magnetic disturbance; to stand: start and stop, run to
walk, sudden stop.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from service.evaluation.papers.conditions import Claim, Condition, Figures, Method, Paper, Real, Table, do, walk

WALKERS: Final = 10
STEPS: Final = 100
_FUSION: Final = Method(label="fusion", counter="fusion")

_POSES: Final = (
    ("typing", "flat", "low dynamic"),
    ("calling", "call", "low dynamic"),
    ("backpack", "backpack", "low dynamic"),
    ("shoulder bag", "bag", "low dynamic"),
    ("swinging in the hand", "swinging", "high dynamic"),
    ("pocket", "pocket", "high dynamic"),
)
_GAITS: Final = (("slow", "slow"), ("normal", "normal"), ("fast", "fast"), ("running", "run"))
_OWN: Final = (("run", 52, 52), ("run", 100, 101), ("run", 281, 283), ("normal", 50, 50), ("normal", 100, 101))


def _grid() -> Iterable[Condition]:
    for label, pose, dynamic in _POSES:
        for gait, activity in _GAITS:
            parts = (walk(activity, STEPS),)
            worst = {_FUSION.label: Figures(true=STEPS, accuracy=99.1)} if (label, gait) == ("typing", "slow") else {}
            name = f"{label}, {gait} ({dynamic})"
            yield Condition(label=name, parts=parts, pose=pose, walkers=WALKERS, published=worst)


def _own() -> Iterable[Condition]:
    for number, (activity, true, counted) in enumerate(_OWN, start=1):
        figures = Figures(true=true, counted=counted, accuracy=100 * (1 - abs(counted - true) / true))
        name = "running" if activity == "run" else "walking"
        published = {_FUSION.label: figures}
        yield Condition(label=f"{number} {name}", parts=(walk(activity, true),), pose="flat", published=published)


_CHANGES: Final = (
    Condition(label="run, then walk", parts=(walk("run", 100), walk("slow", 100)), pose="flat", walkers=5),
    Condition(label="start and stop", parts=(walk("normal", 10), do("rest", 5)) * 10, pose="flat", walkers=5),
    Condition(label="fast, then stop at once", parts=(walk("fast", 100), do("rest", 30)), pose="flat", walkers=5),
    Condition(
        label="swinging, past a magnet", parts=(walk("normal", 100),), pose="swinging", walkers=5, disturbed=True
    ),
)
_NOT_STEPS: Final = (
    Condition(label="shaking on the spot", parts=(do("rest", 5), do("shake", 30)), pose="flat", walkers=5),
    Condition(label="rotating on the spot", parts=(do("rest", 5), do("rotate", 30)), pose="flat", walkers=5),
    Condition(label="standing, past a magnet", parts=(do("rest", 60),), pose="flat", walkers=5, disturbed=True),
)


def _claims() -> Iterable[Claim]:
    for text, percent, about, rows in (
        ("mean over all: 99.6 %", 99.6, "all", ""),
        ("worst case, slow and typing: 99.1 %", 99.1, "slow, typing", "typing, slow"),
        ("low dynamic: 99.6 %", 99.6, "low dynamic", "low dynamic"),
        (
            "high dynamic: 99.47 % (beside it Fitbit Flex 2 98.31, Mi Band 2 98.02)",
            99.47,
            "high dynamic",
            "high dynamic",
        ),
    ):
        yield Claim(text=text, method=_FUSION.label, percent=percent, of="mean", tables=(1,), about=about, rows=rows)


PAPER: Final = Paper(
    name="khedr2017",
    title="A Smartphone Step Counter Using IMU and Magnetometer (Khedr, El-Sheimy), by a document on it",
    tables=(
        Table(title="Ten people, six poses, four gaits (text)", methods=(_FUSION,), rows=tuple(_grid())),
        Table(title="The document's own runs", methods=(_FUSION,), rows=tuple(_own())),
        Table(title="Changes of gait, a magnet (text)", methods=(_FUSION,), rows=_CHANGES),
        Table(title="Not steps (text)", methods=(_FUSION,), rows=_NOT_STEPS),
    ),
    claims=tuple(_claims()),
    real=(
        Real(label="walk, phone in the hand", placement="hand", activity="walk.*", claims={_FUSION.label: 99.6}),
        Real(
            label="walk, stairs, circles; phone in the hand", placement="hand_or_pocket.*", claims={_FUSION.label: 99.6}
        ),
        Real(
            label="walk, run and arm work mixed, wrist",
            placement="wrist",
            activity=".*mixed.*",
            claims={_FUSION.label: 99.47},
        ),
        Real(label="run, wrist", placement="wrist", activity="run|jog", claims={_FUSION.label: 99.47}),
        Real(
            label="stairs, wrist", placement="wrist", activity=".*(stairs|steps_down).*", claims={_FUSION.label: 99.47}
        ),
        Real(label="phone handled, standing", placement="hand", activity=".*handling.*"),
    ),
)
