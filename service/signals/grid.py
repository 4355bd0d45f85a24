"""The 50 Hz grid as a kernel: device samples at their places in grid units, linear interpolation between neighbours.

Every grid point k in (g of the previous sample, g of this one] lies between two samples and is emitted once; a point
within EPSILON of a sample takes its value as it is, so that a device that samples on the grid passes through
untouched. Linear, because the wearables' own rates (12.5 to 100 Hz) leave nothing in the step band that a longer
kernel would save, and because two samples are all the state it needs. Nothing is filtered before: what vibrates at more
than 25 Hz (0.3 g at 48 Hz in a 100 Hz stream, say, of a machine one leans on) folds down, and may be counted.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from service.samples import Column

START, FIRST, PACE, INDEX, PLACE, NEXT, X, Y, Z, SIZE = range(10)
"""State: grid place of sample FIRST, its index, grid units a sample, index of the next sample, grid place of the
previous sample, next grid point, values of the previous sample."""

EPSILON = 1e-6
"""Grid units (20 ns) within which a grid point is on a sample."""


def scan(
    x: Column,
    y: Column,
    z: Column,
    n: int,
    s: MutableSequence[float],
    out: MutableSequence[float],
) -> int:
    """Place n samples; write the grid points they complete into `out` (x, y, z by turns); return how many."""
    start, first, pace = s[START], s[FIRST], s[PACE]
    i, before, k = s[INDEX], s[PLACE], s[NEXT]
    px, py, pz = s[X], s[Y], s[Z]
    m = 0
    for j in range(n):
        place = start + (i - first) * pace
        cx, cy, cz = x[j], y[j], z[j]
        while k <= place + EPSILON:
            if place - k < EPSILON:
                out[m], out[m + 1], out[m + 2] = cx, cy, cz
            else:
                part = (k - before) / (place - before)
                out[m] = px + (cx - px) * part
                out[m + 1] = py + (cy - py) * part
                out[m + 2] = pz + (cz - pz) * part
            m += 3
            k += 1.0
        i += 1.0
        before = place
        px, py, pz = cx, cy, cz
    s[INDEX], s[PLACE], s[NEXT] = i, before, k
    s[X], s[Y], s[Z] = px, py, pz
    return m // 3
