"""From frames to steps: when a walk is certain, how many steps it has and when each was; scalar kernels on one state.

Each frame comes with z, the logit of walking, and c, the cadence. Frames above LOW wait, WAITING frames at most; once
one of those that wait is above HIGH, and they hold LEAST steps and EVIDENCE together, the walk is certain and all of
them are credited, as are those that follow, until more than POOL frames in a row are not above LOW. A frame credits c
times its length, less where the network doubts. A step is due whenever the sum passes a whole number, and is placed at
the crest of the magnitude nearest to where the crests before it were: the number comes from the cadence, the time from
the crest. A crest lies no more than a step after the moment the step was due, never before it, so that no step is
confirmed later than a frame and its answer.

State and rows are floats; samples are named by their grid index. Plain while live, else compiled; only what numba and
Python compute to the same bits is used: `+ − × ÷`, comparisons, `exp`, `ceil`, `floor`.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import ceil, exp, floor
from typing import Final

from service.counters.steplink_front import EVERY
from service.counters.steplink_network import DELAY, FRAME_ROWS
from service.counters.steplink_rhythm import FASTEST_HZ
from service.samples import GRID_HZ

FRAME: Final = FRAME_ROWS * EVERY
"""Grid samples a frame."""

# Constants of an instance.
LOW: Final = 0  # logit above which a frame may be walking
HIGH: Final = 1  # logit that makes a walk certain
FULL: Final = 2  # logit from which a frame credits all its steps
LEAST: Final = 3  # steps
POOL: Final = 4  # frames
WAITING: Final = 5  # frames that may wait
EVIDENCE: Final = 6  # sum of positive logits
CONSTANTS: Final = 7

# Belief: it outlasts a short gap.
WALKING: Final = 7  # 1: a walk is certain
BELOW: Final = 8  # frames in a row that were not above LOW
CADENCE: Final = 9  # Hz, of the last frame above LOW
PART: Final = 10  # of the next step, already credited
LAST: Final = 11  # index of the last step's crest; −1 none in this walk
OFFSET: Final = 12  # where crests lie after the moment a step is due, as a share of the step
SIZE_G: Final = 13  # a crest's height over the valley before it, lately

# The frames that wait.
WAIT: Final = 14  # how many
TOP: Final = 15  # their greatest logit
SUM: Final = 16  # their steps
PROOF: Final = 17  # the sum of their positive logits

# The stretch: it ends with a gap.
FIRST: Final = 18  # index of its first sample
NEXT: Final = 19  # index of the sample to come; −1 before the first stretch and after the last
Z: Final = 20  # logit of the newest frame decided
DECIDED: Final = 21  # index after the last sample of that frame
MOVED: Final = 22  # how far the magnitude ranged in it, g
TOLD: Final = (DECIDED, Z, MOVED, WALKING, CADENCE, WAIT)
"""What is told of walking after every packet."""
HELD: Final = 23
"""Frames that wait: index, samples, cadence, share, logit."""
HELD_ROW: Final = 5
HELD_MAX: Final = 26
RING: Final = HELD + HELD_ROW * HELD_MAX
"""The magnitude of the last LENGTH samples."""
LENGTH: Final = 1024
SIZE: Final = RING + LENGTH

ROW: Final = 4
"""A step: index of its crest, samples since the step before or 0, crest, valley."""

BRIDGE: Final = 3 * GRID_HZ
"""A walk goes on over a gap that is no longer, samples."""
NEAREST: Final = 0.4
"""Crests of two steps are at least this share of a step apart."""
FOLLOW: Final = 0.25
"""How far the offset follows each crest."""

State = MutableSequence[float]
Floats = Sequence[float]


def begin(s: State, index: float) -> None:
    """Open a stretch whose first sample has this grid index."""
    if index - s[NEXT] > BRIDGE or s[NEXT] < 0.0:
        end(s)
    s[FIRST] = s[NEXT] = s[DECIDED] = index
    s[MOVED] = 0.0
    s[Z] = -9.0
    s[WAIT] = s[SUM] = s[PROOF] = 0.0
    s[TOP] = -99.0


def end(s: State) -> None:
    """End the walk."""
    s[WALKING] = s[BELOW] = s[CADENCE] = s[PART] = s[SIZE_G] = 0.0
    s[LAST] = -1.0
    s[OFFSET] = 0.5


def room(n: int, waiting: float) -> int:
    """Return how many floats the rows of n samples may take, and of what was not judged or waits."""
    return ROW * int((n + (waiting + DELAY + 2) * FRAME) * FASTEST_HZ / GRID_HZ + 2)


def advance(s: State, trace: Floats, n: int, z: Floats, c: Floats, out: State) -> int:
    """Take n magnitudes and the answers that they complete; write the steps' rows, return where they end."""
    rows = answer = 0
    index = int(s[NEXT])
    first = int(s[FIRST])
    full = FRAME - (index - first) % FRAME
    for i in range(n):
        s[RING + index % LENGTH] = trace[i]
        index += 1
        full -= 1
        if full == 0:
            full = FRAME
            at = index - FRAME * (DELAY + 1)
            s[NEXT] = float(index)
            if at >= first:
                rows = frame(s, at, FRAME, z[answer], c[answer], out, rows)
            answer += 1
    s[NEXT] = float(index)
    return rows


def frame(s: State, at: int, n: int, z: float, c: float, out: State, rows: int) -> int:
    """Take the answer to the frame of n samples from index `at` on."""
    s[Z] = z
    s[DECIDED] = float(at + n)
    s[MOVED] = _range(s, at, at + n)
    if z > s[LOW]:
        s[BELOW] = 0.0
        s[CADENCE] = c
        share = _share(s, z)
        if s[WALKING] > 0.0:
            return _credit(s, at, n, c, share, out, rows)
        _hold(s, at, n, z, c, share)
        if s[TOP] > s[HIGH] and s[SUM] >= s[LEAST] and s[PROOF] >= s[EVIDENCE]:
            end(s)
            s[WALKING] = 1.0
            s[CADENCE] = c
            s[PART] = 0.5
            for i in range(int(s[WAIT])):
                k = HELD + i * HELD_ROW
                rows = _credit(s, int(s[k]), int(s[k + 1]), s[k + 2], s[k + 3], out, rows)
            _drop(s)
        return rows
    s[BELOW] += 1.0
    if s[BELOW] > s[POOL]:
        if s[WALKING] > 0.0:
            end(s)
        _drop(s)
    return rows


def _share(s: State, z: float) -> float:
    """Return how much of its steps a frame credits: half where it is just above LOW."""
    if z >= s[FULL]:
        return 1.0
    low, now, full = 1.0 / (1.0 + exp(-s[LOW])), 1.0 / (1.0 + exp(-z)), 1.0 / (1.0 + exp(-s[FULL]))
    return 0.5 + 0.5 * (now - low) / (full - low)


def _hold(s: State, at: int, n: int, z: float, c: float, share: float) -> None:
    """Let a frame wait; those that have waited too long count no more, neither their steps nor what they proved."""
    count = int(s[WAIT])
    while count > 0 and at - s[HELD] > s[WAITING] * FRAME:
        for i in range(HELD, HELD + (count - 1) * HELD_ROW):
            s[i] = s[i + HELD_ROW]
        count -= 1
    k = HELD + count * HELD_ROW
    s[k], s[k + 1], s[k + 2], s[k + 3], s[k + 4] = float(at), float(n), c, share, z
    _drop(s)
    s[WAIT] = float(count + 1)
    for k in range(HELD, HELD + (count + 1) * HELD_ROW, HELD_ROW):
        s[SUM] += s[k + 2] * s[k + 1] / GRID_HZ * s[k + 3]
        s[TOP] = max(s[TOP], s[k + 4])
        s[PROOF] += max(s[k + 4], 0.0)


def _drop(s: State) -> None:
    s[WAIT] = s[SUM] = s[PROOF] = 0.0
    s[TOP] = -99.0


def _credit(s: State, at: int, n: int, c: float, share: float, out: State, rows: int) -> int:
    """Credit the steps of a frame: a row for each that falls due in it."""
    amount = c * n / GRID_HZ * share
    part = s[PART]
    total = part + amount
    due = 1.0
    while total >= due:
        rows = _step(s, at + n * (due - part) / amount, GRID_HZ / c, out, rows)
        due += 1.0
    s[PART] = total - (due - 1.0)
    return rows


def _step(s: State, due: float, period: float, out: State, rows: int) -> int:
    """Place the step that was due at `due` and write its row."""
    seen = int(s[NEXT])
    at = _crest(s, due, period, s[OFFSET], s[LAST], seen)
    if at >= seen:
        return rows
    _follow(s, at, due, period)
    last = int(s[LAST])
    low = _lowest(s, max(last, at - int(period), int(s[FIRST])), at)
    height = s[RING + at % LENGTH]
    s[SIZE_G] += (1.0 if last < 0 else FOLLOW) * (height - low - s[SIZE_G])
    out[rows] = float(at)
    out[rows + 1] = float(at - last) if last >= 0 else 0.0
    out[rows + 2] = height
    out[rows + 3] = low
    s[LAST] = float(at)
    return rows + ROW


def _follow(s: State, at: int, due: float, period: float) -> None:
    """Follow the crests: the number of steps stays the cadence's, so where they drift by a whole step one is passed."""
    offset = s[OFFSET]
    offset += FOLLOW * ((at - due) / period - offset)
    s[OFFSET] = offset - floor(offset)


def _crest(s: State, due: float, period: float, offset: float, last: float, seen: int) -> int:
    """Return the highest sample near where the step due at `due` is expected; `seen` or more where there is none."""
    centre = due + offset * period
    from_ = ceil(max(due, centre - 0.5 * period, s[FIRST] + 2.0))
    if last >= 0.0:
        from_ = max(from_, int(last) + 1 + int(NEAREST * period))
    to = min(int(centre + 0.5 * period), seen - 1)
    at = from_
    best = s[RING + at % LENGTH]
    for i in range(from_ + 1, to + 1):
        value = s[RING + i % LENGTH]
        if value > best:
            best, at = value, i
    return at


def _lowest(s: State, from_: int, to: int) -> float:
    low = s[RING + to % LENGTH]
    for i in range(from_, to):
        value = s[RING + i % LENGTH]
        low = min(low, value)
    return low


def _range(s: State, from_: int, to: int) -> float:
    low = high = s[RING + from_ % LENGTH]
    for i in range(from_ + 1, to):
        value = s[RING + i % LENGTH]
        low = min(low, value)
        high = max(high, value)
    return high - low
