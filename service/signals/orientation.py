"""Which way is up and which is north, as a kernel: two directions in the body's frame, turned by the gyroscope.

A complementary filter on vector observations, as Mahony, Hamel and Pflimlin (IEEE Trans. Automat. Contr. 53(5), 2008,
doi 10.1109/TAC.2008.923738) have it, short because it carries the two vectors themselves and no quaternion: a direction
v fixed in the world is seen by the body as dv/dt = −ω × v, and is drawn towards what is measured with weight Δt/τ.
`up` is drawn to the acceleration in g, unscaled: over a step the body's own acceleration is nearly zero in the mean.
`north` is drawn to the horizontal part of the field, unless the field's norm leaves its mean by a share: then something
magnetic is near, and the gyroscope alone carries north on. Both weights are 1/k in a stretch's first k samples, so that
it starts from the mean of what it saw and not from its first sample.

The state is `SIZE` floats of a larger one from offset `o` on; `begin` and `advance` change it, `horizontal` reads it.
Without a field (all zeros) `north` is an arbitrary, steady direction. Only `+ − × ÷`, comparisons and `sqrt`.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from math import sqrt
from typing import Final

UP: Final = 0  # three floats: the unit vector that a body at rest measures as +1 g
NORTH: Final = 3  # three floats: horizontal, magnetic north
AGE: Final = 6  # samples since `begin`
FIELD: Final = 7  # µT, mean norm of the field
SIZE: Final = 8

DT_S: Final = 0.02
"""Seconds a sample: the 50 Hz grid."""

UP_WEIGHT: Final = DT_S / 2.0
"""Δt/τ, τ = 2 s: longer than a stride, shorter than a gyroscope's offset needs to tilt `up` by a degree or two."""

NORTH_WEIGHT: Final = DT_S / 2.0
"""Δt/τ, τ = 2 s."""

FIELD_WEIGHT: Final = DT_S / 5.0
"""Δt/τ, τ = 5 s: a device carried to another place takes its field as the usual one soon."""

FIELD_SHARE: Final = 0.15
"""The field's norm may leave its mean by this share (ours: the earth's own changes by under 1 % within a walk)."""

TINY: Final = 1e-12

State = MutableSequence[float]
Three = tuple[float, float, float]


def begin(s: State, o: int, ax: float, ay: float, az: float, mx: float, my: float, mz: float) -> None:
    """Start from one sample of acceleration (g) and field (µT), both in the body's frame."""
    s[o + UP], s[o + UP + 1], s[o + UP + 2] = _unit(ax, ay, az, 0.0, 0.0, 1.0)
    s[o + NORTH], s[o + NORTH + 1], s[o + NORTH + 2] = _level(s, o, mx, my, mz)
    s[o + AGE] = 1.0
    s[o + FIELD] = sqrt(mx * mx + my * my + mz * mz)


def advance(
    s: State,
    o: int,
    ax: float,
    ay: float,
    az: float,
    wx: float,
    wy: float,
    wz: float,
    mx: float,
    my: float,
    mz: float,
) -> None:
    """Go on by one grid sample of acceleration (g), angular rate (rad/s) and field (µT)."""
    s[o + AGE] += 1.0
    fresh = 1.0 / s[o + AGE]
    weight = max(UP_WEIGHT, fresh)
    x, y, z = _turned(s[o + UP], s[o + UP + 1], s[o + UP + 2], wx, wy, wz)
    x, y, z = x + weight * (ax - x), y + weight * (ay - y), z + weight * (az - z)
    s[o + UP], s[o + UP + 1], s[o + UP + 2] = _unit(x, y, z, s[o + UP], s[o + UP + 1], s[o + UP + 2])
    x, y, z = _turned(s[o + NORTH], s[o + NORTH + 1], s[o + NORTH + 2], wx, wy, wz)
    norm = sqrt(mx * mx + my * my + mz * mz)
    away = norm - s[o + FIELD]
    if away < 0.0:
        away = -away
    if away <= FIELD_SHARE * s[o + FIELD]:
        weight = max(NORTH_WEIGHT, fresh)
        nx, ny, nz = _level(s, o, mx, my, mz)
        x, y, z = x + weight * (nx - x), y + weight * (ny - y), z + weight * (nz - z)
    weight = max(FIELD_WEIGHT, fresh)
    s[o + FIELD] += weight * (norm - s[o + FIELD])
    s[o + NORTH], s[o + NORTH + 1], s[o + NORTH + 2] = _level(s, o, x, y, z)


def horizontal(s: State, o: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the north and east parts of a vector of the body's frame; gravity has neither."""
    nx, ny, nz = s[o + NORTH], s[o + NORTH + 1], s[o + NORTH + 2]
    ux, uy, uz = s[o + UP], s[o + UP + 1], s[o + UP + 2]
    east = x * (ny * uz - nz * uy) + y * (nz * ux - nx * uz) + z * (nx * uy - ny * ux)
    return x * nx + y * ny + z * nz, east


def _turned(x: float, y: float, z: float, wx: float, wy: float, wz: float) -> Three:
    """Return v − ω × v Δt + ω × (ω × v) Δt²/2: a direction of the world after the body turned for one sample.

    The first order alone stretches what is at right angles to ω, and an arm's 5 rad/s then tilt v by 5° in a second.
    """
    tx, ty, tz = DT_S * (wy * z - wz * y), DT_S * (wz * x - wx * z), DT_S * (wx * y - wy * x)
    return (
        x - tx + 0.5 * DT_S * (wy * tz - wz * ty),
        y - ty + 0.5 * DT_S * (wz * tx - wx * tz),
        z - tz + 0.5 * DT_S * (wx * ty - wy * tx),
    )


def _unit(x: float, y: float, z: float, ox: float, oy: float, oz: float) -> Three:
    """Return the vector at length 1, or the other one where it has next to none."""
    square = x * x + y * y + z * z
    if square < TINY:
        return ox, oy, oz
    length = sqrt(square)
    return x / length, y / length, z / length


def _level(s: State, o: int, x: float, y: float, z: float) -> Three:
    """Return the direction of the part of a vector at right angles to `up`; any such direction where it has none."""
    ux, uy, uz = s[o + UP], s[o + UP + 1], s[o + UP + 2]
    along = x * ux + y * uy + z * uz
    x, y, z = x - along * ux, y - along * uy, z - along * uz
    if x * x + y * y + z * z < TINY:
        if ux * ux < 0.5:
            x, y, z = 1.0 - ux * ux, -ux * uy, -ux * uz
        else:
            x, y, z = -uy * ux, 1.0 - uy * uy, -uy * uz
    return _unit(x, y, z, 1.0, 0.0, 0.0)
