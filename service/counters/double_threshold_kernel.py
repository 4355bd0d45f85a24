"""The adaptive double threshold as scalar kernels over one flat state: plain while live, compiled for recordings.

`begin` opens a stretch of samples, `scan` eats them, `close` decides what is left; `double_threshold` says what they
compute and why. The state `s` holds floats only: first the constants of an instance (`Y_WEIGHT` … `REFRESH`), then what
changes. Samples are named by their grid index. Events are rows of `ROW` floats written to `out` after its first n
entries: `(BAND, from, to, T_H, T_L, 0, 0)` for a closed window, `(STEP, index, spacing or 0, peak, valley, T_H, T_L)`.
Only what numba and Python compute to the same bits is used: `+ − × ÷`, comparisons and `sqrt`.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import sqrt
from typing import Final

# Constants of an instance.
Y_WEIGHT: Final = 0  # 1 for the norm, 0 for √(X²+Z²)
HALF: Final = 1  # N of (7), (8)
GO_ON: Final = 2  # 1: equal values go on a run, 0: they end it
VALLEYS: Final = 3  # how many valleys a peak may look at
WAIT: Final = 4  # how many samples it waits for them
REST: Final = 5  # g; less between peak and valley is rest
LOWER_SHARE: Final = 6  # T_L = L + this share of H − L
MIN_SPACING: Final = 7
MAX_SPACING: Final = 8
BOUT: Final = 9  # valid peaks that make a bout certain
CREDIT: Final = 10  # 1: the peaks before it was certain count too
LIMIT: Final = 11  # window length above which it is halved
REFRESH: Final = 12  # moving samples after which the window length is taken anew; 0 never
CAPACITY: Final = 13  # of the queue of undecided peaks
CONSTANTS: Final = 14

# Belief: it outlasts a gap.
WINDOW: Final = 14  # window length in samples
HIGH: Final = 15  # H
LOW: Final = 16  # L
HIGH_KNOWN: Final = 17
LOW_KNOWN: Final = 18
SPACING_SUM: Final = 19  # of the moving samples since the length was taken
SPACINGS: Final = 20

# The bout: once certain it outlasts a short gap.
BOUT_PEAKS: Final = 21  # valid peaks so far
LAST: Final = 22  # index of the last one

# The stretch: it ends with a gap.
FIRST: Final = 23  # index of its first sample
NEXT: Final = 24  # index of the sample to come; −1 before the first stretch and after the last
M1: Final = 25  # the four magnitudes before
M2: Final = 26
M3: Final = 27
M4: Final = 28
FILTERED: Final = 29  # X(n − 1)
RISING: Final = 30  # 1 in a run of rises, −1 of falls, 0 in none
SINCE: Final = 31  # index of the run's first sample
TURN: Final = 32  # the value before it
WINDOW_FROM: Final = 33
CLOSE_AT: Final = 34
PEAK_SUM: Final = 35
PEAKS: Final = 36
VALLEY_SUM: Final = 37
VALLEYS_SEEN: Final = 38
HEAD: Final = 39
COUNT: Final = 40
RIPE: Final = 41  # index of the sample to come that makes the extremum before the run certain

WAITS: Final = 42  # 1: the oldest undecided peak waits for nothing but a valley
YOUNGEST: Final = 43  # place of the last peak in this state

HELD: Final = 44
"""Rows of `HELD_MAX` valid peaks of a bout that is not certain yet."""

ROW: Final = 7
BAND: Final = 0.0
STEP: Final = 1.0
HELD_MAX: Final = 12
QUEUE: Final = HELD + HELD_MAX * ROW
"""A ring of undecided peaks, `ENTRY` floats each."""

AT: Final = 0
PEAK: Final = 1
SEEN: Final = 2  # valleys after it
VALLEY: Final = 3  # the lowest of them
CLOSED: Final = 4  # 1 once its window's thresholds are known
UPPER: Final = 5
LOWER: Final = 6
ENTRY: Final = 7

WARM_UP: Final = 5
"""First samples of a stretch in which no extremum counts: the mean (5) is not full yet."""

NEVER: Final = 1e300

MOST: Final = 1e6
"""g; no sensor measures as much."""

BRIDGE: Final = 150.0
"""A bout goes on over a gap if the two steps around it lie less than 3 s apart."""

Floats = Sequence[float]
State = MutableSequence[float]


def begin(s: State, index: int, x: float, y: float, z: float) -> None:
    """Open a stretch at grid index `index`, whose magnitude stands for those before it; only a certain bout goes on."""
    magnitude = sqrt(x * x + s[Y_WEIGHT] * (y * y) + z * z)
    if s[BOUT_PEAKS] < s[BOUT]:
        s[BOUT_PEAKS] = 0.0
    for name in (RISING, SINCE, TURN, PEAK_SUM, PEAKS, VALLEY_SUM, VALLEYS_SEEN, HEAD, COUNT, WAITS):
        s[name] = 0.0
    s[M1] = s[M2] = s[M3] = s[M4] = magnitude
    s[FILTERED] = (magnitude + magnitude + magnitude + magnitude + magnitude) / 5.0
    s[FIRST] = s[NEXT] = s[WINDOW_FROM] = float(index)
    s[RIPE] = NEVER
    s[YOUNGEST] = QUEUE + (s[CAPACITY] - 1.0) * ENTRY
    s[CLOSE_AT] = s[WINDOW_FROM] + s[WINDOW] - 1.0 + s[HALF]


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> int:
    """Eat n samples (g); write X(n) to `out[:n]` and rows after it; return where the rows end.

    The end of `out` is scratch: for each turn, the place of its run's first sample in the block.
    """
    first, last, rising, rows = s[NEXT], s[FILTERED], s[RISING], n
    half, go_on = s[HALF], s[GO_ON] > 0.0
    _filter(x, y, z, n, s, out)
    turns = len(out) - n
    for t in range(turns, _turns(n, last, rising, out, turns)):
        i = int(out[t])
        value, before = out[i], out[i - 1] if i > 0 else last
        if value > before:
            now = 1.0
        elif value < before:
            now = -1.0
        else:
            now = rising if go_on and value == before else 0.0
        if now != rising:
            k = first + i
            if s[RIPE] < k or s[CLOSE_AT] < k:
                rows = _take(s, k, out, rows)
            s[RIPE] = k + half - 1.0 if now + rising == 0.0 and k - s[SINCE] >= half else NEVER
            s[RISING], s[SINCE], s[TURN] = now, k, before
            rising = now
    if n > 0:
        s[FILTERED] = out[n - 1]
    k = s[NEXT] = first + n
    return _take(s, k, out, rows) if s[RIPE] < k or s[CLOSE_AT] < k else rows


def _filter(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> None:
    """Write the five-point mean (5) of the magnitude to `out[:n]`; free of branches, for LLVM to make vectors of it."""
    y_weight, m1, m2, m3, m4 = s[Y_WEIGHT], s[M1], s[M2], s[M3], s[M4]
    for i in range(n):
        a, b, c = x[i], y[i], z[i]
        m = sqrt(a * a + y_weight * (b * b) + c * c)
        out[i] = (m + m1 + m2 + m3 + m4) / 5.0
        m4, m3, m2 = m3, m2, m1
        m1 = m
    s[M1], s[M2], s[M3], s[M4] = m1, m2, m3, m4


def _turns(n: int, last: float, rise: float, out: State, to: int) -> int:
    """Write to `out[to:]` where X(n) does not go on as before it, no matter whether it is level; return where they end.

    Every place is written, the next one over it where nothing turns: a branch would be mispredicted at each turn.
    """
    for i in range(n):
        before, value = rise, out[i]
        rise, last = value - last, value
        out[to] = i
        if rise * before > 0.0:
            continue
        to += 1
    return to


def close(s: State, out: State) -> int:
    """End the stretch: decide every peak with what is there, write rows to `out[0:]`, return where they end."""
    rows = 0
    if s[NEXT] > s[WINDOW_FROM]:
        rows = _close_window(s, s[NEXT] - 1.0, out, rows)
    return _settle(s, s[NEXT] + s[WAIT] + 1.0, False, 0.0, 0.0, out, rows)


def stop(s: State) -> None:
    """End the stream: an uncertain bout is dropped."""
    s[NEXT] = -1.0
    s[BOUT_PEAKS] = 0.0


def _take(s: State, k: float, out: State, rows: int) -> int:
    """Take the extremum that is certain and the windows that are over before sample k."""
    ripe = s[RIPE]
    while s[CLOSE_AT] < k:
        if ripe <= s[CLOSE_AT]:
            rows, ripe = _extremum(s, s[SINCE] - 1.0, out, rows), NEVER
        rows = _close_window(s, s[CLOSE_AT] - s[HALF], out, rows)
    if ripe < k:
        return _extremum(s, s[SINCE] - 1.0, out, rows)
    return rows


def _extremum(s: State, at: float, out: State, rows: int) -> int:
    """Take the peak or valley before the run; none counts before the mean (5) is full."""
    s[RIPE] = NEVER
    if at < s[FIRST] + WARM_UP:
        return rows
    if s[RISING] > 0.0:
        return _valley(s, at, s[TURN], out, rows)
    _peak(s, at, s[TURN])
    return rows


def _peak(s: State, at: float, value: float) -> None:
    """Add a peak to the window's mean and to the queue; one that no sensor measures would stay in the means."""
    if value >= MOST:
        return
    s[PEAK_SUM] += value
    s[PEAKS] += 1.0
    s[COUNT] += 1.0
    q = int(s[YOUNGEST]) + ENTRY
    if q == QUEUE + int(s[CAPACITY]) * ENTRY:
        q = QUEUE
    s[YOUNGEST] = float(q)
    s[q + AT], s[q + PEAK] = at, value
    s[q + SEEN] = s[q + CLOSED] = 0.0


def _valley(s: State, at: float, value: float, out: State, rows: int) -> int:
    """Add a valley to the window's mean and show it to the peaks that wait for one."""
    s[VALLEY_SUM] += value
    s[VALLEYS_SEEN] += 1.0
    q, end = int(s[YOUNGEST]), QUEUE + int(s[CAPACITY]) * ENTRY
    valleys, wait = s[VALLEYS], s[WAIT]
    for _ in range(int(s[COUNT])):
        seen = s[q + SEEN]
        if seen >= valleys or at - s[q + AT] > wait:
            break  # nor does an older one wait
        if seen == 0.0 or value < s[q + VALLEY]:
            s[q + VALLEY] = value
        s[q + SEEN] = seen + 1.0
        q = (q if q > QUEUE else end) - ENTRY
    return _settle(s, at, False, 0.0, 0.0, out, rows) if s[WAITS] > 0.0 else rows


def _close_window(s: State, to: float, out: State, rows: int) -> int:
    """Close the window that ends with sample `to`: its thresholds (9)–(16), then its peaks."""
    high, low = s[HIGH], s[LOW]
    if s[PEAKS] > 0.0:
        high = s[HIGH] = _mean(s[PEAK_SUM], s[PEAKS], high, s[HIGH_KNOWN])
        s[HIGH_KNOWN] = 1.0
    if s[VALLEYS_SEEN] > 0.0:
        low = s[LOW] = _mean(s[VALLEY_SUM], s[VALLEYS_SEEN], low, s[LOW_KNOWN])
        s[LOW_KNOWN] = 1.0
    s[PEAK_SUM] = s[PEAKS] = s[VALLEY_SUM] = s[VALLEYS_SEEN] = 0.0
    known = s[HIGH_KNOWN] > 0.0 and s[LOW_KNOWN] > 0.0
    upper, lower = (high + low) / 2.0, low + s[LOWER_SHARE] * (high - low)
    if known:
        rows = _row(out, rows, BAND, s[WINDOW_FROM], to, upper, lower, 0.0, 0.0)
    else:
        upper = NEVER
    s[WINDOW_FROM] = to + 1.0
    s[CLOSE_AT] = to + s[WINDOW] + s[HALF]
    rows = _settle(s, to, True, upper, lower, out, rows)
    if s[WAITS] > 0.0:
        _close_peaks(s, upper, lower)
    return rows


def _close_peaks(s: State, upper: float, lower: float) -> None:
    """Give the window's thresholds to those of its peaks that are behind one that waits."""
    q, end = int(s[YOUNGEST]), QUEUE + int(s[CAPACITY]) * ENTRY
    while s[q + CLOSED] == 0.0:
        s[q + CLOSED], s[q + UPPER], s[q + LOWER] = 1.0, upper, lower
        q = (q if q > QUEUE else end) - ENTRY


def _mean(total: float, count: float, before: float, known: float) -> float:
    """(11)–(14): the mean of several extrema; a single one is averaged with the window before's mean."""
    if count == 1.0 and known > 0.0:
        return (before + total) / 2.0
    return total / count


def _settle(s: State, now: float, closing: bool, upper: float, lower: float, out: State, rows: int) -> int:
    """Decide the oldest peaks, in order, as far as their thresholds and valleys are known at sample `now`.

    Where a window is `closing`, `upper` and `lower` are the thresholds of the peaks that had none.
    """
    head, count, capacity = int(s[HEAD]), int(s[COUNT]), int(s[CAPACITY])
    s[WAITS] = 0.0
    while count > 0:
        q = QUEUE + head * ENTRY
        if s[q + CLOSED] == 0.0:
            if not closing:
                break
            s[q + CLOSED], s[q + UPPER], s[q + LOWER] = 1.0, upper, lower
        if s[q + PEAK] > s[q + UPPER]:
            seen = s[q + SEEN]
            if seen > 0.0 and s[q + VALLEY] < s[q + LOWER]:
                rows = _valid(s, q, out, rows)
            elif seen < s[VALLEYS] and now - s[q + AT] <= s[WAIT]:
                s[WAITS] = 1.0
                break
        head = head + 1 if head + 1 < capacity else 0
        count -= 1
    s[HEAD], s[COUNT] = float(head), float(count)
    return rows


def _valid(s: State, q: int, out: State, rows: int) -> int:
    """Sort false steps out (17) and write the peak at queue place `q` as a step, once its bout is certain."""
    at, last, peaks = s[q + AT], s[LAST], s[BOUT_PEAKS]
    spacing = at - last
    if (peaks > 0.0 and spacing <= s[MIN_SPACING]) or s[q + PEAK] - s[q + VALLEY] < s[REST]:
        return rows
    over_gap = last < s[FIRST]
    if peaks == 0.0 or spacing >= (BRIDGE if over_gap else s[MAX_SPACING]):
        peaks = spacing = 0.0
    elif over_gap:
        spacing = 0.0  # how many steps the gap hides is unknown
    else:
        _learn(s, spacing)
    peaks += 1.0
    s[LAST], s[BOUT_PEAKS] = at, peaks
    if peaks > s[BOUT]:
        return _row(out, rows, STEP, at, spacing, s[q + PEAK], s[q + VALLEY], s[q + UPPER], s[q + LOWER])
    held = HELD + (int(peaks) - 1) * ROW
    end = _row(s, held, STEP, at, spacing, s[q + PEAK], s[q + VALLEY], s[q + UPPER], s[q + LOWER])
    if peaks < s[BOUT]:
        return rows
    if s[CREDIT] == 0.0:
        return _row(out, rows, STEP, at, 0.0, s[q + PEAK], s[q + VALLEY], s[q + UPPER], s[q + LOWER])
    for i in range(HELD, end):
        out[rows] = s[i]
        rows += 1
    return rows


def _learn(s: State, spacing: float) -> None:
    """Take the window length (6) anew after enough moving samples."""
    s[SPACING_SUM] += spacing
    s[SPACINGS] += 1.0
    if s[REFRESH] > 0.0 and s[SPACING_SUM] >= s[REFRESH]:
        length = s[SPACING_SUM] / s[SPACINGS]
        if length > s[LIMIT]:
            length /= 2.0
        s[WINDOW] = float(int(length + 0.5))
        s[SPACING_SUM] = s[SPACINGS] = 0.0


def _row(out: State, rows: int, kind: float, a: float, b: float, c: float, d: float, e: float, f: float) -> int:
    out[rows], out[rows + 1], out[rows + 2], out[rows + 3] = kind, a, b, c
    out[rows + 4], out[rows + 5], out[rows + 6] = d, e, f
    return rows + ROW
