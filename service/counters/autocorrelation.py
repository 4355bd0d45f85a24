"""Autocorrelation: Chen, Li, Zhang, doi 10.13695/j.cnki.12-1222/o3.2015.03.007, section 1.2; Wang's (1)(2).

Steps repeat, other motion does not. Idle while the standard deviation of the norm over the current period is under 0.5
(m/s²; no unit is printed). Otherwise, with x the norm, μ and σ mean and standard deviation of t samples (Wang's
numbers; Chen's (3)(4) are the same),

    w(m, t) = Σ_{k<t} [x(m+k) − μ(m, t)] [x(m+k+t) − μ(m+t, t)] / (t σ(m, t) σ(m+t, t))      (1)
    ρ(m)    = max of w(m, t) over t_min ≤ t ≤ t_max                                          (2)

and the best t is the period; ρ above 0.7 is a step. Unfiltered: the trace is the norm itself, delay 0.

| parameter | paper | tuned | where the paper's value comes from |
| --- | --- | --- | --- |
| period | step | step | "a standard sine is a single step"; `STRIDE` is the other reading |
| t_min, t_max | 15, 50 | 16, 46 | not printed: ours, 1–3.3 steps/s |
| lock | 150, none | 3 | not printed; Zee's ±10 in `STRIDE` |
| idle | 0.5 | 0.8 | step ① |
| rho_min | 0.7 | 0.65 | step ② |
| hop | 5 | 5 | ours: every sample is the letter of it, five times the work and no better |
| patience | 100 | 75 | ours: how long period and bout outlast the last step |
| bout, credit | 1, never | 6, retrospective | one period that repeats the one before is one step |

`STRIDE` reads the period as Zee does, the paper's reference 10 (Rai et al., MobiCom 2012): 40–100 samples, two steps
each, ±10 once locked. It fits arm and pocket, where every second step is alike; a running stride is shorter than 40
samples and is then counted once in two, which is the paper's 50 %. It needs a t_min of 30 or more: among shorter lags
are steps, and each would count twice.

Ours, where the text is silent: (1) is causal, the newest sample ending the later of its two windows. A step is the
highest sample of its part of the period. The next period judged is centred on where the next steps should be, so a
drifting tempo neither skips nor doubles one; when it fails, one is judged every `hop` samples until it holds again. No
two steps of a bout lie nearer than 0.6 of a step's time. While no period is locked the current one, for idle, is as
long as t_max. `credit` "retrospective" also counts the earlier of the two periods that correlate after a failure, and
the steps before a bout was certain. Windows that vary by less than 1 µg correlate with nothing. After a gap a certain
bout goes on if its steps lie less than 3 s apart; a period that a gap or the end cuts short is no step.

On the dev recordings, mean absolute percentage error and false steps an hour; `tuned` with one choice taken back:

| | eth2023 | eth2022 | banglejs | pebble | oxford_opt | hmp | spar | driving, desk |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
| paper | 21.4 | 31.9 | 23.1 | 13.2 | 22.3 | 1695 | 3564 | 530 |
| paper, hop 1 | 29.1 | 30.2 | 22.4 | 11.2 | 19.1 | 1967 | 3978 | 571 |
| STRIDE | 15.4 | 31.3 | 10.1 | 7.9 | 9.1 | 706 | 3301 | 598 |
| tuned | 21.6 | 9.6 | 4.9 | 6.1 | 7.9 | 1282 | 3620 | 86 |
| t_max 50 | 22.2 | 14.0 | 16.6 | 7.6 | 8.3 | 1277 | 3608 | 85 |
| lock 150 | 23.2 | 28.8 | 13.0 | 6.1 | 8.8 | 1272 | 3658 | 91 |
| idle 0.5 | 34.6 | 8.9 | 4.0 | 5.9 | 7.9 | 1811 | 4435 | 321 |
| rho_min 0.7 | 13.5 | 11.2 | 5.2 | 8.6 | 8.6 | 1124 | 3101 | 79 |
| patience 100 | 12.4 | 13.5 | 7.0 | 6.4 | 7.3 | 1220 | 3547 | 95 |
| bout 2 | 34.0 | 9.6 | 4.0 | 5.7 | 6.4 | 1962 | 4155 | 353 |
| credit never | 38.0 | 39.8 | 24.0 | 25.6 | 18.1 | 558 | 1908 | 6 |

So the paper loses most where every second step is alike (the longer lag correlates better, half the steps count) and
before it is sure; the lock and the range help the first, retrospective credit the second, and bouts pay for it. Slower
than t_max (1.09 steps/s) `tuned` counts nothing, and rhythmic exercise (spar) remains: a repetition repeats as well as
a step. All values were chosen on these recordings, so expect less of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from service.counters import autocorrelation_kernel as kernel
from service.counters.contract import choice, ordered, parameter
from service.counters.streaming import Kernel, KernelCounter
from service.errors import ParameterError
from service.samples import GRID_HZ, Band, Step

GRAVITY_M_S2: Final = 9.80665

SHORTEST_STRIDE: Final = 30
"""Samples: 3⅓ steps a second, as t_min has it for a step."""

TOO_SHORT: Final = (
    f"what repeats in fewer than {SHORTEST_STRIDE} samples is one step, not two: Zee has t_min=40, t_max=100, lock=10"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AutocorrelationParams:
    """Parameters; the defaults are the paper's, or our reading of it."""

    period: str = choice("step", options=("step", "stride"), text="what the period is: one step, or two")
    t_min: int = parameter(15, unit="samples", low=10, high=60, text="shortest period")
    t_max: int = parameter(50, unit="samples", low=20, high=150, text="longest period")
    lock: int = parameter(150, unit="samples", low=1, high=150, text="how far a period may lie from the one before")
    idle: float = parameter(0.5, unit="m/s²", low=0.05, high=5, text="a smaller standard deviation is idle")
    rho_min: float = parameter(0.7, unit="", low=0.1, high=0.99, text="a period correlates better than this")
    hop: int = parameter(5, unit="samples", low=1, high=25, text="from one search for a period to the next")
    patience: int = parameter(100, unit="samples", low=50, high=500, text="a bout ends this long after its last step")
    bout: int = parameter(1, unit="steps", low=1, high=kernel.HELD_MAX, text="steps that make a bout certain")
    credit: str = choice("never", options=("never", "retrospective"), text="whether the steps before that count")

    def __post_init__(self) -> None:
        """Check that periods are what they are read as; ParameterError names what contradicts what."""
        ordered(self, "t_min", "t_max", equal=True)
        if self.period == "stride" and self.t_min < SHORTEST_STRIDE:
            raise ParameterError("period", self.period, f"t_min is {self.t_min}, and {TOO_SHORT}")
        spacing = -(-self.t_max // self.period_steps)
        if spacing > self.patience:
            why = f"its steps may lie {spacing} samples apart, and patience, which ends a bout, is {self.patience}"
            raise ParameterError("t_max", self.t_max, why)

    @property
    def period_steps(self) -> int:
        """Steps in a period."""
        return 2 if self.period == "stride" else 1


PAPER: Final = AutocorrelationParams()
TUNED: Final = AutocorrelationParams(
    t_min=16, t_max=46, lock=3, idle=0.8, rho_min=0.65, patience=75, bout=6, credit="retrospective"
)
STRIDE: Final = replace(PAPER, period="stride", t_min=40, t_max=100, lock=10)
"""The other reading of the paper: Zee's."""

_KERNEL: Final = Kernel(
    begin=kernel.begin,
    scan=kernel.scan,
    close=kernel.close,
    stop=kernel.stop,
    likely=kernel.likely,
    next_index=kernel.NEXT,
    constants=kernel.CONSTANTS,
    row=kernel.ROW,
    delay=0,
)


def build(params: AutocorrelationParams = TUNED) -> KernelCounter:
    """Return the autocorrelation counter; its unit is g.

    >>> build(PAPER).latency_s
    1.75
    """
    return KernelCounter(
        "autocorrelation",
        params,
        kernel=_KERNEL,
        state=_fresh_state(params),
        room=lambda n: _out_length(n, params),
        events=_events,
        latency_s=_latency_s(params),
    )


def _latency_s(p: AutocorrelationParams) -> float:
    """Return the longest time from a step to its confirmation.

    A period found off the rhythm lies up to 1¾ of its length back, one credited with it another; a bout's other steps
    lie at most `patience` apart. A gap in the data comes on top.
    """
    wait = 1.75 * p.t_max
    if p.credit == "retrospective":
        wait += p.t_max + (p.bout - 1) * p.patience
    return wait / GRID_HZ


def _fresh_state(p: AutocorrelationParams) -> list[float]:
    length = int(kernel.PERIODS * p.t_max)
    s = [0.0] * (kernel.RING + 2 * length)
    s[kernel.N] = float(p.period_steps)
    s[kernel.T_MIN], s[kernel.T_MAX] = float(p.t_min), float(p.t_max)
    s[kernel.LOCK] = float(p.lock)
    s[kernel.IDLE] = (p.idle / GRAVITY_M_S2) * (p.idle / GRAVITY_M_S2)
    s[kernel.RHO_MIN] = float(p.rho_min)
    s[kernel.HOP], s[kernel.PATIENCE] = float(p.hop), float(p.patience)
    s[kernel.BOUT] = float(p.bout)
    s[kernel.CREDIT] = 1.0 if p.credit == "retrospective" else 0.0
    s[kernel.LENGTH] = float(length)
    s[kernel.NEXT] = -1.0
    return s


def _out_length(n: int, p: AutocorrelationParams) -> int:
    """Floats that n samples and their rows may take: a step is another sample than the ones before, or held."""
    return n + kernel.ROW * (kernel.HELD_MAX + n + int(kernel.PERIODS * p.t_max))


def _events(rows: Sequence[float]) -> tuple[tuple[Step, ...], tuple[Band, ...]]:
    return tuple(_step(*rows[i : i + kernel.ROW]) for i in range(0, len(rows), kernel.ROW)), ()


def _step(at: float, spacing: float, peak: float, valley: float) -> Step:
    return Step(
        at_s=at / GRID_HZ,
        interval_s=spacing / GRID_HZ if spacing > 0.0 else None,
        strength=peak - valley,
        peak=peak,
        valley=valley,
    )
