"""The gyroscope's zero crossings as scalar kernels over one flat state: plain while live, compiled for recordings.

`gyro_zero_crossing` says what they compute and why; `streaming.Kernel` how they are called. The state `s` holds floats
only: first the constants of an instance (`AXIS` … `CAPACITY`), then what changes. Samples are named by their grid
index, crossings by a fractional one, both on the filtered signal. Rows of `ROW` floats: `(BAND, from, to, peak
threshold, valley threshold)` for a closed look-out, `(STEP, crossing, spacing or 0, extremum, its threshold)`; valleys
and their threshold are negative. Only what numba and Python compute to the same bits is used: `+ − × ÷`, comparisons.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import Final

from service.samples import Likely

# Constants of an instance.
AXIS: Final = 0  # 0, 1, 2; LARGEST follows the axis of largest variance
PEAK_THRESHOLD: Final = 1  # rad/s
VALLEY_THRESHOLD: Final = 2  # rad/s, negative
FIRST_ONLY: Final = 3  # 1: only the first extremum after a crossing is looked at
WAIT: Final = 4  # samples from a crossing to its extremum
REFRACTORY: Final = 5  # samples after a confirmed crossing in which none is taken
MAX_SPACING: Final = 6  # samples; a crossing this far starts a new bout
BOUT: Final = 7  # steps that make a bout certain
REST: Final = 8  # rad²/s²; less variance on all axes together is rest
START_DELAY: Final = 9  # samples at the start of the stream that are not counted
TAKEN_OUT: Final = 10  # samples before the end of the stream whose steps are taken back
DELAY: Final = 11  # samples by which the filter lags
GAIN: Final = 12  # of the three sections together
A: Final = 13  # a₁, a₂ of each section
CAPACITY: Final = 19  # of the queue of held steps
WIDEST: Final = 20  # rad/s × samples from a crossing to its extremum; a wider swing is no step's
SLOW_WAIT: Final = 21  # samples; WAIT of a slow swing, no less than WAIT
SLOW_SPACING: Final = 22  # samples; MAX_SPACING of slow swings, no less than MAX_SPACING
SLOW_LEAST: Final = 23  # rad/s × samples; a slow swing is wider
SLOW_WIDEST: Final = 24  # and no wider than this
EVEN: Final = 25  # one spacing of slow swings is at most so many times another
CONSTANTS: Final = 26

# Belief: it outlasts a gap.
CHOSEN: Final = 26  # the axis in use
BIAS: Final = 27  # mean rate at rest of each axis, rad/s
VARIANCE: Final = 30  # of each axis while it moves, rad²/s²
COUNTED_FROM: Final = 33  # index from which the start delay is over; −1 before the first stretch

# The bout and what is held: certain steps outlast a gap.
BOUT_STEPS: Final = 34
LAST: Final = 35  # the last confirmed crossing
HEAD: Final = 36
COUNT: Final = 37  # steps held
UNSURE: Final = 38  # the newest of them whose bout is not certain
PACE: Final = 39  # the last spacing in the bout; 0 none
DUE: Final = 40  # index at which the oldest certain one is to be given out

# The stretch: it ends with a gap.
NEXT: Final = 41  # index of the sample to come; −1 before the first stretch and after the last
FIRST: Final = 42  # index of its first sample
SETTLED: Final = 43  # crossings before this are of the filter's start
FILTER: Final = 44  # two values of each section
FILTERED: Final = 50  # the filtered rate before
POLARITY: Final = 51  # sign after the last crossing taken; 0 at the start
CANDIDATE: Final = 52  # 1 waits for a peak, −1 for a valley
CROSSED: Final = 53  # where that candidate crossed
SWEPT: Final = 54  # sum of the filtered rate since the last crossing
LOOK: Final = 55  # index of the next sample that is looked at
LOOKS: Final = 56  # samples looked at in this look-out
SUMS: Final = 57  # of each axis over them
SQUARES: Final = 60

QUEUE: Final = 63
"""A ring of held steps: crossing, spacing, extremum, threshold."""

ENTRY: Final = 4
ROW: Final = 5
BAND: Final = 0.0
STEP: Final = 1.0
NEVER: Final = 1e300

LARGEST: Final = 3.0
"""`AXIS`: follow the axis of largest variance."""

LOOK_EVERY: Final = 5.0
"""Rest and variance are looked at with 10 Hz: plenty for a swing below 2 Hz, and a live packet stays cheap."""

LOOK_OUT: Final = 20.0
"""Looks that make a look-out of two seconds: a whole stride at 60 steps/min, or its variance is not seen."""

MAX_BIAS: Final = 0.2
"""rad/s (11 °/s), beyond any datasheet's zero-rate level: a steadier rate is a slow turn, no bias."""

MEMORY: Final = 0.5
"""Weight of the last look-out in an axis's variance."""

CLEARLY: Final = 1.5
"""The axis changes for one of so many times its variance: two axes that share the swing do not alternate."""

MOST: Final = 1e3
"""rad/s; no gyroscope measures more."""

BRIDGE: Final = 150.0
"""A bout goes on over a gap if the two steps around it lie less than 3 s apart."""

Floats = Sequence[float]
State = MutableSequence[float]


def begin(s: State, index: int, x: float, y: float, z: float) -> None:  # noqa: ARG001  # any first sample will do
    """Open a stretch at grid index `index`, the thigh taken as at rest before it; only a certain bout goes on."""
    if s[COUNTED_FROM] < 0.0:
        s[COUNTED_FROM] = index + s[START_DELAY]
    if s[BOUT_STEPS] < s[BOUT]:
        _drop_unsure(s)
        s[BOUT_STEPS] = 0.0
    s[NEXT] = s[FIRST] = s[LOOK] = float(index)
    _clear_look_out(s)
    _restart(s, s[NEXT])


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> int:
    """Eat n samples (rad/s); write the filtered rate to `out[:n]` and rows after it; return where the rows end."""
    gain, a1, a2, b1, b2, c1, c2 = s[GAIN], s[A], s[A + 1], s[A + 2], s[A + 3], s[A + 4], s[A + 5]
    p1, p2, q1, q2, r1, r2 = s[FILTER], s[FILTER + 1], s[FILTER + 2], s[FILTER + 3], s[FILTER + 4], s[FILTER + 5]
    chosen = s[CHOSEN]
    rate = x if chosen == 0.0 else y if chosen == 1.0 else z
    bias = s[BIAS + int(chosen)]
    last, candidate, swept, k, look = s[FILTERED], s[CANDIDATE], s[SWEPT], s[NEXT], s[LOOK]
    due, rows = s[DUE], n
    for i in range(n):
        p = (rate[i] - bias) * gain - a1 * p1 - a2 * p2
        q = p + p1 + p1 + p2 - b1 * q1 - b2 * q2
        r = q + q1 + q1 + q2 - c1 * r1 - c2 * r2
        filtered = r + r1 + r1 + r2
        p2, q2, r2 = p1, q1, r1
        p1, q1, r1 = p, q, r
        out[i] = filtered
        if candidate * (last - filtered) > 0.0:
            candidate, rows = _extremum(s, k, last, swept, out, rows)
            due = s[DUE]
        if filtered > 0.0:
            if last <= 0.0 and s[POLARITY] <= 0.0:
                candidate, swept = _cross(s, k - filtered / (filtered - last), 1.0), 0.0
        elif last >= 0.0 > filtered and s[POLARITY] >= 0.0:
            candidate, swept = _cross(s, k - filtered / (filtered - last), -1.0), 0.0
        swept += filtered
        last = filtered
        if k >= due:
            rows = _give_out(s, k, out, rows)
            due = s[DUE]
        if k == look:
            look += LOOK_EVERY
            rows = _look(s, k, x[i], y[i], z[i], out, rows)
            if s[CHOSEN] != chosen or not -MOST < filtered < MOST:  # what is no rate would stay in the filter
                chosen = s[CHOSEN]
                rate = x if chosen == 0.0 else y if chosen == 1.0 else z
                p1 = p2 = q1 = q2 = r1 = r2 = last = candidate = swept = 0.0
                _restart(s, k + 1.0)
            bias = s[BIAS + int(chosen)]
        k += 1.0
    s[FILTER], s[FILTER + 1], s[FILTER + 2], s[FILTER + 3], s[FILTER + 4], s[FILTER + 5] = p1, p2, q1, q2, r1, r2
    s[FILTERED], s[CANDIDATE], s[SWEPT], s[NEXT], s[LOOK] = last, candidate, swept, k, look
    return rows


def close(s: State, out: State) -> int:  # noqa: ARG001  # nothing is decided here: an extremum not seen is none
    """End the stretch; a crossing without its extremum is no step."""
    s[CANDIDATE] = 0.0
    return 0


def stop(s: State) -> None:
    """End the stream: the phone has been taken out, so what is still held is taken back; start over with a delay."""
    s[NEXT] = s[COUNTED_FROM] = -1.0
    s[BOUT_STEPS] = s[HEAD] = s[COUNT] = s[UNSURE] = s[PACE] = 0.0
    s[DUE] = NEVER


def likely(s: State) -> list[Likely]:
    """Return every crossing that can still become a step: where, how strong, and whether it is past its threshold.

    Those are the held ones, unless their bout has ended, and the one that waits for its extremum.
    """
    found: list[Likely] = []
    waits = s[CANDIDATE] != 0.0 and s[NEXT] - s[CROSSED] <= s[SLOW_WAIT] + 1.0
    if s[COUNT] > 0.0:
        ended = s[NEXT] - s[LAST] - s[SLOW_WAIT] >= s[SLOW_SPACING]
        if waits and s[CROSSED] - s[LAST] < s[SLOW_SPACING]:
            ended = False
        head, capacity = int(s[HEAD]), int(s[CAPACITY])
        for i in range(int(s[COUNT] - s[UNSURE] if ended else s[COUNT])):
            q = QUEUE + (head + i) % capacity * ENTRY
            found.append((s[q], abs(s[q + 2]), True))
    if waits:
        past = s[FILTERED] > s[PEAK_THRESHOLD] if s[CANDIDATE] > 0.0 else s[FILTERED] < s[VALLEY_THRESHOLD]
        found.append((s[CROSSED], abs(s[FILTERED]), past))
    return found


def _restart(s: State, index: float) -> None:
    """Start filter and crossings afresh at sample `index`, from rest."""
    for i in range(FILTER, FILTERED + 1):
        s[i] = 0.0
    s[POLARITY] = s[CANDIDATE] = s[CROSSED] = s[SWEPT] = 0.0
    s[SETTLED] = max(index, s[COUNTED_FROM]) + s[DELAY]


def _cross(s: State, at: float, sign: float) -> float:
    """Take a crossing as a candidate and return its sign; 0 where it is hidden by the last step or too early."""
    if s[BOUT_STEPS] > 0.0 and at - s[LAST] < s[REFRACTORY]:
        return 0.0
    s[POLARITY] = sign
    if at >= s[SETTLED]:
        s[CROSSED] = at
        return sign
    return 0.0


def _extremum(s: State, k: float, value: float, swept: float, out: State, rows: int) -> tuple[float, int]:
    """Weigh the extremum seen at sample `k`; return what the candidate is then, and where the rows end."""
    candidate, waited = s[POLARITY], k - s[CROSSED]
    wide = candidate * swept
    enough = value > s[PEAK_THRESHOLD] if candidate > 0.0 else value < s[VALLEY_THRESHOLD]
    if wide > s[WIDEST] or waited > s[SLOW_WAIT] or (waited > s[WAIT] and not _slow(s, wide)):
        return 0.0, rows
    if enough:
        return 0.0, _confirm(s, k, value, wide, out, rows)
    return 0.0 if s[FIRST_ONLY] > 0.0 else candidate, rows


def _slow(s: State, wide: float) -> bool:
    """Tell whether a swing is as wide as a slow walker's."""
    return s[SLOW_LEAST] < wide <= s[SLOW_WIDEST]


def _confirm(s: State, k: float, value: float, wide: float, out: State, rows: int) -> int:
    """Take the candidate as a step; hold it until its bout is certain and the phone is not taken out."""
    at = s[CROSSED]
    spacing = at - s[LAST]
    over_gap = s[LAST] < s[FIRST]
    even = spacing <= s[EVEN] * s[PACE] and s[PACE] <= s[EVEN] * spacing
    if s[UNSURE] > 1.0 and s[PACE] >= s[MAX_SPACING] and not even:
        _keep_newest(s)
    slow = spacing < s[SLOW_SPACING] and _slow(s, wide) and (even or s[PACE] == 0.0) and not over_gap
    if s[BOUT_STEPS] == 0.0 or (spacing >= (BRIDGE if over_gap else s[MAX_SPACING]) and not slow):
        _drop_unsure(s)
        s[BOUT_STEPS] = spacing = 0.0
    elif over_gap:
        spacing = 0.0  # how many steps the gap hides is unknown
    s[LAST], s[PACE] = at, spacing
    s[BOUT_STEPS] += 1.0
    q = QUEUE + int(s[HEAD] + s[COUNT]) % int(s[CAPACITY]) * ENTRY
    s[q], s[q + 1], s[q + 2] = at, spacing, value
    s[q + 3] = s[PEAK_THRESHOLD] if value > 0.0 else s[VALLEY_THRESHOLD]
    s[COUNT] += 1.0
    s[UNSURE] = s[UNSURE] + 1.0 if s[BOUT_STEPS] < s[BOUT] else 0.0
    return _give_out(s, k, out, rows)


def _keep_newest(s: State) -> None:
    """Begin the bout with the newest step held: what lay a slow spacing before it did not go on at that pace."""
    capacity = int(s[CAPACITY])
    first, newest = int(s[HEAD] + s[COUNT] - s[UNSURE]), int(s[HEAD] + s[COUNT]) - 1
    to, q = QUEUE + first % capacity * ENTRY, QUEUE + newest % capacity * ENTRY
    s[to], s[to + 1], s[to + 2], s[to + 3] = s[q], 0.0, s[q + 2], s[q + 3]
    s[COUNT] -= s[UNSURE] - 1.0
    s[UNSURE] = s[BOUT_STEPS] = 1.0
    s[PACE] = 0.0


def _drop_unsure(s: State) -> None:
    s[COUNT] -= s[UNSURE]
    s[UNSURE] = 0.0


def _give_out(s: State, k: float, out: State, rows: int) -> int:
    """Write the steps that nothing can take back any more at sample `k`."""
    s[DUE] = NEVER
    while s[COUNT] > s[UNSURE]:
        q = QUEUE + int(s[HEAD]) * ENTRY
        due = s[q] - s[DELAY] + s[TAKEN_OUT]
        if k < due:
            s[DUE] = due
            break
        rows = _row(out, rows, STEP, s[q], s[q + 1], s[q + 2], s[q + 3])
        s[HEAD] = (s[HEAD] + 1.0) % s[CAPACITY]
        s[COUNT] -= 1.0
    return rows


def _look(s: State, k: float, x: float, y: float, z: float, out: State, rows: int) -> int:
    """Look at one sample; at the end of a look-out, learn the rate at rest or which axis swings most."""
    s[SUMS] += x
    s[SUMS + 1] += y
    s[SUMS + 2] += z
    s[SQUARES] += x * x
    s[SQUARES + 1] += y * y
    s[SQUARES + 2] += z * z
    s[LOOKS] += 1.0
    if s[LOOKS] < LOOK_OUT:
        return rows
    total = 0.0
    for axis in range(3):
        mean = s[SUMS + axis] / LOOK_OUT
        s[SQUARES + axis] = s[SQUARES + axis] / LOOK_OUT - mean * mean
        total += s[SQUARES + axis]
    if total < s[REST]:
        for axis in range(3):
            mean = s[SUMS + axis] / LOOK_OUT
            if -MAX_BIAS <= mean <= MAX_BIAS:
                s[BIAS + axis] = mean
    elif s[REST] <= total < MOST * MOST:  # NaN is not
        for axis in range(3):
            s[VARIANCE + axis] += MEMORY * (s[SQUARES + axis] - s[VARIANCE + axis])
        if s[AXIS] == LARGEST:
            _choose(s)
    _clear_look_out(s)
    to = k + LOOK_EVERY - 1.0
    return _row(out, rows, BAND, to + 1.0 - LOOK_OUT * LOOK_EVERY, to, s[PEAK_THRESHOLD], s[VALLEY_THRESHOLD])


def _choose(s: State) -> None:
    """Follow the axis of largest variance, if it is clearly the largest."""
    best = int(s[CHOSEN])
    bar = CLEARLY * s[VARIANCE + best]
    for axis in range(3):
        if s[VARIANCE + axis] > bar:
            best, bar = axis, s[VARIANCE + axis]
    s[CHOSEN] = float(best)


def _clear_look_out(s: State) -> None:
    s[LOOKS] = 0.0
    for i in range(SUMS, SQUARES + 3):
        s[i] = 0.0


def _row(out: State, rows: int, kind: float, a: float, b: float, c: float, d: float) -> int:
    out[rows], out[rows + 1], out[rows + 2], out[rows + 3], out[rows + 4] = kind, a, b, c, d
    return rows + ROW
