"""Peaks judged by the window around them, as scalar kernels over one flat state; plain while live, else compiled.

`adaptive_peak`, `conventional_peak` and `plus_minus` say what this computes and why. A top of the smoothed norm (it
rises to it and falls after it) waits in a queue until the samples after it that its window needs are there; then it is
judged: it is the greatest of its window (`GREATEST`), or the window's score is high enough (`SCORE`). What passes goes
through amplitude, spacing and bout. A window lies inside its stretch, so nothing waits beyond the stretch's end.

The state `s` holds floats only: first the constants of an instance, then what changes. Samples are named by their grid
index. A row is a step: (index, spacing or 0, peak, valley, amplitude threshold passed).
Only what numba and Python compute to the same bits is used: `+ − × ÷`, comparisons and `sqrt`.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import sqrt
from typing import Final

# Constants of an instance.
WEIGHTS: Final = 0  # five, of the newest sample and the four before
RULE: Final = 5
WINDOW: Final = 6  # samples of the sliding window of a candidate, GREATEST
SCORE_OVER: Final = 7  # threshold of the score, SCORE
REST: Final = 8  # g; less between peak and valley is rest
SPLIT: Final = 9  # g; a peak above it is running
CEILING: Final = 10  # g; a peak above it is none
BOUT: Final = 11  # peaks that make a bout certain
CREDIT: Final = 12  # 1: the peaks before it was certain count too
WALK: Final = 13
RUN: Final = 17
CONSTANTS: Final = 21

# Of a gait, from WALK or RUN on.
LEAST: Final = 0  # g; a peak below it is none
HALF: Final = 1  # samples on either side of a peak that its window spans
SHORTEST: Final = 2  # spacing of steps in samples
LONGEST: Final = 3

GREATEST: Final = 0.0
SCORE: Final = 1.0

# The bout: once certain it outlasts a short gap.
PEAKS: Final = 21  # in this bout so far
LAST: Final = 22  # index of its last one

# The stretch: it ends with a gap.
FIRST: Final = 23  # index of its first sample
NEXT: Final = 24  # index of the sample to come; −1 before the first stretch and after the last
M1: Final = 25  # the four norms before
M2: Final = 26
M3: Final = 27
M4: Final = 28
SMOOTHED: Final = 29  # the sample before
RISE_AT: Final = 30  # index of the last rise; −1 since a fall
COUNT: Final = 31  # tops in the queue
DUE: Final = 32  # when the oldest is judged; −1 none waits

HELD: Final = 33
"""Rows of `HELD_MAX` peaks of a bout that is not certain yet."""

ROW: Final = 5
HELD_MAX: Final = 12

QUEUE: Final = HELD + HELD_MAX * ROW
"""Tops that wait, oldest first, `ENTRY` floats each; those of GREATEST fall in height."""

AT: Final = 0
VALUE: Final = 1
LEFT: Final = 2  # the score of the samples before it
JUDGE_AT: Final = 3
ENTRY: Final = 4
QUEUE_MAX: Final = 20  # tops lie two samples apart and wait for at most LONGEST_WINDOW

LONGEST_WINDOW: Final = 32
LONGEST_HALF: Final = 20

RING: Final = QUEUE + QUEUE_MAX * ENTRY
"""The last `RING_SIZE` smoothed samples, sample k at k mod RING_SIZE: a window on both sides of a top fits."""

RING_SIZE: Final = 64
STATE: Final = RING + RING_SIZE

BRIDGE: Final = 150.0
"""A bout goes on over a gap if the two steps around it lie less than 3 s apart."""

Floats = Sequence[float]
State = MutableSequence[float]


def begin(s: State, index: int, x: float, y: float, z: float) -> None:
    """Open a stretch at grid index `index`, whose norm stands for those before it; only a certain bout goes on."""
    m = sqrt(x * x + y * y + z * z)
    if s[PEAKS] < s[BOUT]:
        s[PEAKS] = 0.0
    s[M1] = s[M2] = s[M3] = s[M4] = m
    s[SMOOTHED] = s[0] * m + s[1] * m + s[2] * m + s[3] * m + s[4] * m
    s[FIRST] = s[NEXT] = float(index)
    s[RISE_AT] = s[DUE] = -1.0
    s[COUNT] = 0.0


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> int:
    """Eat n samples (g); write the smoothed norm to `out[:n]` and rows after it; return where the rows end."""
    w0, w1, w2, w3, w4 = s[0], s[1], s[2], s[3], s[4]
    m1, m2, m3, m4 = s[M1], s[M2], s[M3], s[M4]
    last, rise_at, due, k, rows = s[SMOOTHED], s[RISE_AT], s[DUE], s[NEXT], n
    place = int(k) % RING_SIZE
    for i in range(n):
        a, b, c = x[i], y[i], z[i]
        m = sqrt(a * a + b * b + c * c)
        value = w0 * m + w1 * m1 + w2 * m2 + w3 * m3 + w4 * m4
        m1, m2, m3, m4 = m, m1, m2, m3
        out[i] = value
        s[RING + place] = value
        place += 1
        if place == RING_SIZE:
            place = 0
        if value > last:
            rise_at = k
        elif value < last and rise_at >= 0.0:
            _top(s, rise_at, last, k)
            rise_at, due = -1.0, s[DUE]
        if k == due:
            rows = _judge(s, k, value, out, rows)
            due = s[DUE]
        last = value
        k += 1.0
    s[M1], s[M2], s[M3], s[M4] = m1, m2, m3, m4
    s[SMOOTHED], s[RISE_AT], s[NEXT] = last, rise_at, k
    return rows


def close(s: State, _out: State) -> int:
    """End the stretch: a top whose window is not complete is none."""
    s[COUNT] = 0.0
    s[DUE] = -1.0
    return 0


def stop(s: State) -> None:
    """End the stream: an uncertain bout is dropped."""
    s[NEXT] = -1.0
    s[PEAKS] = 0.0


def pending(s: State) -> int:
    """Return how many peaks are likely to become steps."""
    return len(likely(s))


def likely(s: State) -> list[tuple[float, float]]:
    """Return index and height of the peaks that are likely to become steps.

    Those are the held ones of a bout that is not certain yet, and waiting tops that are not too near the last one.
    """
    found: list[tuple[float, float]] = []
    peaks, credit = s[PEAKS], s[CREDIT] > 0.0
    if credit and peaks < s[BOUT] and s[NEXT] - s[LAST] <= max(s[WALK + LONGEST], s[RUN + LONGEST]):
        found += [(s[row], s[row + 2] - s[row + 3]) for row in range(HELD, HELD + int(peaks) * ROW, ROW)]
    for q in range(QUEUE, QUEUE + int(s[COUNT]) * ENTRY, ENTRY):
        at, gait = s[q + AT], _gait(s, s[q + VALUE])
        spacing = at - s[LAST]
        begins = peaks == 0.0 or spacing > s[gait + LONGEST]
        if credit if begins else spacing >= s[gait + SHORTEST] and (credit or peaks + 1.0 >= s[BOUT]):
            found.append((at, s[q + VALUE] - _lowest(s, at - s[gait + HALF], int(s[gait + HALF]))))
    return found


def _gait(s: State, value: float) -> int:
    return WALK if value <= s[SPLIT] else RUN


def _top(s: State, at: float, value: float, now: float) -> None:
    """Let a top wait for the samples after it, if amplitude and the samples before it allow."""
    count = int(s[COUNT])
    if s[RULE] == GREATEST:
        while count > 0 and s[QUEUE + (count - 1) * ENTRY + VALUE] < value:
            count -= 1
        s[COUNT] = float(count)
        s[DUE] = s[QUEUE + JUDGE_AT] if count > 0 else -1.0
    gait = _gait(s, value)
    half = s[gait + HALF]
    if value < s[gait + LEAST] or value > s[CEILING] or at - s[FIRST] < half:
        return
    left, need = 0.0, half
    if s[RULE] == SCORE:
        left = _score(s, at, int(half), -1)
    else:
        lower = _lower_before(s, at, value)
        need = max(half, s[WINDOW] - 1.0 - lower)
        if lower < half:
            return
    if at + need < now:
        return  # a crest flat for longer than the window beside it
    q = QUEUE + count * ENTRY
    s[q + AT], s[q + VALUE], s[q + LEFT], s[q + JUDGE_AT] = at, value, left, at + need
    s[COUNT] = count + 1.0
    s[DUE] = s[QUEUE + JUDGE_AT]


def _lower_before(s: State, at: float, value: float) -> float:
    """Count the samples before `at` that are lower than `value`, up to the first that is not."""
    most = min(max(s[WINDOW] - 1.0, s[WALK + HALF], s[RUN + HALF]), at - s[FIRST])
    place, lower = int(at) % RING_SIZE, 0.0
    while lower < most:
        place = place - 1 if place > 0 else RING_SIZE - 1
        if not s[RING + place] < value:
            break
        lower += 1.0
    return lower


def _score(s: State, at: float, half: int, way: int) -> float:
    """Return the score of the `half` pairs beside `at` on one side: +1 where they fall away from it, else −1."""
    place, score = int(at) % RING_SIZE, 0.0
    for _ in range(half):
        beside = (place + way) % RING_SIZE
        score += 1.0 if s[RING + beside] < s[RING + place] else -1.0
        place = beside
    return score


def _judge(s: State, now: float, value: float, out: State, rows: int) -> int:
    """Judge the tops that are due at sample `now`, whose smoothed norm is `value`."""
    count, done = int(s[COUNT]), 0
    while done < count and s[QUEUE + done * ENTRY + JUDGE_AT] <= now:
        q = QUEUE + done * ENTRY
        at, peak = s[q + AT], s[q + VALUE]
        gait = _gait(s, peak)
        if s[RULE] == SCORE:
            passed = s[q + LEFT] + _score(s, at, int(s[gait + HALF]), 1) > s[SCORE_OVER]
        else:
            passed = value <= peak  # greater tops have taken it from the queue; one may still be rising
        valley = _lowest(s, at - s[gait + HALF], 2 * int(s[gait + HALF]))
        if passed and peak - valley >= s[REST]:
            rows = _regular(s, gait, at, peak, valley, out, rows)
        done += 1
    for i in range(QUEUE, QUEUE + (count - done) * ENTRY):
        s[i] = s[i + done * ENTRY]
    s[COUNT] = float(count - done)
    s[DUE] = s[QUEUE + JUDGE_AT] if count > done else -1.0
    return rows


def _lowest(s: State, first: float, samples: int) -> float:
    """Return the lowest of `samples` + 1 samples from `first` on, all of them there."""
    place = int(first) % RING_SIZE
    lowest = s[RING + place]
    for _ in range(samples):
        place = place + 1 if place + 1 < RING_SIZE else 0
        lowest = min(lowest, s[RING + place])
    return lowest


def _regular(s: State, gait: int, at: float, peak: float, valley: float, out: State, rows: int) -> int:
    """Drop a peak too near the last, begin a bout with one too far, and write steps once the bout is certain."""
    spacing, known, over_gap = at - s[LAST], s[PEAKS] > 0.0, s[LAST] < s[FIRST]
    if known and spacing < s[gait + SHORTEST]:
        return rows
    if not known or (spacing >= BRIDGE if over_gap else spacing > s[gait + LONGEST]):
        s[PEAKS] = spacing = 0.0
    elif over_gap:
        spacing = 0.0  # how many steps the gap hides is unknown
    s[LAST] = at
    s[PEAKS] += 1.0
    if s[PEAKS] > s[BOUT]:
        return _row(out, rows, at, spacing, peak, valley, s[gait + LEAST])
    end = _row(s, HELD + (int(s[PEAKS]) - 1) * ROW, at, spacing, peak, valley, s[gait + LEAST])
    if s[PEAKS] < s[BOUT]:
        return rows
    if s[CREDIT] == 0.0:
        return _row(out, rows, at, 0.0, peak, valley, s[gait + LEAST])
    for i in range(HELD, end):
        out[rows] = s[i]
        rows += 1
    return rows


def _row(out: State, rows: int, at: float, spacing: float, peak: float, valley: float, threshold: float) -> int:
    out[rows], out[rows + 1], out[rows + 2], out[rows + 3], out[rows + 4] = at, spacing, peak, valley, threshold
    return rows + ROW
