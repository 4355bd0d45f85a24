"""Accelerometer, gyroscope and magnetometer as scalar kernels over one flat state: plain while live, or compiled.

`begin` opens a stretch, `scan` filters its samples and finds extrema in time, `close` decides what is left; `fusion`
says what they compute and why. `fusion_state` lays the state out, `fusion_steps` makes steps of peaks and valleys and
writes them as rows. Only what numba and Python compute to the same bits is used: `+ − × ÷`, comparisons, `sqrt`, `sin`
and `atan2`.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

from service.counters.fusion_ahead import coming_peaks
from service.counters.fusion_checks import (
    CHANNELS,
    DEPTH,
    EAST,
    NORTH,
)
from service.counters.fusion_state import (
    A1,
    A2,
    ACCEPTED,
    AT,
    AXES,
    BANK,
    BEFORE,
    BEFORE_LAST,
    BOUT,
    BOUT_STEPS,
    DELAY,
    DUE,
    FILTER,
    FIRST,
    FIRST_HALF,
    HALF,
    HELD,
    KIND,
    LAGS,
    LATEST,
    MATCHED,
    MAX_STEP,
    MOTION,
    NEVER,
    NEXT,
    ORIENTATION,
    PAUSE,
    PEAK,
    PEAK_AT,
    PEAK_VALUE,
    PERIOD,
    PREVIOUS,
    RAW,
    REJECT,
    REST,
    ROW,
    TUNED_TO,
    UPDATE,
    VALLEY,
    VALLEY_VALUE,
    VALUE,
    Y1,
    Y2,
    Floats,
    State,
)
from service.counters.fusion_steps import end_bout, take_pair
from service.samples import Likely
from service.signals.orientation import advance, horizontal
from service.signals.orientation import begin as begin_orientation

MOST: Final = 1e12
"""Sum of the squares of a sample in g, rad/s and µT: a million of each is no measurement."""

SWING_REJECT: Final = 0.5
"""(5): a half-step by the swing is no guess that a bump can have spoilt, so the share need not be milder."""


def begin(
    s: State,
    index: int,
    ax: float,
    ay: float,
    az: float,
    gx: float,
    gy: float,
    gz: float,
    mx: float,
    my: float,
    mz: float,
) -> None:
    """Open a stretch at grid index `index`, whose first sample stands for those before it; a certain bout goes on."""
    if s[BOUT_STEPS] < s[BOUT]:
        end_bout(s)
    if not _measured(ax, ay, az, gx, gy, gz, mx, my, mz):
        ax, ay, az, gx, gy, gz, mx, my, mz = 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    norm = sqrt(ax * ax + ay * ay + az * az)
    s[FIRST] = s[NEXT] = float(index)
    s[A1] = s[A2] = norm
    s[VALLEY_VALUE] = NEVER
    _forget(s)
    s[PREVIOUS] = s[BEFORE_LAST] = s[MATCHED] = -1.0
    s[PERIOD] = 0.0
    begin_orientation(s, ORIENTATION, ax, ay, az, mx, my, mz)
    first = (ax, ay, az, gx, gy, gz, mx, my, mz)
    for axis in range(AXES):
        s[Y1 + axis] = s[Y2 + axis] = first[axis]
        for lag in range(LAGS):
            s[RAW + lag * AXES + axis] = first[axis]


def scan(
    ax: Floats,
    ay: Floats,
    az: Floats,
    gx: Floats,
    gy: Floats,
    gz: Floats,
    mx: Floats,
    my: Floats,
    mz: Floats,
    n: int,
    s: State,
    out: State,
) -> int:
    """Eat n samples (g, rad/s, µT); write the filtered norm to `out[:n]`, rows after it; return where they end."""
    k, older, last, rows = int(s[NEXT]), s[A2], s[A1], n
    earliest = int(s[FIRST] + s[DELAY]) + 1
    for i in range(n):
        a, b, c, d, e, f, g, h, m = ax[i], ay[i], az[i], gx[i], gy[i], gz[i], mx[i], my[i], mz[i]
        slot = RAW + k % LAGS * AXES
        if not _measured(a, b, c, d, e, f, g, h, m):  # the sample before stands for it
            q = RAW + (k - 1) % LAGS * AXES
            a, b, c, d, e = s[q], s[q + 1], s[q + 2], s[q + 3], s[q + 4]
            f, g, h, m = s[q + 5], s[q + 6], s[q + 7], s[q + 8]
        s[slot], s[slot + 1], s[slot + 2] = a, b, c
        s[slot + 3], s[slot + 4], s[slot + 5] = d, e, f
        s[slot + 6], s[slot + 7], s[slot + 8] = g, h, m
        _filter(s, k)
        motion = MOTION + k % DEPTH * CHANNELS
        for axis in range(6):
            s[motion + axis] = s[Y1 + 3 + axis]
        advance(s, ORIENTATION, a, b, c, d, e, f, g, h, m)
        s[motion + NORTH], s[motion + EAST] = horizontal(s, ORIENTATION, a, b, c)
        x, y, z = s[Y1], s[Y1 + 1], s[Y1 + 2]
        norm = sqrt(x * x + y * y + z * z)
        out[i] = norm
        if k > earliest:
            if older < last and last > norm:
                rows = _extremum(s, PEAK, float(k - 1), last, out, rows)
            elif older > last and last < norm:
                rows = _extremum(s, VALLEY, float(k - 1), last, out, rows)
        older, last = last, norm
        if k >= s[DUE]:
            rows = _final(s, k, out, rows)
        k += 1
    s[NEXT], s[A2], s[A1] = float(k), older, last
    return rows


def _measured(a: float, b: float, c: float, d: float, e: float, f: float, g: float, h: float, m: float) -> bool:
    """Tell whether these are values of a sensor: a NaN or an infinity would stay in the filters for ever."""
    return a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + m * m < MOST


def close(s: State, out: State) -> int:
    """End the stretch: the last extremum is what it is; write rows to `out[0:]` and return where they end."""
    rows = 0
    if s[DUE] < NEVER:
        rows = _final(s, int(s[NEXT]) - 1, out, rows)
    return rows


def stop(s: State) -> None:
    """End the stream: belief of a bout is dropped."""
    s[NEXT] = -1.0
    end_bout(s)


def likely(s: State) -> list[Likely]:
    """Return every peak that can still become a step: index, height, and whether it passes what is in force.

    Those are the held ones of a bout that can still become certain, the last peak, and those that the filter is about
    to let out. One passes if it rises by more than rest above its valley, or above the one before as long as its own
    has not come.
    """
    found: list[Likely] = []
    at, value, valley = s[PEAK_AT], s[PEAK_VALUE], s[VALUE]
    if s[KIND] == PEAK:
        at, value, valley = s[AT], s[VALUE], s[VALLEY_VALUE]
    waits = s[KIND] != 0.0 and at >= 0.0 and (s[KIND] == VALLEY or s[NEXT] - at <= s[PAUSE] + 1.0)
    newest = at if waits else s[NEXT] - 2.0
    if 0.0 < s[BOUT_STEPS] < s[BOUT] and min(newest, s[NEXT] - 2.0) - s[ACCEPTED] < s[MAX_STEP]:
        for i in range(int(s[BOUT_STEPS])):
            held = HELD + i * ROW
            found.append((s[held], s[held + 2] - s[held + 3], True))
    if waits:
        height = value - valley
        found.append((at, height if 0.0 < height < value else 0.0, height > s[REST]))
    if s[NEXT] >= 0.0:
        valley = s[VALUE] if s[KIND] == VALLEY else s[VALLEY_VALUE]
        for coming, value in coming_peaks(s):
            passes = s[KIND] == VALLEY and value - valley > s[REST]
            found.append((coming, value - valley if valley < value else 0.0, passes))
    return found


def _filter(s: State, k: int) -> None:
    """Low-pass the nine columns by the filter in force, each input so late that all five lag alike."""
    bank = BANK + int(s[TUNED_TO] - 1.0) * FILTER
    lag, b0, a1, a2 = k - int(s[bank]), s[bank + 1], s[bank + 2], s[bank + 3]
    r0, r1, r2 = RAW + lag % LAGS * AXES, RAW + (lag - 1) % LAGS * AXES, RAW + (lag - 2) % LAGS * AXES
    for axis in range(AXES):
        before = s[Y1 + axis]
        x = b0 * (s[r0 + axis] + 2.0 * s[r1 + axis] + s[r2 + axis])
        s[Y1 + axis] = x - a1 * before - a2 * s[Y2 + axis]
        s[Y2 + axis] = before


def _extremum(s: State, kind: float, at: float, value: float, out: State, rows: int) -> int:
    """Apply the time filter (4)–(8): reject an extremum too soon, replace the last by a more extreme one, or add it."""
    since = at - s[AT]
    if s[KIND] != 0.0 and since > s[PAUSE]:
        rows = _final(s, int(at), out, rows)
        _forget(s)
    if s[KIND] == kind:
        if s[DUE] < NEVER and kind * value > kind * s[VALUE]:
            s[AT], s[VALUE] = at, value
            if s[BEFORE] >= 0.0:
                s[HALF] = at - s[BEFORE]
        return rows
    if s[KIND] == 0.0:
        since = s[HALF]
    else:
        if since <= _too_soon(s, at) and since <= s[LATEST]:
            return rows
        rows = _final(s, int(at), out, rows)
        s[BEFORE], s[HALF] = s[AT], since
    s[KIND], s[AT], s[VALUE] = kind, at, value
    s[DUE] = at + s[UPDATE] * since
    return rows


def _too_soon(s: State, at: float) -> float:
    """Return th_s (5), from the swing's time of a step where it is known: then the share is the printed one."""
    if s[PERIOD] > 0.0 and at - s[PREVIOUS] < s[MAX_STEP]:
        return SWING_REJECT * 0.5 * s[PERIOD]
    return s[REJECT] * s[HALF]


def _final(s: State, now: int, out: State, rows: int) -> int:
    """Take the last event as final; a valley ends the pair of the peak before it."""
    if s[DUE] >= NEVER:
        return rows
    s[DUE] = NEVER
    if s[KIND] == PEAK:
        s[PEAK_AT], s[PEAK_VALUE] = s[AT], s[VALUE]
        return rows
    s[VALLEY_VALUE] = s[VALUE]
    if s[PEAK_AT] >= 0.0 and s[PEAK_VALUE] - s[VALUE] > s[REST]:
        rows = take_pair(s, now, out, rows)
    s[PEAK_AT] = -1.0
    return rows


def _forget(s: State) -> None:
    """Start the time filter afresh: after a pause Δt₁ is the initial one."""
    s[KIND], s[AT], s[VALUE], s[DUE] = 0.0, -1.0, 0.0, NEVER
    s[PEAK_AT] = s[BEFORE] = -1.0
    s[HALF] = s[FIRST_HALF]
