"""What the three counters that judge a peak by the window around it share: their rules as a kernel counter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from service.counters import windowed_peak_kernel as kernel
from service.counters.contract import ordered
from service.counters.streaming import Kernel, KernelCounter
from service.errors import ParameterError
from service.samples import GRID_HZ, Band, Step

LONGEST_SMOOTHING: Final = 5
"""Samples of the longest mean."""

NO_CEILING_G: Final = 1e9
"""More than any sensor measures."""

_KERNEL: Final = Kernel(
    begin=kernel.begin,
    scan=kernel.scan,
    close=kernel.close,
    stop=kernel.stop,
    likely=kernel.likely,
    next_index=kernel.NEXT,
    constants=kernel.CONSTANTS,
    row=kernel.ROW,
    delay=0.0,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gait:
    """What a peak of one gait must be: its least height, its window to either side, its distance from the last."""

    least_g: float
    half: int
    shortest_s: float
    longest_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """What to do with the norm and its peaks; a peak above `split_g` belongs to `run`.

    A peak is the greatest of its gait's window and of some window of `window` samples, or, where `score_over` is set,
    the rises before it and the falls after it score more than that.
    """

    smoothing: int
    walk: Gait
    run: Gait
    split_g: float = NO_CEILING_G
    ceiling_g: float = NO_CEILING_G
    window: int = 1
    score_over: int | None = None
    rest_g: float = 0.0
    bout: int
    credit: str

    @property
    def delay(self) -> float:
        """By how many samples the smoothed norm lags."""
        return (self.smoothing - 1) / 2

    @property
    def latency_s(self) -> float:
        """The longest time from a step to its confirmation.

        A peak waits for the samples after it that its window needs; a credited one also for the bout's other peaks. A
        gap in the data comes on top.
        """
        gaits = (self.walk, self.run)
        wait = self.delay + max(max(gait.half, self.window - 1 - gait.half) for gait in gaits)
        if self.credit == "retrospective":
            wait += (self.bout - 1) * max(_samples(gait.longest_s) for gait in gaits)
        return wait / GRID_HZ


def check_spacing(params: object, gait: str = "") -> None:
    """Raise ParameterError where no two peaks of a gait can follow each other; its parameters' names begin with `gait`.

    Of two peaks nearer than `half` only one is the greatest of its neighbourhood.
    """
    ordered(params, f"{gait}shortest_s", f"{gait}longest_s", equal=True)
    longest_s, half = getattr(params, f"{gait}longest_s"), getattr(params, f"{gait}half")
    if _samples(longest_s) <= half:
        why = f"more than {gait}half, which is {half} samples ({half / GRID_HZ:g} s): no two peaks lie nearer"
        raise ParameterError(f"{gait}longest_s", longest_s, why)


def counter(name: str, params: object, rules: Rules) -> KernelCounter:
    """Return the counter `name` of these rules."""
    return KernelCounter(
        name,
        params,
        kernel=replace(_KERNEL, delay=rules.delay),
        state=_fresh_state(rules),
        room=_out_length,
        events=lambda rows: _events(rows, rules.delay),
        latency_s=rules.latency_s,
    )


def _samples(duration_s: float) -> int:
    return round(duration_s * GRID_HZ)


def _fresh_state(rules: Rules) -> list[float]:
    s = [0.0] * kernel.STATE
    for i in range(rules.smoothing):
        s[kernel.WEIGHTS + i] = 1.0 / rules.smoothing
    s[kernel.RULE] = kernel.GREATEST if rules.score_over is None else kernel.SCORE
    s[kernel.WINDOW] = float(rules.window)
    s[kernel.SCORE_OVER] = float(rules.score_over or 0)
    s[kernel.REST] = rules.rest_g
    s[kernel.SPLIT], s[kernel.CEILING] = rules.split_g, rules.ceiling_g
    s[kernel.BOUT] = float(rules.bout)
    s[kernel.CREDIT] = 1.0 if rules.credit == "retrospective" else 0.0
    for base, gait in ((kernel.WALK, rules.walk), (kernel.RUN, rules.run)):
        s[base + kernel.LEAST], s[base + kernel.HALF] = gait.least_g, float(gait.half)
        s[base + kernel.SHORTEST] = float(_samples(gait.shortest_s))
        s[base + kernel.LONGEST] = float(_samples(gait.longest_s))
    s[kernel.NEXT] = -1.0
    return s


def _out_length(n: int) -> int:
    """Floats that n samples and their rows may take: rows come of tops that wait, of new ones, and of a held bout."""
    return n + kernel.ROW * (kernel.QUEUE_MAX + kernel.HELD_MAX + n // 2 + 1)


def _events(rows: Sequence[float], delay: float) -> tuple[tuple[Step, ...], tuple[Band, ...]]:
    steps = tuple(_step(*rows[i : i + kernel.ROW], delay=delay) for i in range(0, len(rows), kernel.ROW))
    return steps, ()


def _step(at: float, spacing: float, peak: float, valley: float, threshold: float, *, delay: float) -> Step:
    return Step(
        at_s=(at - delay) / GRID_HZ,
        interval_s=spacing / GRID_HZ if spacing > 0.0 else None,
        strength=peak - valley,
        peak=peak,
        valley=valley,
        upper=threshold if threshold > 0.0 else None,
    )
