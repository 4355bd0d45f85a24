"""Accelerometer, gyroscope and magnetometer: after Khedr and El-Sheimy, Sensors 17(11) 2573, doi 10.3390/s17112573.

Second-order Butterworth low-pass, its cut-off one of five; norm a_n; three-point peaks and valleys by turns (3). Time
filter: with Δt₁ between the two events before (4), an event sooner than th_s = 0.5 Δt₁ after the last is rejected
(5)(6); for th_e = 0.3 Δt₂ a more extreme one replaces it (7)(8); then it is final. A final peak and valley are a pair:
pseudo zero crossing pzc_n = (peak + valley)/2 (9), Δa_n = peak − valley (10). Where Δa_n − Δa_{n−1} leaves ±su_th (11),
f̃ = ⌈F/(2 Δt)⌉ (12) picks filter f̃ and Δt₁ = F/(2 f̃). Where the device swings (variance), the gyroscope's main axis must
have an extremum of either sign near the peak, and the magnetometer's too, unless it is disturbed: its norm (13) moves
(14), or the gyroscope is periodic and it is not. A step that fails is suspect. Displacement d_n from peak to peak, the
double integral of the horizontal acceleration (16), must exceed 0.6 × the mean of the last three accepted (17)(18).

| parameter | paper | tuned | where the paper's value comes from |
| --- | --- | --- | --- |
| cutoff_margin_hz | 1 | 0.5 | the bank is not printed; ours: filter i passes i steps a second and this more |
| height_cm, sex | 170, unknown | 170, unknown | the document's to-do: the first Δt₁ and filter (`first_cadence_hz`) |
| reject_share, update_share | 0.5, 0.3 | 0.45, 0.2 | (5), (7) |
| half_limit | 100 (none) | 25 | ours: half a step at the pace of filter 1 |
| longest_half, longest_step | 50, 75 | 50, 90 | ours, so that a pause resets and latency has a bound |
| jump_g | 0.1 | 0.05 | su_th, "slightly above natural variation" |
| rest_g | 0 | 0.1 | no such threshold |
| swing_rad_s | 1 | 0.5 | not printed: ours |
| match_share | 0.25 | 0.25 | not printed: ours; a swing at half the step rate has one extremum a step |
| matching | near | turns | ours: the text says "matched" |
| periodicity, field_share | 0.5, 0.2 | 0.5, 0.1 | not printed: ours |
| irregular | pass | pass | ours; the to-do's periodicity as a check of its own |
| path | plain | plain | (16); `along` is the to-do's direction by least squares |
| distance_share | 0.6 | 0 | (17) |
| suspect_share, first_suspects | 0.6, pass | 0.2, fail | suspects are "left to the displacement check" |
| bout | 1 | 4 | no such rule |

Ours, where the text is silent or would break: the field is filtered like the rest. All five filters lag alike, as their
inputs wait for the slowest, so that a change of filter moves no extremum. th_e counts from the first candidate. A peak
not above the last pzc, or a valley not below it, is suspect (the text: pzc scores odd peaks). A half-step above
`longest_half` starts the time filter afresh, a step above `longest_step` after the last accepted one the walk: its
first three displacements pass again, else one long stride would reject all that follow. A step without a measured one
before it passes. Periodic: the main axis correlates with itself a step before, or with its mirror image. (1) and (2)
disagree in the sign of gravity and are not used; (15) is why a swing shows in the field, and no rule. Orientation is a
short filter of ours (`service.signals.orientation`), not the document's reference 47. After a gap only the filter in
force and a certain bout with its displacements last; the bout goes on if its steps lie less than 3 s apart. Of (9) only
the level is kept, not when the norm crosses it, a step's start and end: a count takes one instant a step, its peak. The
to-do's live rate estimate is the timebase's (`service.signals.timebase`).

`matching = turns`, ours: an arm or a thigh turns back at about heel strike, so the extrema of its rate lie half a step
from the norm's peaks, outside match_share, and `near` counts nothing of an even swing. But whatever the phase, the rate
changes sides once a step. So each peak wants a turn of its own, after the peak before and not later than match_share
after itself, or it is a bump and no step. The last three turns, if even, give the time of a step, which (5) and (12)
use instead of a half-step that a bump can spoil. And where a step's swing is the mirror image of the one before, its
extremum may lie anywhere.

On the dev recordings that have all three sensors, mean absolute percentage error, and of handling a phone false steps
an hour; of twelve synthetic wrists, slow, normal and fast, the accuracy; `tuned` with one choice taken back:

| | eth2023 | eth2022 | dcaiti | brajdic | handling | wrist |
| --- | --- | --- | --- | --- | --- | --- |
| paper | 54.4 | 46.3 | 11.8 | 22.4 | 4613 | 94.1 |
| paper, both shares 0 | 76.2 | 29.4 | 33.9 | 5.6 | 7551 | 82.3 |
| tuned | 7.0 | 15.6 | 1.7 | 3.3 | 367 | 97.0 |
| cutoff_margin_hz 1 | 15.0 | 15.0 | 2.9 | 4.0 | 564 | 98.3 |
| reject_share 0.5 | 12.5 | 19.9 | 2.6 | 4.3 | 248 | 97.2 |
| update_share 0.3 | 5.1 | 15.8 | 1.9 | 3.9 | 367 | 96.9 |
| half_limit 100 | 7.7 | 16.2 | 2.1 | 3.5 | 367 | 97.0 |
| longest_step 75 | 12.1 | 15.6 | 1.7 | 4.4 | 325 | 96.9 |
| jump_g 0.1 | 7.5 | 15.6 | 2.9 | 4.7 | 453 | 96.9 |
| rest_g 0 | 81.2 | 20.7 | 56.9 | 7.5 | 8995 | 86.8 |
| swing_rad_s 1 | 8.0 | 13.1 | 1.7 | 3.5 | 470 | 94.6 |
| matching near | 8.4 | 17.8 | 1.7 | 3.5 | 384 | 28.7 |
| field_share 0.2 | 7.0 | 15.6 | 1.6 | 3.3 | 367 | 97.0 |
| distance_share 0.6 | 32.0 | 27.3 | 22.8 | 22.4 | 248 | 93.9 |
| suspect_share 0.6 | 11.2 | 18.4 | 1.8 | 4.3 | 367 | 96.8 |
| first_suspects pass | 18.0 | 16.0 | 1.7 | 3.2 | 564 | 97.9 |
| bout 1 | 14.3 | 15.3 | 1.4 | 3.2 | 718 | 97.1 |
| irregular suspect | 24.7 | 31.4 | 1.6 | 3.3 | 282 | 96.7 |
| path along | 8.9 | 15.3 | 1.7 | 4.0 | 419 | 97.0 |
| no check of swings | 16.4 | 18.4 | 1.7 | 3.5 | 461 | 88.8 |

So 0.6 of the mean displacement rejects a fifth of real steps: left and right differ that much in a hand or on a wrist.
Left to the suspects, and mild, the check takes a third of the error of eth2023, where an arm moves much and walks
little. The cut-off and th_s decide whether a step's second bump counts, and at rest it is the missing threshold that
counts. Turns took the second bumps out of runs (eth2022: 35 for 32 steps, 54 before) and some steps out of walks with
an arm that does more than swing (42 for 60; long steps 27 for 48). Where the pace more than doubles at once and nothing
swings, th_s rejects every true half-step and every third extremum passes, until a pause. All values were chosen on
these 34 walks, so expect less of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import fusion_kernel as kernel
from service.counters import fusion_state as state
from service.counters.contract import choice, ordered, parameter
from service.counters.streaming import Events, Kernel, KernelCounter
from service.samples import GRID_HZ, SampleBlock, Sensor, Step

CADENCE_HZ: Final = {"male": 110.5 / 60, "female": 116.5 / 60, "unknown": 113.5 / 60}
"""Steps a second of men and women in the street as Finley and Cody, Arch. Phys. Med. Rehabil. 51 (1970) 423, are quoted
(the paper itself was not at hand), and their mean."""

STATURE_CM: Final = {"male": 176.0, "female": 163.0, "unknown": 169.5}
"""The stature we take them to have had."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionParams:
    """Parameters; the defaults are the paper's, or our reading of it."""

    cutoff_margin_hz: float = parameter(1.0, unit="Hz", low=0.5, high=4, text="cut-off of filter i is i Hz and this")
    height_cm: float = parameter(170.0, unit="cm", low=80, high=230, text="stature, for the first time thresholds")
    sex: str = choice("unknown", options=("unknown", "female", "male"), text="sex, for the first time thresholds")
    reject_share: float = parameter(0.5, unit="of Δt₁", low=0.1, high=0.9, text="a sooner extremum is rejected, th_s")
    update_share: float = parameter(0.3, unit="of Δt₂", low=0, high=0.5, text="how long another may replace it, th_e")
    half_limit: int = parameter(100, unit="samples", low=5, high=100, text="th_s takes a longer Δt₁ for this")
    longest_half: int = parameter(50, unit="samples", low=15, high=80, text="a longer half-step is a pause")
    longest_step: int = parameter(75, unit="samples", low=20, high=100, text="a longer step ends the walk")
    jump_g: float = parameter(0.1, unit="g", low=0.01, high=2, text="change of peak-to-valley that tunes anew, su_th")
    rest_g: float = parameter(0.0, unit="g", low=0, high=1, text="peak-to-valley up to this is rest")
    swing_rad_s: float = parameter(1.0, unit="rad/s", low=0, high=20, text="deviation above which the device swings")
    match_share: float = parameter(
        0.25, unit="of a step", low=0, high=0.5, text="how far a swing's extremum may be off"
    )
    matching: str = choice("near", options=("near", "turns"), text="which extremum of a swing is a step's")
    periodicity: float = parameter(0.5, unit="correlation", low=0, high=1, text="a swing is periodic from this on")
    field_share: float = parameter(0.2, unit="of the norm", low=0, high=1, text="the field moves more where disturbed")
    irregular: str = choice("pass", options=("pass", "suspect"), text="what a swing without a period makes of a step")
    path: str = choice("plain", options=("plain", "along"), text="displacement, or its part along the direction")
    distance_share: float = parameter(0.6, unit="of the mean", low=0, high=2, text="a step goes farther (17)")
    suspect_share: float = parameter(0.6, unit="of the mean", low=0, high=9, text="a suspect step goes farther")
    first_suspects: str = choice("pass", options=("pass", "fail"), text="what suspects among the first three do")
    bout: int = parameter(1, unit="steps", low=1, high=12, text="steps that make a walk certain; all of them count")

    def __post_init__(self) -> None:
        """Check that a half-step is shorter than a step; ParameterError names what contradicts what."""
        ordered(self, "longest_half", "longest_step")


PAPER: Final = FusionParams()
TUNED: Final = FusionParams(
    cutoff_margin_hz=0.5,
    reject_share=0.45,
    update_share=0.2,
    half_limit=25,
    longest_step=90,
    jump_g=0.05,
    rest_g=0.1,
    swing_rad_s=0.5,
    matching="turns",
    field_share=0.1,
    distance_share=0.0,
    suspect_share=0.2,
    first_suspects="fail",
    bout=4,
)


DISPERSION: Final = 0.11
"""Share by which a filter's delay at its cut-off exceeds the one far below it, which is taken and rounded."""


def build(params: FusionParams = TUNED) -> KernelCounter:
    """Return the fusion counter: blocks carry acceleration (g), angular rate (rad/s) and field (µT).

    >>> still = ([0.0] * 9, [0.0] * 9, [1.0] * 9)
    >>> build(TUNED).update(SampleBlock(start=0, acc_g=still, gyro_rad_s=still, mag_ut=still)).steps
    ()
    """
    delay = _bank_delay(params)
    return KernelCounter(
        "fusion",
        params,
        kernel=Kernel(
            begin=kernel.begin,
            scan=kernel.scan,
            close=kernel.close,
            stop=kernel.stop,
            likely=kernel.likely,
            next_index=state.NEXT,
            constants=state.CONSTANTS,
            row=state.ROW,
            delay=delay,
            time_error=0.5 + DISPERSION * delay,
            sensors=(Sensor.ACCELEROMETER, Sensor.GYROSCOPE, Sensor.MAGNETOMETER),
        ),
        state=_fresh_state(params),
        room=lambda n: n + state.ROW * (state.HELD_MAX + n // 2 + 2),
        events=lambda rows: _events(rows, delay),
        latency_s=_latency_s(params),
        version=2,
    )


def step_rows(block: SampleBlock, params: FusionParams = TUNED) -> NDArray[np.float64]:
    """Count a whole recording without making a Step of each: the way of `update` and `finish`, an order faster.

    Returns one row a step: grid index of the peak on the filtered norm, samples since the step before (0 none), peak,
    valley and pseudo zero crossing in g, displacement in m (0 not measured), and its direction: a line, in radians from
    magnetic north towards east, in (−π/2, π/2].
    """
    return build(params).count(block)


def first_cadence_hz(params: FusionParams) -> float:
    """Return the steps a second expected of a person before there are any.

    A sex's mean times √(mean stature / stature): step frequency × √stature is nearly constant after five years of age
    (Grieve and Gear, Ergonomics 9 (1966) 379, doi 10.1080/00140136608964399, for the highest frequency; ours for this).
    """
    return CADENCE_HZ[params.sex] * sqrt(STATURE_CM[params.sex] / params.height_cm)


def cutoffs_hz(params: FusionParams) -> tuple[float, ...]:
    """Return the five cut-offs of the bank."""
    return tuple(i + params.cutoff_margin_hz for i in range(1, state.FILTERS + 1))


def _delay_samples(cutoff_hz: float) -> int:
    """Return the lag of a second-order Butterworth low-pass far below its cut-off, √2/ω; at the cut-off 11 % more."""
    return round(sqrt(2.0) / (2.0 * pi * cutoff_hz) * GRID_HZ)


def _bank_delay(p: FusionParams) -> int:
    return _delay_samples(cutoffs_hz(p)[0])


def _filter_bank(p: FusionParams) -> list[float]:
    """Return the lag of its input, b₀, a₁ and a₂ of each filter, one after the other."""
    from scipy.signal import butter  # noqa: PLC0415  # slow to import, and only needed to build

    bank: list[float] = []
    for cutoff_hz in cutoffs_hz(p):
        b, a = butter(2, cutoff_hz, fs=GRID_HZ)
        bank += [float(_bank_delay(p) - _delay_samples(cutoff_hz)), float(b[0]), float(a[1]), float(a[2])]
    return bank


def _latency_s(p: FusionParams) -> float:
    """Return the longest time from a step to its confirmation.

    A peak waits for a valley at most `longest_half` later, that valley for th_e and for the sample after; the first of
    a bout also for the others, each less than `longest_step` after the last. A gap in the data comes on top.
    """
    pair = _bank_delay(p) + ceil((1.0 + p.update_share) * p.longest_half) + 1
    return (pair + (p.bout - 1) * p.longest_step) / GRID_HZ


def _fresh_state(p: FusionParams) -> list[float]:
    s = [0.0] * state.SIZE
    cadence_hz = first_cadence_hz(p)
    s[state.DELAY] = float(_bank_delay(p))
    s[state.REJECT], s[state.UPDATE] = p.reject_share, p.update_share
    s[state.PAUSE], s[state.MAX_STEP] = float(p.longest_half), float(p.longest_step)
    s[state.JUMP], s[state.REST] = p.jump_g, p.rest_g
    s[state.SWING] = p.swing_rad_s * p.swing_rad_s
    s[state.TOLERANCE], s[state.PERIODIC], s[state.FIELD] = p.match_share, p.periodicity, p.field_share
    s[state.IRREGULAR] = 1.0 if p.irregular == "suspect" else 0.0
    s[state.TURNS] = 1.0 if p.matching == "turns" else 0.0
    s[state.ALONG] = 1.0 if p.path == "along" else 0.0
    s[state.SHARE], s[state.SUSPECT_SHARE] = p.distance_share, p.suspect_share
    s[state.TRUST] = 1.0 if p.first_suspects == "pass" else 0.0
    s[state.BOUT] = float(p.bout)
    s[state.LATEST] = p.reject_share * p.half_limit
    s[state.FIRST_HALF] = GRID_HZ / (2.0 * cadence_hz)
    s[state.BANK : state.CONSTANTS] = _filter_bank(p)
    s[state.TUNED_TO] = float(min(ceil(cadence_hz), state.FILTERS))
    s[state.NEXT] = -1.0
    return s


def _events(rows: Sequence[float], delay: int) -> Events:
    steps = []
    for i in range(0, len(rows), state.ROW):
        at, spacing, peak, valley, crossing, _, _ = rows[i : i + state.ROW]
        steps.append(
            Step(
                at_s=(at - delay) / GRID_HZ,
                interval_s=spacing / GRID_HZ if spacing > 0.0 else None,
                strength=peak - valley,
                peak=peak,
                valley=valley,
                upper=crossing,
                lower=crossing,
            )
        )
    return tuple(steps), ()
