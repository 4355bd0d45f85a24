"""Jayalath, Abhayasinghe, Murray 2013: one gyroscope axis in a tight trouser pocket, by zero crossing.

Ten people. Table I is one of them; Table II an activity, Table III a rate of stepping on flat land (half a minute
each), with mean and variance of true and counted steps, and mean, variance, minimum and maximum of accuracy. Of the
same rates on stairs (11 steps) the text gives two least means. The numbers of steps are the tables' own means. Not
steps, by the authors' own word counted: pocketing and taking out the phone. The calibration walk is ours to lay out:
60 steps at 50 a minute, each walker's slowest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from service.evaluation.papers.conditions import Claim, Condition, Figures, Method, Paper, Real, Table, do, walk
from service.samples import SampleBlock

WALKERS: Final = 10
_GYRO: Final = Method(label="zero crossing", counter="gyro_zero_crossing")

_ONE: Final = (
    ("Walking slowly on flat land", "slow", 55, 27, 26),
    ("Walking faster on flat land", "fast", 110, 49, 49),
    ("Walking up stairs", "stairs_up", 90, 11, 11),
    ("Walking down stairs", "stairs_down", 90, 11, 11),
    ("Walking up hills", "uphill", 100, 40, 40),
    ("Walking down hills", "downhill", 100, 43, 41),
)
"""Table I: activity, ours of that name, steps a minute (ours within the paper's bounds), true, counted."""

_ACTIVITIES: Final = (
    ("Walking slowly on flat lands (<60/min)", "slow", 55, 28.50, 2.45, 27.60, 2.64, 96.82, 1.16, 96.00, 100.00),
    ("Walking faster on flat lands (>100/min)", "fast", 110, 49.10, 1.29, 48.50, 0.65, 98.80, 1.73, 96.08, 100.00),
    ("Climbing up stairs", "stairs_up", 90, 11.00, 0.00, 10.70, 0.21, 97.27, 17.36, 90.91, 100.00),
    ("Climbing down stairs", "stairs_down", 90, 11.00, 0.00, 10.40, 0.24, 94.55, 19.83, 90.91, 100.00),
    ("Walking on inclined plane (up)", "uphill", 100, 43.30, 2.01, 42.50, 1.45, 98.18, 1.87, 95.45, 100.00),
    ("Walking on inclined planes (down)", "downhill", 100, 42.20, 1.36, 41.00, 1.20, 97.17, 2.02, 95.24, 100.00),
)
"""Table II: activity, ours of that name, steps a minute, then its eight columns."""

_RATES: Final = (
    ("50 steps/min", "slow", 50, 25.90, 1.09, 25.50, 0.85, 98.49, 3.43, 96.00, 100.00),
    ("75 steps/min", "slow", 75, 37.80, 0.96, 37.00, 1.20, 97.89, 2.58, 94.59, 100.00),
    ("100 steps/min", "normal", 100, 51.00, 1.00, 49.90, 1.29, 97.85, 1.89, 96.00, 100.00),
    ("125 steps/min", "fast", 125, 62.50, 0.65, 62.00, 0.40, 99.21, 0.63, 98.39, 100.00),
    ("150 steps/min", "fast", 150, 74.50, 0.65, 73.90, 1.69, 98.92, 0.66, 97.26, 100.00),
)
"""Table III: rate, ours of that name, steps a minute, then its eight columns."""


def _one() -> Iterable[Condition]:
    for label, activity, spm, true, counted in _ONE:
        figures = Figures(true=true, counted=counted, accuracy=100 * counted / true)
        parts = (walk(activity, true, spm),)
        yield Condition(label=label, parts=parts, pose="pocket", published={_GYRO.label: figures})


def _many(
    rows: Iterable[tuple[str, str, float, float, float, float, float, float, float, float, float]],
) -> Iterable[Condition]:
    for label, activity, spm, *columns in rows:
        true, true_var, counted, counted_var, accuracy, accuracy_var, low, high = columns
        figures = Figures(
            true=true,
            counted=counted,
            accuracy=accuracy,
            true_var=true_var,
            counted_var=counted_var,
            accuracy_var=accuracy_var,
            low=low,
            high=high,
        )
        parts = (walk(activity, round(true), spm),)
        published = {_GYRO.label: figures}
        yield Condition(label=label, parts=parts, pose="pocket", walkers=WALKERS, published=published)


def _stairs() -> Iterable[Condition]:
    """Lay out the second series on stairs; the text gives the least means, at 75 and 125 up, at 50 and 125 down."""
    least = {
        ("stairs_up", 75): 96.36,
        ("stairs_up", 125): 96.36,
        ("stairs_down", 50): 95.45,
        ("stairs_down", 125): 95.45,
    }
    for activity, label in (("stairs_up", "up stairs"), ("stairs_down", "down stairs")):
        for spm in (50, 75, 100, 125, 150):
            known = {_GYRO.label: Figures(true=11, accuracy=least[activity, spm])} if (activity, spm) in least else {}
            parts = (walk(activity, 11, spm),)
            yield Condition(label=f"{label}, {spm}/min", parts=parts, pose="pocket", walkers=WALKERS, published=known)


def _least() -> Iterable[Claim]:
    """Yield what the text says of the worst: of a walker, or (stairs at a rate) of the mean of ten."""
    for text, percent, of, table, about, rows in (
        ("flat land, least walker at any rate: 94.59 %", 94.59, "least", 3, "flat land, least walker", ""),
        ("slopes, least walker: 95 %", 95.0, "least", 2, "slopes, least walker", "inclined"),
        ("stairs, least walker: 90 %", 90.0, "least", 2, "stairs, least walker", "stairs"),
        ("up stairs, least mean of a rate: 96.36 %", 96.36, "least mean", 4, "up stairs, any rate", "up stairs"),
        ("down stairs, least mean of a rate: 95.45 %", 95.45, "least mean", 4, "down stairs, any rate", "down stairs"),
    ):
        yield Claim(text=text, method=_GYRO.label, percent=percent, of=of, tables=(table,), about=about, rows=rows)


_NOT_STEPS: Final = (
    Condition(label="standing still for a minute", parts=(do("rest", 60),), pose="pocket", walkers=WALKERS),
    Condition(label="getting up, sitting down", parts=(do("stand", 8), do("sit", 8)), pose="pocket", walkers=WALKERS),
    Condition(label="phone turned in the hand", parts=(do("rotate", 20),), pose="pocket", walkers=WALKERS),
)


def _thresholds(_: SampleBlock, slowest: SampleBlock | None, params: Any) -> Mapping[str, Any]:  # noqa: ANN401
    from service.counters.gyro_zero_crossing import calibrated  # noqa: PLC0415  # only where it is counted

    learnt = params if slowest is None else calibrated(slowest, params)
    return {"peak_rad_s": learnt.peak_rad_s, "valley_rad_s": learnt.valley_rad_s}


PAPER: Final = Paper(
    name="jayalath2013",
    title="A Gyroscope Based Accurate Pedometer Algorithm (Jayalath, Abhayasinghe, Murray)",
    tables=(
        Table(title="Table I. Sample results of one subject", methods=(_GYRO,), rows=tuple(_one())),
        Table(title="Table II. Different activities", methods=(_GYRO,), rows=tuple(_many(_ACTIVITIES))),
        Table(title="Table III. Flat land, different stepping rates", methods=(_GYRO,), rows=tuple(_many(_RATES))),
        Table(title="Stairs, different stepping rates (text)", methods=(_GYRO,), rows=tuple(_stairs())),
        Table(title="Not steps (no table; counted, by the authors' word)", methods=(_GYRO,), rows=_NOT_STEPS),
    ),
    claims=(
        Claim(
            text="flat land, however slow: 96 % and more",
            method=_GYRO.label,
            percent=96,
            of="least mean",
            tables=(3,),
            about="flat land",
        ),
        *_least(),
    ),
    real=(
        Real(label="walk, stairs, circles; phone in the hand", placement="hand_or_pocket.*", claims={_GYRO.label: 96}),
        Real(label="walk, phone in the hand", placement="hand", activity="walk.*", claims={_GYRO.label: 96}),
        Real(label="walk, band on the wrist", placement="wrist", activity="walk.*", claims={_GYRO.label: 96}),
        Real(label="phone handled, standing", placement="hand", activity=".*handling.*"),
        Real(label="arm exercises", placement="wrist", activity="shoulder.*"),
    ),
    calibration=Condition(label="slowest walk", parts=(walk("slow", 60, 50),), pose="pocket"),
    prepare=_thresholds,
)
