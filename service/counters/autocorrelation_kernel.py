"""Autocorrelation counting as scalar kernels over one flat state: plain while live, compiled for recordings.

`begin` opens a stretch of samples, `scan` eats them, `close` ends it; `autocorrelation` says what they compute and why.
The state `s` holds floats only: the constants of an instance (`N` … `LENGTH`), then what changes. Samples are named by
their grid index. A row of `ROW` floats is a step: `(index, spacing or 0, peak, valley)`. The last `LENGTH` magnitudes
stand twice in a ring, so that any stretch of them lies in one piece. A period is judged at sample `DUE` only, which
depends on samples alone, and every sum is taken afresh there: so neither packets nor rounding can change a step.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import sqrt
from typing import Final

from service.samples import Likely

# Constants of an instance.
N: Final = 0  # steps a period: 1, or 2 where it is a stride
T_MIN: Final = 1
T_MAX: Final = 2
LOCK: Final = 3  # how far a period may lie from the one before
IDLE: Final = 4  # g²; a smaller variance over the current period is idle
RHO_MIN: Final = 5
HOP: Final = 6  # samples from one search to the next
PATIENCE: Final = 7  # a bout ends this long after its last step
BOUT: Final = 8  # steps that make a bout certain
CREDIT: Final = 9  # 1: what came before it was certain counts too
LENGTH: Final = 10  # of the ring
CONSTANTS: Final = 11

# The bout: once certain it outlasts a short gap.
PERIOD: Final = 11  # t of the last step; 0 while none is locked
BOUT_STEPS: Final = 12  # so far
LAST: Final = 13  # index of the last one

# The stretch: it ends with a gap.
FIRST: Final = 14  # index of its first sample
NEXT: Final = 15  # index of the sample to come; −1 before the first stretch and after the last
PLACE: Final = 16  # of that sample in the ring
DUE: Final = 17  # index of the sample that ends the period to be judged next
RHYTHM: Final = 18  # 1: that period is centred on the steps expected

HELD: Final = 19
"""Rows of `HELD_MAX` steps of a bout that is not certain yet."""

ROW: Final = 4
HELD_MAX: Final = 12
RING: Final = HELD + HELD_MAX * ROW

PERIODS: Final = 3.5
"""Longest periods the ring holds: a step of the period before may lie 2¾ of them back, its valley half of one more."""

BRIDGE: Final = 150.0
"""A bout goes on over a gap if the two steps around it lie less than 3 s apart."""

STILL: Final = 1e-12
"""g²; no sensor tells a smaller variance from none, and its correlation is rounding."""

NEAREST: Final = 0.6
"""Steps lie at least this share of a step's time apart: the slopes of a slow arm swing repeat, its crests do not."""

SEARCHED: Final = 2.75
"""Longest periods back that a period found off the rhythm counts steps, with the one credited with it."""

EQUAL: Final = 1e-9
"""Correlations closer than this are equal: a perfectly even walk repeats after two steps as after one."""

Floats = Sequence[float]
State = MutableSequence[float]


def begin(s: State, index: int, _x: float, _y: float, _z: float) -> None:
    """Open a stretch at grid index `index`; only a certain bout goes on."""
    if s[BOUT_STEPS] < s[BOUT]:
        s[BOUT_STEPS] = 0.0
    s[PLACE] = s[RHYTHM] = 0.0
    s[FIRST] = s[NEXT] = float(index)
    s[DUE] = s[FIRST] + 2.0 * s[T_MIN] - 1.0


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, out: State) -> int:
    """Eat n samples (g); write their norm to `out[:n]` and rows after it; return where the rows end."""
    length = int(s[LENGTH])
    place, k, due, end_of_rows = RING + int(s[PLACE]), s[NEXT], s[DUE], n
    end_of_ring = RING + length
    for i in range(n):
        a, b, c = x[i], y[i], z[i]
        norm = sqrt(a * a + b * b + c * c)
        out[i] = s[place] = s[place + length] = norm
        if k == due:
            end_of_rows = _judge(s, int(k), place + length, out, end_of_rows)
            due = s[DUE]
        k += 1.0
        place += 1
        if place == end_of_ring:
            place = RING
    s[NEXT], s[PLACE] = k, float(place - RING)
    return end_of_rows


def close(_s: State, _out: State) -> int:
    """End the stretch: a period cut short is no step."""
    return 0


def stop(s: State) -> None:
    """End the stream: an uncertain bout is dropped, the period forgotten."""
    s[NEXT] = -1.0
    s[BOUT_STEPS] = s[PERIOD] = s[RHYTHM] = 0.0


def likely(s: State) -> list[Likely]:
    """Return crests that can become steps: index, height, and whether the rhythm has them all but certain.

    Those are the steps of a bout that can still become certain, the tops that a period could take, and, while one is
    locked, the highest samples so far of its parts.
    """
    credit = s[CREDIT] > 0.0
    found: list[Likely] = []
    if credit or s[BOUT_STEPS] + s[N] >= s[BOUT]:
        found = _tops(s)
        if s[RHYTHM] > 0.0:
            expected = _expected(s)
            named = {one[0] for one in expected}
            found = sorted([one for one in found if one[0] not in named] + expected)
    first = found[0][0] if found else s[NEXT] - 1.0
    if credit and s[BOUT_STEPS] < s[BOUT] and min(first, s[NEXT] - 1.0) - s[LAST] <= s[PATIENCE]:
        end = HELD + int(s[BOUT_STEPS]) * ROW
        return [(s[held], s[held + 2] - s[held + 3], True) for held in range(HELD, end, ROW)] + found
    return found


def _expected(s: State) -> list[Likely]:
    """Return the highest samples that `_steps` will find if the period under way is walking, as far as it has come."""
    k, steps, t, length = int(s[NEXT]) - 1, int(s[N]), int(s[PERIOD]), int(s[LENGTH])
    newest = RING + length + (int(s[PLACE]) - 1) % length
    half = t // (2 * steps)
    reach = half // 2
    found: list[Likely] = []
    for j in range(steps - 1, -1, -1):
        centre = int(s[DUE]) - half - j * t // steps
        whole = centre + reach <= k
        if centre - reach >= k:
            break
        at = _highest(s, k, newest, centre - reach, centre + reach if whole else k)
        if whole or at < k:
            low = _lowest(s, k, newest, max(at - half, int(s[FIRST])), min(at + half, k))
            found.append((float(at), s[newest - k + at] - low, whole))
    return found


def _tops(s: State) -> list[Likely]:
    """Return the samples that rise above all near them, as far back as a period that is found now would count them."""
    k, length, steps = int(s[NEXT]) - 1, int(s[LENGTH]), int(s[N])
    near = int(s[T_MIN]) // (4 * steps)
    span = min(int(SEARCHED * s[T_MAX]), k - int(s[FIRST]) + 1)
    newest = RING + length + (int(s[PLACE]) - 1) % length
    seen = s[newest - span + 1 : newest + 1]
    least = sqrt(s[IDLE])
    if span <= near or max(seen) - min(seen) < least:
        return []
    found: list[Likely] = []
    from_ = max(near, int(s[LAST] + NEAREST * s[T_MIN] / steps) - k + span) if s[BOUT_STEPS] > 0.0 else near
    for i in range(from_, span - 1):
        v = seen[i]
        if v > seen[i - 1] and v >= seen[i + 1] and v == max(seen[i - near : i + near + 1]):
            low = min(seen[max(i - 2 * near, 0) : i + 2 * near + 1])
            if v - low >= least:
                found.append((float(k - span + 1 + i), v - low, False))
    return found


def _judge(s: State, k: int, newest: int, out: State, rows: int) -> int:
    """Judge the period that ends with sample `k`, at `newest` in the ring, and say which one comes next."""
    if s[PERIOD] > 0.0 and k - s[LAST] > s[PATIENCE]:
        s[PERIOD] = 0.0
    t = _period(s, newest, k - int(s[FIRST]) + 1)
    if t > 0:
        s[PERIOD] = float(t)
        return _steps(s, k, newest, t, out, rows)
    s[RHYTHM] = 0.0
    s[DUE] = k + s[HOP]
    return rows


def _period(s: State, newest: int, seen: int) -> int:
    """Return the lag (2) of the current period; 0 where it is idle, or like none before it."""
    shortest, longest, window = int(s[T_MIN]), int(s[T_MAX]), int(s[T_MAX])
    if s[PERIOD] > 0.0:
        window = int(s[PERIOD])
        shortest, longest = max(shortest, window - int(s[LOCK])), min(longest, window + int(s[LOCK]))
    longest = min(longest, seen // 2)
    if longest < shortest or _idle(s, newest, min(window, seen)):
        return 0
    return _likest(s, newest, shortest, longest)


def _idle(s: State, newest: int, window: int) -> bool:
    """Tell whether the variance over the last `window` samples is that of rest."""
    total = squares = 0.0
    for i in range(newest - window + 1, newest + 1):
        v = s[i]
        total += v
        squares += v * v
    return window * squares - total * total < s[IDLE] * (window * window)


def _likest(s: State, newest: int, shortest: int, longest: int) -> int:
    """Return the lag whose ρ (1) is largest, the shortest of equals, or 0 where none is above `RHO_MIN`."""
    now = now2 = both = both2 = 0.0
    for i in range(newest, newest - 2 * shortest, -1):
        v = s[i]
        both += v
        both2 += v * v
        if i == newest - shortest + 1:
            now, now2 = both, both2
    best, lag = s[RHO_MIN], 0
    for t in range(shortest, longest + 1):
        before, before2, still = both - now, both2 - now2, STILL * (t * t)
        spread, spread_before = t * now2 - now * now, t * before2 - before * before
        if spread > still and spread_before > still:
            rho = (t * _product(s, newest, t) - now * before) / sqrt(spread * spread_before)
            if rho > best + EQUAL:
                best, lag = rho, t
        u, v, w = s[newest - t], s[newest - 2 * t], s[newest - 2 * t - 1]
        now += u
        now2 += u * u
        both += v + w
        both2 += v * v + w * w
    return lag


def _product(s: State, newest: int, t: int) -> float:
    """Return the sum over the current period of each magnitude times the one a period before it."""
    a = b = c = d = 0.0
    first = newest - t + 1
    whole = t // 4 * 4
    for i in range(first, first + whole, 4):
        a += s[i] * s[i - t]
        b += s[i + 1] * s[i + 1 - t]
        c += s[i + 2] * s[i + 2 - t]
        d += s[i + 3] * s[i + 3 - t]
    for i in range(first + whole, newest + 1):
        a += s[i] * s[i - t]
    return a + b + c + d


def _steps(s: State, k: int, newest: int, t: int, out: State, rows: int) -> int:
    """Find the crests of a period of `t` samples that is walking, count the new ones, centre the next period."""
    steps = int(s[N])
    half = t // (2 * steps)
    reach = half // 2
    latest = k - half
    periods = 1
    if s[RHYTHM] == 0.0:
        latest = _highest(s, k, newest, latest - t // steps + 1, latest)
        periods = 2 if s[CREDIT] > 0.0 else 1
    at = latest
    for j in range(periods * steps - 1, -1, -1):
        centre = latest - j * t // steps
        if centre - reach < s[FIRST]:
            continue
        at = _highest(s, k, newest, centre - reach, centre + reach)
        if s[BOUT_STEPS] > 0.0 and at - s[LAST] < NEAREST * t / steps:
            continue
        peak = s[newest - k + at]
        valley = _lowest(s, k, newest, max(at - half, int(s[FIRST])), min(at + half, k))
        if peak > valley:  # not where all is flat, nor where a sample is NaN
            rows = _step(s, float(at), peak, valley, out, rows)
    s[RHYTHM] = 1.0
    s[DUE] = float(max(at + half + t, k + 1))
    return rows


def _highest(s: State, k: int, newest: int, first: int, last: int) -> int:
    """Return the index of the first highest of samples `first` to `last`."""
    shift, at = newest - k, first
    for i in range(first + 1, last + 1):
        if s[shift + i] > s[shift + at]:
            at = i
    return at


def _lowest(s: State, k: int, newest: int, first: int, last: int) -> float:
    """Return the lowest magnitude of samples `first` to `last`."""
    shift, low = newest - k, s[newest - k + first]
    for i in range(first + 1, last + 1):
        if s[shift + i] < low:  # noqa: PLR1730  # numba's `min` and Python's treat NaN differently
            low = s[shift + i]
    return low


def _step(s: State, at: float, peak: float, valley: float, out: State, rows: int) -> int:
    """Write a step once its bout is certain."""
    spacing, over_gap = at - s[LAST], s[LAST] < s[FIRST]
    if s[BOUT_STEPS] == 0.0 or (spacing >= BRIDGE if over_gap else spacing > s[PATIENCE]):
        s[BOUT_STEPS] = spacing = 0.0
    elif over_gap:
        spacing = 0.0  # how many steps the gap hides is unknown
    s[LAST] = at
    s[BOUT_STEPS] += 1.0
    if s[BOUT_STEPS] > s[BOUT]:
        return _row(out, rows, at, spacing, peak, valley)
    last = HELD + (int(s[BOUT_STEPS]) - 1) * ROW
    _row(s, last, at, spacing, peak, valley)
    if s[BOUT_STEPS] < s[BOUT]:
        return rows
    if s[CREDIT] == 0.0:
        return _row(out, rows, at, 0.0, peak, valley)
    for i in range(HELD, last + ROW):
        out[rows] = s[i]
        rows += 1
    return rows


def _row(out: State, rows: int, at: float, spacing: float, peak: float, valley: float) -> int:
    out[rows], out[rows + 1], out[rows + 2], out[rows + 3] = at, spacing, peak, valley
    return rows + ROW
