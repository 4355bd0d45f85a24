"""What the fusion counter asks of the last seconds of motion when a step is to be decided; `fusion` says why.

The motion is a ring of `DEPTH` samples in the state from offset `o` on, `CHANNELS` floats each: filtered angular rate
(rad/s) and field (µT) in the body's frame, and the horizontal acceleration (g) to the north and to the east. Samples
are named by their grid index; a span `first` … `last` holds both ends and is younger than the ring is deep.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, sqrt
from typing import Final

DEPTH: Final = 256
"""Samples: the longest step (100), the wait for its valley (121) and the filters' delay (8) have room in it."""
CHANNELS: Final = 8
GYROSCOPE: Final = 0
MAGNETOMETER: Final = 3
NORTH: Final = 6
EAST: Final = 7

DT_S: Final = 0.02
M_S2: Final = 9.80665
"""One g in m/s²."""

State = Sequence[float]


def value(s: State, o: int, channel: int, k: int) -> float:
    """Return a channel's value at sample k."""
    return s[o + k % DEPTH * CHANNELS + channel]


def variance(s: State, o: int, channel: int, first: int, last: int) -> float:
    """Return the variance of a channel over a span."""
    total = square = 0.0
    base = value(s, o, channel, first)
    for k in range(first, last + 1):
        x = value(s, o, channel, k) - base
        total += x
        square += x * x
    n = float(last - first + 1)
    return square / n - total / n * (total / n)


def main_axis(s: State, o: int, sensor: int, first: int, last: int) -> int:
    """Return the channel of the sensor's axis that varies most over a span."""
    best, most = sensor, variance(s, o, sensor, first, last)
    for channel in range(sensor + 1, sensor + 3):
        found = variance(s, o, channel, first, last)
        if found > most:
            best, most = channel, found
    return best


def has_extremum(s: State, o: int, channel: int, first: int, last: int) -> bool:
    """Tell whether the channel has a three-point extremum (3) of either sign at a sample of the span."""
    before = value(s, o, channel, first - 1)
    x = value(s, o, channel, first)
    for k in range(first, last + 1):
        after = value(s, o, channel, k + 1)
        if (before < x and x > after) or (before > x and x < after):
            return True
        before, x = x, after
    return False


def correlation(s: State, o: int, channel: int, first: int, last: int, lag: int) -> float:
    """Return the normalised correlation of a span with the one `lag` samples before it; 0 where one is flat."""
    a = b = aa = bb = ab = 0.0
    for k in range(first, last + 1):
        x, y = value(s, o, channel, k), value(s, o, channel, k - lag)
        a += x
        b += y
        aa += x * x
        bb += y * y
        ab += x * y
    n = float(last - first + 1)
    spread = (aa - a * a / n) * (bb - b * b / n)
    if spread <= 0.0:
        return 0.0
    return (ab - a * b / n) / sqrt(spread)


def field_movement(s: State, o: int, first: int, last: int) -> float:
    """Return by how large a share of its mean the field's norm (13) moves over a span (14)."""
    least = most = total = 0.0
    for k in range(first, last + 1):
        x = value(s, o, MAGNETOMETER, k)
        y = value(s, o, MAGNETOMETER + 1, k)
        z = value(s, o, MAGNETOMETER + 2, k)
        norm = sqrt(x * x + y * y + z * z)
        if k == first or norm < least:
            least = norm
        if k == first or norm > most:
            most = norm
        total += norm
    if total <= 0.0:
        return 1.0
    return (most - least) * float(last - first + 1) / total


def direction(s: State, o: int, first: int, last: int) -> float:
    """Return the line along which the horizontal acceleration of a span moves, by least squares of the distances to it.

    Radians from north towards east in (−π/2, π/2]: a line has no front. 0 where there is no motion.
    """
    n = e = nn = ee = ne = 0.0
    for k in range(first, last + 1):
        x, y = value(s, o, NORTH, k), value(s, o, EAST, k)
        n += x
        e += y
        nn += x * x
        ee += y * y
        ne += x * y
    count = float(last - first + 1)
    return 0.5 * atan2(2.0 * (ne - n * e / count), (nn - n * n / count) - (ee - e * e / count))


def displacement_m(s: State, o: int, first: int, last: int) -> tuple[float, float]:
    """Return the double integral (16) of the horizontal acceleration over a span, from rest: m to the north and east.

    v_k = v_{k−1} + a_k Δt, d_k = d_{k−1} + v_k Δt, as the document writes it.
    """
    vn = ve = dn = de = 0.0
    for k in range(first + 1, last + 1):
        vn += value(s, o, NORTH, k) * M_S2 * DT_S
        ve += value(s, o, EAST, k) * M_S2 * DT_S
        dn += vn * DT_S
        de += ve * DT_S
    return dn, de
