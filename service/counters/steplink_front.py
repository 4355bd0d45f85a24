"""The front end of steplink's counter: five integers that say how the device moves, and four to find a rhythm in.

Per grid sample, causal: l is the acceleration below 5 Hz (second-order Butterworth), g the part below 0.3 Hz, an axis
each: gravity, whichever way the device is turned. Of every second sample (25 Hz):

| integer | what it is | place in a row |
| --- | --- | --- |
| magnitude | s(m − 1), m = ‖l‖ | 0 |
| vertical | s(v − 1), v = l·g/‖g‖ | 1 |
| horizontal | s(h), h = √(m² − v²) | 2 |
| change | s(2.5 ‖l[n] − l[n − 2]‖) | 3 |
| roughness | s(2 r), r the mean of two neighbouring norms of what lies above 6 Hz | 4 |
| rhythm | m and the three axes of l − g, plainly | 5 to 8 |

with s(u) = asinh(8 u)/2, so that a weak swing and a hard impact both fit; all in g. Integers, since sums of integers
are the same bits in whatever order they are taken: alone, in a batch, compiled. A sample that is no measurement counts
as the one before.

Only what numba and Python compute to the same bits is used: `+ − × ÷`, comparisons, `sqrt`, `log`, `floor`.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from functools import cache
from math import floor, log, sinh, sqrt
from typing import Final

from service.samples import GRID_HZ

SENSED: Final = 5
"""Integers of a row that the network sees."""
ROW: Final = 9
ROUGHNESS: Final = 4
"""Where it stands in a row."""
EVERY: Final = 2
"""Grid samples a row."""

UNIT: Final = 256.0
"""Of the integers, a unit of s; or a g, of those for the rhythm."""
SENSED_LIMIT: Final = 1023.0
SENSED_MOST: Final = sinh(2.0 * SENSED_LIMIT / UNIT)
"""8 u from which s(u) is the limit."""
RHYTHM_LIMIT: Final = 4095.0

LARGEST_G2: Final = 10_000.0
"""Squared g; no wearable measures more."""

LOW: Final = 0  # b₀, a₁, a₂ below 5 Hz (b₁ = 2 b₀, b₂ = b₀)
HIGH: Final = 3  # b₀, a₁, a₂ above 6 Hz (b₁ = −2 b₀, b₂ = b₀)
SLOW: Final = 6  # share of the new in g
CONSTANTS: Final = 7

ODD: Final = 7  # 1: the sample to come is the second of its pair
X: Final = 8  # the last sample that was a measurement
L1: Final = 11  # filter states, two an axis
H1: Final = 17
G: Final = 23
BEFORE: Final = 26  # l of the kept sample before
ROUGH: Final = 29  # norm above 6 Hz of the sample before
SIZE: Final = 30

State = MutableSequence[float]
Floats = Sequence[float]


def fresh() -> list[float]:
    """Return a state with its constants; `begin` makes it ready."""
    return [*_constants(), *[0.0] * (SIZE - CONSTANTS)]


@cache
def _constants() -> tuple[float, ...]:
    from scipy.signal import butter  # noqa: PLC0415  # slow to import, and only needed to build

    found: list[float] = []
    for b, a in (butter(2, 5.0, "low", fs=GRID_HZ), butter(2, 6.0, "high", fs=GRID_HZ)):
        found += [float(b[0]), float(a[1]), float(a[2])]
    b, _ = butter(1, 0.3, fs=GRID_HZ)
    return (*found, 2.0 * float(b[0]))


def begin(s: State, x: float, y: float, z: float) -> None:
    """Open a stretch: every filter as if the first sample had always been."""
    if not x * x + y * y + z * z < LARGEST_G2:
        x, y, z = 0.0, 0.0, 1.0
    b0, a2, h0 = s[LOW], s[LOW + 2], s[HIGH]
    s[ODD] = s[ROUGH] = 0.0
    for axis in range(3):
        v = x if axis == 0 else y if axis == 1 else z
        s[X + axis] = s[G + axis] = s[BEFORE + axis] = v
        s[L1 + 2 * axis] = v - b0 * v
        s[L1 + 2 * axis + 1] = b0 * v - a2 * v
        s[H1 + 2 * axis] = -h0 * v
        s[H1 + 2 * axis + 1] = h0 * v


def scan(x: Floats, y: Floats, z: Floats, n: int, s: State, trace: State, rows: State) -> int:  # noqa: PLR0915  # flat: saves six calls a sample
    """Eat n samples: write m of each to `trace` and the integers of every second to `rows`; return how many rows."""
    b0, a1, a2 = s[0], s[1], s[2]
    h0, c1, c2 = s[3], s[4], s[5]
    slow = s[6]
    odd = s[7]
    px, py, pz = s[8], s[9], s[10]
    lx1, lx2, ly1, ly2, lz1, lz2 = s[11], s[12], s[13], s[14], s[15], s[16]
    hx1, hx2, hy1, hy2, hz1, hz2 = s[17], s[18], s[19], s[20], s[21], s[22]
    gx, gy, gz = s[23], s[24], s[25]
    bx, by, bz, rough = s[26], s[27], s[28], s[29]
    end = 0
    for i in range(n):
        u, v, w = x[i], y[i], z[i]
        if u * u + v * v + w * w < LARGEST_G2:
            px, py, pz = u, v, w
        else:
            u, v, w = px, py, pz
        bu, bv, bw = b0 * u, b0 * v, b0 * w
        lx = bu + lx1
        lx1 = bu + bu - a1 * lx + lx2
        lx2 = bu - a2 * lx
        ly = bv + ly1
        ly1 = bv + bv - a1 * ly + ly2
        ly2 = bv - a2 * ly
        lz = bw + lz1
        lz1 = bw + bw - a1 * lz + lz2
        lz2 = bw - a2 * lz
        bu, bv, bw = h0 * u, h0 * v, h0 * w
        hx = bu + hx1
        hx1 = hx2 - bu - bu - c1 * hx
        hx2 = bu - c2 * hx
        hy = bv + hy1
        hy1 = hy2 - bv - bv - c1 * hy
        hy2 = bv - c2 * hy
        hz = bw + hz1
        hz1 = hz2 - bw - bw - c1 * hz
        hz2 = bw - c2 * hz
        gx += slow * (lx - gx)
        gy += slow * (ly - gy)
        gz += slow * (lz - gz)
        m2 = lx * lx + ly * ly + lz * lz
        m = sqrt(m2)
        trace[i] = m
        now = sqrt(hx * hx + hy * hy + hz * hz)
        if odd < 0.5:
            odd = 1.0
            rough = now
            continue
        odd = 0.0
        weight = sqrt(gx * gx + gy * gy + gz * gz)
        vertical = (lx * gx + ly * gy + lz * gz) / weight if weight > 0.0 else 0.0
        across = m2 - vertical * vertical
        ex, ey, ez = lx - bx, ly - by, lz - bz
        rows[end] = squashed(m - 1.0)
        rows[end + 1] = squashed(vertical - 1.0)
        rows[end + 2] = squashed(sqrt(across) if across > 0.0 else 0.0)
        rows[end + 3] = squashed(2.5 * sqrt(ex * ex + ey * ey + ez * ez))
        rows[end + 4] = squashed(now + rough)
        rows[end + 5] = counted(m)
        rows[end + 6] = counted(lx - gx)
        rows[end + 7] = counted(ly - gy)
        rows[end + 8] = counted(lz - gz)
        end += ROW
        bx, by, bz = lx, ly, lz
    s[7] = odd
    s[8], s[9], s[10] = px, py, pz
    s[11], s[12], s[13], s[14], s[15], s[16] = lx1, lx2, ly1, ly2, lz1, lz2
    s[17], s[18], s[19], s[20], s[21], s[22] = hx1, hx2, hy1, hy2, hz1, hz2
    s[23], s[24], s[25] = gx, gy, gz
    s[26], s[27], s[28], s[29] = bx, by, bz, rough
    return end // ROW


def squashed(u: float) -> float:
    """Return s(u) as an integer number of 1/UNIT."""
    w = 8.0 * u
    size = w if w > 0.0 else -w
    value = floor(0.5 * UNIT * log(size + sqrt(size * size + 1.0)) + 0.5) if size < SENSED_MOST else SENSED_LIMIT
    return value if w > 0.0 else -value


def counted(u: float) -> float:
    """Return u as an integer number of 1/UNIT."""
    value = floor(UNIT * u + 0.5)
    if -RHYTHM_LIMIT <= value <= RHYTHM_LIMIT:
        return value
    return RHYTHM_LIMIT if value > 0.0 else -RHYTHM_LIMIT
