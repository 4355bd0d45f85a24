"""How far a count is from the truth: by number as the papers print it, and step by step where step times are known.

Error is counted minus true. Accuracy is the papers' (all four): 1 − |error|/true, in percent. A matched step is one
counted within TOLERANCE_S of a true one, one to one, after the recording's median offset is removed: a counter's
moment in the step (a peak, a heel strike) is its own, and the same all along. The blind metronome, as many ticks
evenly spread from the first true step to the last, shows how much of an F1 the mere number gives.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float64]

TOLERANCE_S: Final = 0.15
"""About a quarter of a step."""

SECONDS_PER_HOUR: Final = 3600.0


def accuracy_percent(counted: float, true: int) -> float:
    """Return 100 (1 − |error|/true); below 0 where more than twice the true steps are counted. `true` is above 0.

    >>> accuracy_percent(95, 100), accuracy_percent(105, 100), accuracy_percent(300, 100)
    (95.0, 95.0, -100.0)
    """
    return 100.0 - error_percent(counted, true)


def error_percent(counted: float, true: int) -> float:
    """Return 100 |error|/true. `true` is above 0.

    >>> error_percent(9, 12)
    25.0
    """
    return 100.0 * abs(counted - true) / true


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """Counted steps that are true (`tp`), counted ones that are not (`fp`), and true ones not counted (`fn`)."""

    tp: int
    fp: int
    fn: int

    @property
    def precision(self) -> float | None:
        """Share of the counted steps that are true; None where none were counted."""
        return self.tp / (self.tp + self.fp) if self.tp + self.fp else None

    @property
    def recall(self) -> float | None:
        """Share of the true steps that were counted; None where there are none."""
        return self.tp / (self.tp + self.fn) if self.tp + self.fn else None

    @property
    def f1(self) -> float | None:
        """Harmonic mean of both, 2 tp/(2 tp + fp + fn); None where there is no step at all."""
        steps = 2 * self.tp + self.fp + self.fn
        return 2 * self.tp / steps if steps else None


def match(counted_s: Times, true_s: Times, tolerance_s: float = TOLERANCE_S) -> Matches:
    """Match counted to true step times (both in s, rising) one to one, their median offset removed.

    >>> match(np.array([0.6, 1.1, 1.6, 2.3]), np.array([0.5, 1.0, 1.5]))
    Matches(tp=3, fp=1, fn=0)
    """
    tp = _pairs((counted_s - median_offset_s(counted_s, true_s)).tolist(), true_s.tolist(), tolerance_s)
    return Matches(tp=tp, fp=len(counted_s) - tp, fn=len(true_s) - tp)


def median_offset_s(counted_s: Times, true_s: Times) -> float:
    """Return the median of counted minus nearest true time, in s; 0 where one of them is empty.

    It is an offset that occurs (the lower of two middle ones): half a step off, some nearest steps lie before and some
    after, and a mean of both would be no offset at all.

    >>> median_offset_s(np.array([0.75, 1.25, 1.75]), np.array([0.625, 1.125, 1.75]))
    0.125
    """
    if not len(counted_s) or not len(true_s):
        return 0.0
    after = np.clip(np.searchsorted(true_s, counted_s), 1, max(len(true_s) - 1, 1))
    near = np.stack([true_s[after - 1], true_s[np.minimum(after, len(true_s) - 1)]])
    offsets = counted_s - near
    nearest = np.where(np.abs(offsets[0]) <= np.abs(offsets[1]), offsets[0], offsets[1])
    return float(np.sort(nearest)[(len(nearest) - 1) // 2])


def _pairs(counted_s: Sequence[float], true_s: Sequence[float], tolerance_s: float) -> int:
    """Return the most pairs that lie within the tolerance; taking the earliest that fits is never worse."""
    i = j = pairs = 0
    while i < len(counted_s) and j < len(true_s):
        if abs(counted_s[i] - true_s[j]) <= tolerance_s:
            i, j, pairs = i + 1, j + 1, pairs + 1
        elif counted_s[i] < true_s[j]:
            i += 1
        else:
            j += 1
    return pairs


def metronome_s(steps: int, true_s: Times) -> Times:
    """Return `steps` times evenly spread from the first true step to the last, in s.

    >>> metronome_s(3, np.array([1.0, 1.2, 5.0])).tolist()
    [1.0, 3.0, 5.0]
    """
    if not steps or not len(true_s):
        return np.empty(0)
    return np.linspace(true_s[0], true_s[-1], steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One recording's result: `true` steps None where unknown; matches None where the times are unknown."""

    counted: int
    true: int | None
    duration_s: float
    matches: Matches | None = None
    blind: Matches | None = None
    """Of the metronome with as many steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Results of several recordings; a figure is None where no recording has what it needs.

    `true`, `counted` and `error` sum the recordings that hold steps, and so do the percentages: `accuracy` and `mape`
    are means over recordings, `pooled_accuracy` is 1 − Σ|error|/Σtrue, `bias` is Σerror/Σtrue. `false` are the steps
    counted where there are none, `untold` those counted where the true number is unknown. Precision, recall and both F1
    are of all steps together.
    """

    recordings: int
    hours: float
    true: int | None
    counted: int | None
    false: int | None
    untold: int | None
    accuracy: float | None
    pooled_accuracy: float | None
    mape: float | None
    bias: float | None
    false_per_hour: float | None
    precision: float | None
    recall: float | None
    f1: float | None
    blind_f1: float | None

    @property
    def error(self) -> int | None:
        """Counted minus true steps."""
        return None if self.counted is None or self.true is None else self.counted - self.true


def summarise(scores: Iterable[Score]) -> Summary:
    """Summarise recordings.

    >>> walk = Score(counted=90, true=100, duration_s=60.0)
    >>> desk = Score(counted=6, true=0, duration_s=1800.0)
    >>> s = summarise([walk, desk])
    >>> s.error, s.accuracy, s.mape, s.bias, s.false, s.false_per_hour
    (-10, 90.0, 10.0, -10.0, 6, 12.0)
    """
    scores = list(scores)
    walks = [(s.counted, s.true) for s in scores if s.true]
    rests = [s for s in scores if s.true == 0]
    true, rest_s = sum(true for _, true in walks), sum(s.duration_s for s in rests)
    counted = sum(counted for counted, _ in walks)
    mape = _mean([error_percent(counted, true) for counted, true in walks])
    off = sum(abs(counted - true) for counted, true in walks)
    matched, blind = (_together([getattr(s, which) for s in scores]) for which in ("matches", "blind"))
    return Summary(
        recordings=len(scores),
        hours=sum(s.duration_s for s in scores) / SECONDS_PER_HOUR,
        true=true if walks else None,
        counted=counted if walks else None,
        false=_total([s.counted for s in rests]),
        untold=_total([s.counted for s in scores if s.true is None]),
        accuracy=None if mape is None else 100.0 - mape,
        pooled_accuracy=100.0 - 100.0 * off / true if walks else None,
        mape=mape,
        bias=100.0 * (counted - true) / true if walks else None,
        false_per_hour=sum(s.counted for s in rests) * SECONDS_PER_HOUR / rest_s if rest_s else None,
        precision=matched.precision,
        recall=matched.recall,
        f1=matched.f1,
        blind_f1=blind.f1,
    )


def _total(counts: Sequence[int]) -> int | None:
    return sum(counts) if counts else None


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _together(matches: Iterable[Matches | None]) -> Matches:
    found = [m for m in matches if m is not None]
    return Matches(tp=sum(m.tp for m in found), fp=sum(m.fp for m in found), fn=sum(m.fn for m in found))
