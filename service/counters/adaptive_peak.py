"""Adaptive peak detection: Chen, Li, Zhang, doi 10.13695/j.cnki.12-1222/o3.2015.03.007, section 1.3.

The norm a of the three axes, sampled at 50 Hz. A candidate is the greatest of a sliding window of 20 samples. By its
height the wearer is idle (below 1.2 g), walking (1.2 g to 2 g) or running (above 2 g); the gait gives how long after
the peak before it may come, and the neighbourhood of which it must be the greatest. "Two peaks in a row are one step":
the first of a bout is a reference only.

| parameter | paper | tuned | where the paper's value comes from |
| --- | --- | --- | --- |
| smoothing | 1 | 5 | none is applied |
| window | 20 | 20 | 1.3.3 step 1 |
| walk_g, run_g | 1.2, 2 | 1.12, 1.6 | 1.3.2: 99 % of 1,000 steps' greatest values; `tuned` looks at smoothed ones |
| walk_half, run_half | 10, 5 | 11, 5 | step 3 |
| walk_shortest_s, walk_longest_s | 0.3, 0.8 | 0.32, 1.0 | step 2 |
| run_shortest_s, run_longest_s | 0.2, 0.5 | 0.26, 0.8 | step 2 |
| bout, credit | 2, never | 5, retrospective | "two peaks in a row are one step" |

Ours, where the text is silent or would break. The peak before is the last that was counted or began a bout. Taken as
any candidate of the right height (the text's order: height, time, neighbourhood), a bump on the way up to a crest makes
the crest come too early: 45 % error on oxford_opt instead of 14. Taken as the last counted, a pause would end counting
for ever: a peak later than its gait's longest time is a new reference. One that comes too early changes nothing. Any
window of 20 that holds the candidate will do; it is a top, so it is not merely the end of a rise. Of equal samples the
first is the top; a crest flat for longer than the samples awaited after it is none. Windows lie inside their stretch:
no peak in its first and last half-neighbourhood. A certain bout goes on over a gap if its steps lie less than 3 s
apart.

On the dev recordings, mean absolute percentage error and false steps an hour; `tuned` with one choice taken back:

| | eth2023 | eth2022 | banglejs | pebble | oxford_opt | hmp | spar | driving, desk |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
| paper | 5.1 | 25.8 | 52.8 | 15.4 | 14.1 | 871 | 1741 | 15 |
| tuned | 1.7 | 5.1 | 9.8 | 8.3 | 4.5 | 901 | 1745 | 18 |
| smoothing 1 | 25.1 | 10.5 | 8.6 | 4.0 | 3.9 | 1470 | 2587 | 29 |
| walk_g 1.2 | 28.5 | 5.2 | 65.3 | 14.6 | 17.4 | 617 | 1181 | 0 |
| run_g 2 | 1.7 | 6.2 | 9.5 | 8.6 | 4.4 | 953 | 1951 | 18 |
| walk_longest_s 0.8 | 14.1 | 15.5 | 22.5 | 9.7 | 6.1 | 716 | 1184 | 11 |
| run_longest_s 0.5 | 3.6 | 45.3 | 10.0 | 40.6 | 22.8 | 690 | 1145 | 18 |
| credit never | 21.2 | 20.6 | 22.0 | 16.7 | 7.9 | 549 | 1140 | 4 |
| bout 2 | 20.6 | 5.1 | 8.2 | 6.4 | 3.6 | 1494 | 3136 | 129 |

So the paper's fixed 1.2 g is what loses weak wrists (banglejs), and its times lose a wrist that swings above the
running height while it walks. A least peak-to-valley was tried and left out: no value of it was an improvement. The
errors on eth2023 (eight recordings) hang on single bouts: expect less of others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from service.counters.contract import choice, ordered, parameter
from service.counters.streaming import KernelCounter
from service.counters.windowed_peak import Gait, Rules, check_spacing, counter


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptivePeakParams:
    """Parameters; the defaults are the paper's, or our reading of it."""

    smoothing: int = parameter(1, unit="samples", low=1, high=5, text="samples the norm is averaged over")
    window: int = parameter(20, unit="samples", low=11, high=32, text="a candidate is the greatest of such a window")
    walk_g: float = parameter(1.2, unit="g", low=0, high=4, text="a lower peak is idleness")
    run_g: float = parameter(2.0, unit="g", low=0, high=16, text="a higher peak is running")
    walk_half: int = parameter(10, unit="samples", low=2, high=20, text="neighbourhood on either side, walking")
    run_half: int = parameter(5, unit="samples", low=2, high=10, text="neighbourhood on either side, running")
    walk_shortest_s: float = parameter(0.3, unit="s", low=0.1, high=1, text="least time between steps, walking")
    walk_longest_s: float = parameter(0.8, unit="s", low=0.3, high=3, text="most time between steps, walking")
    run_shortest_s: float = parameter(0.2, unit="s", low=0.1, high=1, text="least time between steps, running")
    run_longest_s: float = parameter(0.5, unit="s", low=0.3, high=3, text="most time between steps, running")
    bout: int = parameter(2, unit="peaks", low=1, high=12, text="peaks that make a bout certain")
    credit: str = choice("never", options=("never", "retrospective"), text="whether the peaks before that count")

    def __post_init__(self) -> None:
        """Check that both gaits can be; ParameterError names what contradicts what."""
        ordered(self, "walk_g", "run_g")
        check_spacing(self, "walk_")
        check_spacing(self, "run_")


PAPER: Final = AdaptivePeakParams()
TUNED: Final = AdaptivePeakParams(
    smoothing=5,
    walk_g=1.12,
    run_g=1.6,
    walk_half=11,
    walk_shortest_s=0.32,
    walk_longest_s=1.0,
    run_shortest_s=0.26,
    run_longest_s=0.8,
    bout=5,
    credit="retrospective",
)


def build(params: AdaptivePeakParams = TUNED) -> KernelCounter:
    """Return adaptive peak detection as a streaming counter; its unit is g."""
    walk = Gait(
        least_g=params.walk_g,
        half=params.walk_half,
        shortest_s=params.walk_shortest_s,
        longest_s=params.walk_longest_s,
    )
    run = Gait(
        least_g=params.run_g, half=params.run_half, shortest_s=params.run_shortest_s, longest_s=params.run_longest_s
    )
    rules = Rules(
        smoothing=params.smoothing,
        window=params.window,
        split_g=params.run_g,
        walk=walk,
        run=run,
        bout=params.bout,
        credit=params.credit,
    )
    return counter("adaptive_peak", params, rules)
