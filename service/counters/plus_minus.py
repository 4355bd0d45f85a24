"""Plus-minus score, as section 1.2.2 of Wang, Peng, Zhou, doi 10.19734/j.issn.1001-3695.2018.11.0793, tells it.

Neighbouring samples are compared, and no amplitude is: on the left of a peak each pair that rises towards it scores +1
and any other −1, on the right each pair that falls +1 and any other −1. A fixed window whose sum is above a threshold
is a step.

| parameter | paper | tuned | where the paper's value comes from |
| --- | --- | --- | --- |
| smoothing | 1 | 5 | none is told |
| half | 8 | 11 | the window is not printed: ours, 17 samples |
| score_over | 4 | 4 | the threshold is not printed: ours, of 16 points |
| rest_g | 0 | 0.18 | there is none, to its cost |
| shortest_s | 0.34 | 0.34 | ours: the next window begins where this one ends |
| longest_s | 1 | 1.1 | there is none; it only says where a bout ends |
| bout, credit | 1, never | 6, retrospective | every window above the threshold is a step |

Ours. The window stands around a top of the norm (it rises to it and falls after it), so a step has a time. The sum runs
over all pairs left and right of that middle: scoring each sample of a window by its own two neighbours on either side
and adding up would cancel everywhere but at the window's ends. Of equal samples the first is the top. A window lies
inside its stretch. A certain bout goes on over a gap if its steps lie less than 3 s apart.

On the dev recordings, mean absolute percentage error and false steps an hour:

| | eth2023 | eth2022 | banglejs | pebble | oxford_opt | hmp | spar | driving, desk |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
| paper | 74.8 | 23.0 | 6.0 | 8.1 | 4.2 | 4683 | 5245 | 6129 |
| tuned | 12.1 | 20.0 | 14.4 | 4.6 | 2.8 | 957 | 2725 | 8 |

The paper's half and score_over were chosen there too, from 3 to 12 and 0.5 to 1.5 of `half`. Without an amplitude the
noise of a device at rest is full of steps; with one, and with bouts, it comes near the others. What stays is what the
paper says of it: a fixed window fails where cadence changes (eth2022 runs).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from service.counters.contract import choice, ordered, parameter
from service.counters.streaming import KernelCounter
from service.counters.windowed_peak import Gait, Rules, counter
from service.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class PlusMinusParams:
    """Parameters; the defaults are our reading of the paper, which prints none."""

    smoothing: int = parameter(1, unit="samples", low=1, high=5, text="samples the norm is averaged over")
    half: int = parameter(8, unit="pairs", low=3, high=20, text="pairs of samples scored on either side of a peak")
    score_over: int = parameter(4, unit="points", low=-40, high=39, text="a step's window scores more than this")
    rest_g: float = parameter(0.0, unit="g", low=0, high=2, text="smaller peak-to-valley in the window is rest")
    shortest_s: float = parameter(0.34, unit="s", low=0.1, high=1, text="least time between steps")
    longest_s: float = parameter(1.0, unit="s", low=0.3, high=3, text="most time between steps of one bout")
    bout: int = parameter(1, unit="peaks", low=1, high=12, text="peaks that make a bout certain")
    credit: str = choice("never", options=("never", "retrospective"), text="whether the peaks before that count")

    def __post_init__(self) -> None:
        """Check that some window can pass; ParameterError names what contradicts what."""
        ordered(self, "shortest_s", "longest_s", equal=True)
        if self.score_over >= 2 * self.half:
            why = f"less than the {2 * self.half} points of a whole window, whose half is {self.half} pairs"
            raise ParameterError("score_over", self.score_over, why)


PAPER: Final = PlusMinusParams()
TUNED: Final = PlusMinusParams(
    smoothing=5,
    half=11,
    rest_g=0.18,
    longest_s=1.1,
    bout=6,
    credit="retrospective",
)


def build(params: PlusMinusParams = TUNED) -> KernelCounter:
    """Return the plus-minus score as a streaming counter; its unit is g."""
    gait = Gait(least_g=0.0, half=params.half, shortest_s=params.shortest_s, longest_s=params.longest_s)
    rules = Rules(
        smoothing=params.smoothing,
        score_over=params.score_over,
        rest_g=params.rest_g,
        walk=gait,
        run=gait,
        bout=params.bout,
        credit=params.credit,
    )
    return counter("plus_minus", params, rules)
