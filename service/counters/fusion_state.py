"""The fusion counter's flat state: where its kernels keep what. Floats only, and samples are named by their grid index.

First the constants of an instance, then what changes; `fusion` says what the symbols mean.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import Final

from service.counters.fusion_checks import CHANNELS, DEPTH
from service.signals import orientation

# Constants of an instance.
DELAY: Final = 0  # samples by which the filtered signals lag
REJECT: Final = 1  # (5)
UPDATE: Final = 2  # (7)
PAUSE: Final = 3  # longest half-step
MAX_STEP: Final = 4  # longest step
JUMP: Final = 5  # su_th, g (11)
REST: Final = 6  # g
SWING: Final = 7  # (rad/s)², variance of the gyroscope's main axis above which the device swings
TOLERANCE: Final = 8  # of a step
PERIODIC: Final = 9
FIELD: Final = 10
IRREGULAR: Final = 11  # 1: a swing that is not periodic makes its step suspect
ALONG: Final = 12  # 1: displacement along the direction of least squares
SHARE: Final = 13  # (17)
SUSPECT_SHARE: Final = 14
TRUST: Final = 15  # 1: the first three pass even when suspect
BOUT: Final = 16
LATEST: Final = 17  # samples: th_s is never longer
FIRST_HALF: Final = 18  # samples: Δt₁ before there is one
TURNS: Final = 19  # 1: a swing's turns are matched one to one, and tell the step's time
BANK: Final = 20
"""Five filters of `FILTER` floats: lag of their input, b₀, a₁, a₂ (b₁ = 2 b₀, b₂ = b₀)."""
FILTER: Final = 4
FILTERS: Final = 5
CONSTANTS: Final = BANK + FILTERS * FILTER

# Belief: it outlasts a gap.
TUNED_TO: Final = CONSTANTS  # index of the filter in force
DELTA: Final = CONSTANTS + 1  # Δa_{n−1} (10); 0 unknown
D1: Final = CONSTANTS + 2  # the last three accepted displacements
D2: Final = CONSTANTS + 3
D3: Final = CONSTANTS + 4
MEASURED: Final = CONSTANTS + 5  # how many of them there are
BOUT_STEPS: Final = CONSTANTS + 6
ACCEPTED: Final = CONSTANTS + 7  # index of the last accepted peak; valid while BOUT_STEPS > 0

# The stretch: it ends with a gap.
FIRST: Final = CONSTANTS + 8
NEXT: Final = CONSTANTS + 9
A1: Final = CONSTANTS + 10  # the two norms before
A2: Final = CONSTANTS + 11
KIND: Final = CONSTANTS + 12  # of the last event: PEAK, VALLEY or 0
AT: Final = CONSTANTS + 13
VALUE: Final = CONSTANTS + 14
BEFORE: Final = CONSTANTS + 15  # index of the event before it
HALF: Final = CONSTANTS + 16  # Δt₁
DUE: Final = CONSTANTS + 17  # sample from which the last event is final; NEVER once it is
PEAK_AT: Final = CONSTANTS + 18  # a final peak that waits for its valley; −1 none
PEAK_VALUE: Final = CONSTANTS + 19
VALLEY_VALUE: Final = CONSTANTS + 20  # of the last final valley
CROSSING: Final = CONSTANTS + 21  # (9) of the last pair
PREVIOUS: Final = CONSTANTS + 22  # index of the last pair's peak; −1 none
BEFORE_LAST: Final = CONSTANTS + 23  # of the one before
MATCHED: Final = CONSTANTS + 24  # the turn of the swing that the last step was matched with
PERIOD: Final = CONSTANTS + 25  # samples a step takes by the swing, at the last pair; 0 unknown
ORIENTATION: Final = CONSTANTS + 26
Y1: Final = ORIENTATION + orientation.SIZE
"""The nine filtered columns, one and two samples ago."""
AXES: Final = 9
Y2: Final = Y1 + AXES
RAW: Final = Y2 + AXES
"""A ring of the last `LAGS` samples as they came."""
LAGS: Final = 16
HELD: Final = RAW + LAGS * AXES
"""Rows of the steps of a bout that is not certain yet."""
ROW: Final = 7
HELD_MAX: Final = 12
MOTION: Final = HELD + HELD_MAX * ROW
SIZE: Final = MOTION + DEPTH * CHANNELS

PEAK: Final = 1.0
VALLEY: Final = -1.0
NEVER: Final = 1e300
GRID_HZ: Final = 50.0
QUARTER: Final = 1.5707963267948966

BRIDGE: Final = 150.0
"""A bout goes on over a gap if the two steps around it lie less than 3 s apart."""

Floats = Sequence[float]
State = MutableSequence[float]
