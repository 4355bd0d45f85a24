"""Ways to make one recording into many: other paces, sensors, rates, places and arms; a walk stays a walk.

Each takes and gives n × 3 acceleration in g at 50 Hz. The arm swing makes of a recording at the body one at the wrist.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.samples import GRID_HZ

Floats = NDArray[np.float64]
Rng = np.random.Generator

STANDARD_G: Final = 9.80665
RATES_HZ: Final = (32.0, 25.0, 20.0, 15.0, 12.5)
FULL_SCALE_G: Final = 2.0


def stretched(acc_g: Floats, factor: float) -> Floats:
    """Return the same motion, `factor` times as fast."""
    n = len(acc_g)
    m = max(round(n / factor), 2)
    return _at(acc_g, np.linspace(0.0, n - 1, m))


def pace(rng: Rng) -> tuple[float, float]:
    """Return how much faster a motion is to be, and how much stronger: a walk becomes a slow one, a fast one or a run.

    Most stay near what they were. What is much faster is stronger, as in a run, and what is much slower is weaker.
    """
    kind = rng.random()
    if kind < 0.2:
        return 1.0, 1.0
    if kind < 0.72:
        return float(np.exp(rng.uniform(np.log(0.78), np.log(1.28)))), 1.0
    if kind < 0.84:
        return rng.uniform(1.28, 1.7), rng.uniform(1.3, 3.0)
    return rng.uniform(0.5, 0.78), rng.uniform(0.4, 1.0)


def strengthened(acc_g: Floats, factor: float) -> Floats:
    """Return it with all that is not its mean `factor` times as strong."""
    mean = acc_g.mean(axis=0)
    return np.asarray(mean + (acc_g - mean) * factor)


def _at(acc_g: Floats, places: Floats) -> Floats:
    base = np.clip(places.astype(np.intp), 0, len(acc_g) - 2)
    part = (places - base)[:, None]
    first: Floats = acc_g[base]
    return first + (acc_g[base + 1] - first) * part


def at_rate(acc_g: Floats, rate_hz: float, rng: Rng) -> Floats:
    """Return what a sensor of another rate would have sent, put on the grid again."""
    n = len(acc_g)
    step = GRID_HZ / rate_hz
    taken = np.arange(rng.uniform(0.0, step), n - 1, step)
    if len(taken) < 2:
        return acc_g
    coarse = _at(acc_g, taken)
    return np.column_stack([np.interp(np.arange(n), taken, coarse[:, axis]) for axis in range(3)])


def rotation(rng: Rng) -> Floats:
    """Return a random turn, uniform over all of them."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) < 0.0:
        q[:, 0] = -q[:, 0]
    return np.asarray(q)


def turn_onto(start: Floats, end: Floats) -> Floats:
    """Return the shortest turn that brings the direction `start` to `end`: v @ turn."""
    a, b = start / max(float(np.linalg.norm(start)), 1e-9), end / max(float(np.linalg.norm(end)), 1e-9)
    c = float(a @ b)
    if c < -0.999999:
        other = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 1.0, 0.0])
        other /= np.linalg.norm(other)
        return np.asarray(2.0 * np.outer(other, other) - np.eye(3))
    v = np.cross(a, b)
    k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray((np.eye(3) + k + k @ k / (1.0 + c)).T)


def with_arm_swing(acc_g: Floats, step_s: Floats, rng: Rng) -> Floats:
    """Hang a recording at the body on an arm that swings once in two steps; `step_s` are its steps, in seconds.

    The arm turns the body's acceleration (softened on its way) and adds the centripetal and tangential terms of its
    own motion: gravity (0, 0, 1) becomes (sin θ, 0, cos θ).
    """
    n = len(acc_g)
    t_s = np.arange(n) / GRID_HZ
    mean = acc_g.mean(axis=0)
    body = (acc_g @ turn_onto(mean, np.array([0.0, 0.0, 1.0]))) @ _spin(rng.uniform(0.0, 2 * np.pi))
    still = np.array([0.0, 0.0, float(np.linalg.norm(mean))])
    body = still + (body - still) * rng.uniform(0.4, 1.0)
    angle = _swing(t_s, step_s, rng)
    rate = np.gradient(angle, 1.0 / GRID_HZ)
    turning = np.gradient(rate, 1.0 / GRID_HZ)
    radius = rng.uniform(0.25, 0.6) / STANDARD_G
    sin, cos = np.sin(angle), np.cos(angle)
    x = body[:, 0] * cos + body[:, 2] * sin + radius * turning
    z = body[:, 2] * cos - body[:, 0] * sin + radius * rate * rate
    return np.column_stack([x, body[:, 1], z])


def _spin(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _swing(t_s: Floats, step_s: Floats, rng: Rng) -> Floats:
    """Return the arm's angle: half a turn of phase a step, of a size that drifts, still where nobody steps."""
    if len(step_s) < 2:
        return np.full(len(t_s), rng.uniform(-0.5, 0.5))
    phase = np.pi * np.interp(t_s, step_s, np.arange(len(step_s)))
    size = np.deg2rad(np.exp(rng.uniform(np.log(3.0), np.log(35.0))))
    knots = np.arange(0.0, t_s[-1] + 6.0, 5.0)
    drift = np.interp(t_s, knots, np.exp(0.25 * rng.standard_normal(len(knots))))
    after = np.searchsorted(step_s, t_s)
    gap = step_s[np.clip(after, 1, len(step_s) - 1)] - step_s[np.clip(after, 1, len(step_s) - 1) - 1]
    stepping = ((t_s >= step_s[0]) & (t_s <= step_s[-1]) & (gap < 1.5)).astype(np.float64)
    eased = np.convolve(stepping, np.hanning(41) / np.hanning(41).sum(), mode="same")
    lag, second = rng.uniform(-0.8, 0.8), rng.uniform(0.0, 0.25)
    shape = np.sin(phase + lag) + second * np.sin(2 * phase + rng.uniform(0.0, 2 * np.pi))
    bend = rng.uniform(0.0, 1.3) if rng.random() < 0.4 else rng.uniform(-0.3, 0.3)
    return np.asarray(size * drift * eased * shape + bend)


def roughened(acc_g: Floats, rng: Rng) -> Floats:
    """Return it with the rattle of a loose strap or pocket: noise, strong where the motion is.

    Wearables of 12.5 to 32 Hz measure none, and without it their walks would teach that a walk has none.
    """
    strength = np.abs(np.diff(acc_g, axis=0, prepend=acc_g[:1])).sum(axis=1, keepdims=True)
    return np.asarray(
        acc_g + np.exp(rng.uniform(np.log(0.05), np.log(0.8))) * strength * rng.standard_normal(acc_g.shape)
    )


def exercise(duration_s: float, rng: Rng) -> Floats:
    """Return what a wrist measures while its arm turns to and fro in a rhythm, and nobody steps.

    The arm turns about two axes; the wrist, at the end of a radius, feels gravity turn and its own motion. What a step
    adds is not there: the body's bounce.
    """
    n = round(duration_s * GRID_HZ)
    t_s = np.arange(n) / GRID_HZ
    rate_hz = np.exp(rng.uniform(np.log(0.25), np.log(4.0)))
    knots = np.arange(0.0, duration_s + 6.0, 4.0)
    drift = np.interp(t_s, knots, np.exp(0.08 * rng.standard_normal(len(knots))))
    phase = 2 * np.pi * np.cumsum(rate_hz * drift) / GRID_HZ
    size = np.interp(t_s, knots, np.exp(0.2 * rng.standard_normal(len(knots))) * (rng.random(len(knots)) > 0.12))
    radius_m = rng.uniform(0.1, 0.7)
    strongest = rng.uniform(0.1, 1.5) * STANDARD_G / (radius_m * (2 * np.pi * rate_hz) ** 2)
    swing = min(np.exp(rng.uniform(np.log(0.1), np.log(1.4))), strongest)
    second = rng.uniform(0.0, 0.3)
    shape = np.sin(phase) + second * np.sin(2 * phase + rng.uniform(0.0, 2 * np.pi))
    other = rng.uniform(0.0, 0.7) * np.sin(phase + rng.uniform(0.0, 2 * np.pi))
    first, across = swing * size * shape + rng.uniform(-1.0, 1.0), swing * size * other
    up = np.stack([np.sin(first) * np.cos(across), np.sin(across), np.cos(first) * np.cos(across)], axis=1)
    moved = -radius_m * np.gradient(np.gradient(up, 1.0 / GRID_HZ, axis=0), 1.0 / GRID_HZ, axis=0) / STANDARD_G
    felt = moved @ rotation(rng) + [0.0, 0.0, 1.0]
    cos, sin = np.cos(first), np.sin(first)
    x, y, z = felt.T
    turned = np.stack([x * cos - z * sin, y, z * cos + x * sin], axis=1)
    c, s = np.cos(across), np.sin(across)
    x, y, z = turned.T
    tremor = rng.uniform(0.0, 0.03) * rng.standard_normal((n, 3))
    return np.stack([x, y * c - z * s, z * c + y * s], axis=1) + tremor


def as_sensed(acc_g: Floats, rng: Rng) -> Floats:
    """Return it as another sensor would have given it: gain, offset, noise, rate, bits, range."""
    out = acc_g * (1.0 + 0.08 * rng.standard_normal()) if rng.random() < 0.5 else acc_g
    if rng.random() < 0.4:
        out = out * (1.0 + 0.03 * rng.standard_normal(3)) + 0.03 * rng.standard_normal(3)
    if rng.random() < 0.3:
        out = at_rate(out, float(rng.choice(RATES_HZ)), rng)
    if rng.random() < 0.35:
        out = roughened(out, rng)
    if rng.random() < 0.5:
        out = out + rng.uniform(0.0, 0.03) * rng.standard_normal(out.shape)
    if rng.random() < 0.3:
        unit = 2.0 ** rng.integers(-6, -3)
        out = np.round(out / unit) * unit
    if rng.random() < 0.15:
        out = np.clip(out, -FULL_SCALE_G, FULL_SCALE_G)
    return out
