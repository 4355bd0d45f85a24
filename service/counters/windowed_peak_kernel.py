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

from service.samples import Likely

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
FALLS: Final = 31  # pairs of the stretch that fall
COUNT: Final = 32  # tops in the queue
DUE: Final = 33  # when the oldest is judged; −1 none waits

HELD: Final = 34
"""Rows of `HELD_MAX` peaks of a bout that is not certain yet."""

ROW: Final = 5
HELD_MAX: Final = 12

QUEUE: Final = HELD + HELD_MAX * ROW
"""Tops that wait, oldest first, `ENTRY` floats each; those of GREATEST fall in height."""

AT: Final = 0
VALUE: Final = 1
LOW: Final = 2  # lowest of its half-window before it
POINTS: Final = 3  # SCORE: of the pairs before it, less two for each fall of the stretch by then
JUDGE_AT: Final = 4
ENTRY: Final = 5
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
    s[COUNT] = s[FALLS] = 0.0


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> int:
    """Eat n samples (g); write the smoothed norm to `out[:n]` and rows after it; return where the rows end."""
    w0, w1, w2, w3, w4 = s[0], s[1], s[2], s[3], s[4]
    m1, m2, m3, m4 = s[M1], s[M2], s[M3], s[M4]
    last, rise_at, falls, due, k, rows = s[SMOOTHED], s[RISE_AT], s[FALLS], s[DUE], s[NEXT], n
    place = RING + int(k) % RING_SIZE
    for i in range(n):
        a, b, c = x[i], y[i], z[i]
        m = sqrt(a * a + b * b + c * c)
        value = w0 * m + w1 * m1 + w2 * m2 + w3 * m3 + w4 * m4
        m4, m3, m2 = m3, m2, m1
        m1 = m
        out[i] = value
        s[place] = value
        place += 1
        if place == STATE:
            place = RING
        if value > last:
            rise_at = k
        elif value < last:
            if rise_at >= 0.0:
                _top(s, rise_at, last, k, falls)
                rise_at, due = -1.0, s[DUE]
            falls += 1.0
        if k == due:
            rows = _judge(s, k, value, falls, out, rows)
            due = s[DUE]
        last = value
        k += 1.0
    s[M1], s[M2], s[M3], s[M4] = m1, m2, m3, m4
    s[SMOOTHED], s[RISE_AT], s[FALLS], s[NEXT] = last, rise_at, falls, k
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


def likely(s: State) -> list[Likely]:
    """Return every peak that can still become a step: index, height, and whether it passes what is in force.

    Those are the held ones of a bout that can still become certain, and the waiting tops that no rule excludes yet.
    One passes if the samples before it are enough lower and no other that passes lies too near before it.
    """
    found: list[Likely] = []
    peaks, last, credit = s[PEAKS], s[LAST], s[CREDIT] > 0.0
    longest = max(s[WALK + LONGEST], s[RUN + LONGEST])
    crest = s[RISE_AT] >= max(0.0, s[NEXT] - LONGEST_WINDOW)  # flat up to now
    goes_on = s[NEXT] - last <= longest or (crest and s[RISE_AT] <= last + longest)
    passed, rank = last if peaks > 0.0 else -longest, s[BOUT] if credit else peaks
    for q in range(QUEUE, QUEUE + int(s[COUNT]) * ENTRY, ENTRY):
        at, value = s[q + AT], s[q + VALUE]
        gait = _gait(s, value)
        spacing = at - last
        if (peaks > 0.0 and spacing < s[gait + SHORTEST]) or _fails(s, q, gait):
            continue
        rank += 1.0
        if rank < s[BOUT]:
            continue  # a reference at most
        goes_on = goes_on or spacing <= longest
        in_bout = 1.0 if peaks == 0.0 or spacing > s[gait + LONGEST] else peaks + 1.0
        passes = value - s[q + LOW] >= s[REST] and at - passed >= s[gait + SHORTEST]
        if passes:
            passed = at
        found.append((at, value - s[q + LOW], passes and (credit or in_bout >= s[BOUT])))
    if goes_on and credit and 0.0 < peaks < s[BOUT]:
        end = HELD + int(peaks) * ROW
        return [(s[row], s[row + 2] - s[row + 3], True) for row in range(HELD, end, ROW)] + found
    return found


def _fails(s: State, q: int, gait: int) -> bool:
    """Tell whether the top at queue place `q` can pass no more, whatever comes."""
    if s[RULE] == SCORE:
        falls = s[FALLS] + s[q + JUDGE_AT] - s[NEXT] + 1.0
        return not s[q + POINTS] + 2.0 * falls - s[gait + HALF] > s[SCORE_OVER]
    return s[SMOOTHED] > s[q + VALUE]


def _gait(s: State, value: float) -> int:
    return WALK if value <= s[SPLIT] else RUN


def _top(s: State, at: float, value: float, now: float, falls: float) -> None:
    """Let a top wait for the samples after it, if amplitude, spacing and the samples before it allow.

    `falls` is how many pairs of the stretch fell up to it.
    """
    count = int(s[COUNT])
    if s[RULE] == GREATEST and count > 0:
        count = _overtop(s, value, count)
    gait = _gait(s, value)
    half = s[gait + HALF]
    if value < s[gait + LEAST] or value > s[CEILING] or at - s[FIRST] < half:
        return
    if s[PEAKS] > 0.0 and at - s[LAST] < s[gait + SHORTEST]:
        return
    q = QUEUE + count * ENTRY
    need = half
    if s[RULE] == SCORE:
        _score_before(s, q, at, value, int(half))
        s[q + POINTS] -= 2.0 * falls
    else:
        lower = _lower_before(s, q, at, value, half)
        if lower < half:
            return
        need = max(half, s[WINDOW] - 1.0 - lower)
    if at + need < now:
        return  # a crest flat for longer than the window beside it
    s[q + AT], s[q + VALUE], s[q + JUDGE_AT] = at, value, at + need
    s[COUNT] = count + 1.0
    s[DUE] = s[QUEUE + JUDGE_AT]


def _overtop(s: State, value: float, count: int) -> int:
    """Take the tops lower than `value` from the queue; return how many are left."""
    while count > 0 and s[QUEUE + (count - 1) * ENTRY + VALUE] < value:
        count -= 1
    s[COUNT] = float(count)
    s[DUE] = s[QUEUE + JUDGE_AT] if count > 0 else -1.0
    return count


def _lower_before(s: State, q: int, at: float, value: float, half: float) -> float:
    """Count the samples before `at` up to the first not lower than `value`, no more than matter; find their lowest."""
    most = min(max(half, s[WINDOW] - 1.0 - half), at - s[FIRST])
    place, lower, lowest = RING + int(at) % RING_SIZE, 0.0, value
    while lower < most:
        place = place - 1 if place > RING else STATE - 1
        before = s[place]
        if not before < value:
            break
        if before < lowest and lower < half:
            lowest = before
        lower += 1.0
    s[q + LOW] = lowest
    return lower


def _score_before(s: State, q: int, at: float, value: float, half: int) -> None:
    """Score the `half` pairs before `at`, +1 for one that rises, else −1; find their lowest sample."""
    place, later, lowest, points = RING + int(at) % RING_SIZE, value, value, 0.0
    for _ in range(half):
        place = place - 1 if place > RING else STATE - 1
        before = s[place]
        points += 1.0 if before < later else -1.0
        if before < lowest:  # noqa: PLR1730  # a call a sample is what a live packet can least afford
            lowest = before
        later = before
    s[q + LOW], s[q + POINTS] = lowest, points


def _judge(s: State, now: float, value: float, falls: float, out: State, rows: int) -> int:
    """Judge the tops that are due at sample `now`: its smoothed norm is `value`, with it `falls` pairs have fallen."""
    count, done = int(s[COUNT]), 0
    while done < count and s[QUEUE + done * ENTRY + JUDGE_AT] <= now:
        q = QUEUE + done * ENTRY
        gait = _gait(s, s[q + VALUE])
        if s[RULE] == SCORE:
            passed = s[q + POINTS] + 2.0 * falls - s[gait + HALF] > s[SCORE_OVER]
        else:
            passed = value <= s[q + VALUE]  # greater tops have taken it from the queue; one may still be rising
        if passed:
            rows = _regular(s, gait, s[q + AT], s[q + VALUE], _valley(s, q, int(s[gait + HALF])), out, rows)
        done += 1
    for i in range(QUEUE, QUEUE + (count - done) * ENTRY):
        s[i] = s[i + done * ENTRY]
    s[COUNT] = float(count - done)
    s[DUE] = s[QUEUE + JUDGE_AT] if count > done else -1.0
    return rows


def _valley(s: State, q: int, half: int) -> float:
    """Return the lowest of the samples in the window of the top at queue place `q`."""
    place, lowest = RING + int(s[q + AT]) % RING_SIZE, s[q + LOW]
    for _ in range(half):
        place += 1
        if place == STATE:
            place = RING
        if s[place] < lowest:  # noqa: PLR1730  # as above
            lowest = s[place]
    return lowest


def _regular(s: State, gait: int, at: float, peak: float, valley: float, out: State, rows: int) -> int:
    """Drop a peak too near the last, begin a bout with one too far, and write steps once the bout is certain."""
    spacing, known, over_gap = at - s[LAST], s[PEAKS] > 0.0, s[LAST] < s[FIRST]
    if peak - valley < s[REST] or (known and spacing < s[gait + SHORTEST]):
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
