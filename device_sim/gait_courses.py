"""Segments laid out: when the steps fall, and what the arm's acceleration and attitude are at any time.

A course gives acceleration in g along the hanging arm's forward, sideways and upward directions, and the angle by
which it is turned. Both are functions of time alone, so that samples may be asked for in any portions and at any rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from device_sim.gait_profiles import MOTIONS, STEPPING_ROUGH_RAD_S, Gait, Motion
from device_sim.gait_schedule import Segment
from service.recordings.recording import STANDARD_GRAVITY

Floats = NDArray[np.float64]

_DIFFERENCE_S: Final = 0.005
"""Step of the central differences that give the arm's angular rate and acceleration."""
_SD_LIMIT: Final = 2.5
"""Variations beyond this many standard deviations are cut: an interval must stay positive."""
_SWING_GAIN: Final = 0.5
"""Share of the full arm swing gained with each step after a segment's first, and lost before its last; ours."""
_KNOCKS_HZ: Final = 3.0
_KNOCK_GROUP: Final = (3, 5)
"""Three knocks, then a pause of two."""
_RING_HZ: Final = 12.0
_RING_S: Final = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class Wearer:
    """`strength` scales impacts, `arm_m` is the length from shoulder to sensor, `gaits` the row of each gait."""

    strength: float
    arm_m: float
    gaits: Mapping[str, Gait]


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One segment: the times of its steps, the white noise of its motion, and the acceleration (n×3) at n times.

    `turn_rad` gives at n times the angle by which the arm is turned from hanging, towards `turn_to`, a unit vector in
    the plane of forward and sideways; `rough_rad_s` is the white part of its angular rate.
    """

    step_t_s: Floats
    rough_g: float
    rough_rad_s: float
    arm_g: Callable[[Floats], Floats]
    turn_rad: Callable[[Floats], Floats]
    turn_to: tuple[float, float]

    def rate_rad_s(self, t_s: Floats) -> Floats:
        """Return the angular rate (n×3) about forward, sideways, upward: an arm that swings forward has −θ′ sideways.

        Central differences, as for the acceleration.
        """
        around = (self.turn_rad(t_s - _DIFFERENCE_S) - self.turn_rad(t_s + _DIFFERENCE_S)) / (2 * _DIFFERENCE_S)
        return np.column_stack([-self.turn_to[1] * around, self.turn_to[0] * around, np.zeros(len(t_s))])

    def field_ut(self, t_s: Floats, earth_ut: tuple[float, float, float]) -> Floats:
        """Return the field `earth_ut` (forward, sideways, upward of somebody standing) as the turned arm sees it."""
        turn = self.turn_rad(t_s)
        ahead, aside = self.turn_to
        along = earth_ut[0] * ahead + earth_ut[1] * aside
        across = earth_ut[1] * ahead - earth_ut[0] * aside
        turned = along * np.cos(turn) + earth_ut[2] * np.sin(turn)
        up = earth_ut[2] * np.cos(turn) - along * np.sin(turn)
        return np.column_stack([turned * ahead - across * aside, turned * aside + across * ahead, up])


def course(segment: Segment, start_s: float, wearer: Wearer, rng: np.random.Generator) -> Course:
    """Lay out `segment` from `start_s` on, with the variations that `rng` draws."""
    if segment.steps == 0:
        motion = MOTIONS.get(segment.activity, MOTIONS["rest"])
        return _motion_course(segment, motion, start_s, wearer, rng)
    return _gait_course(segment, start_s, wearer, rng)


def _gait_course(segment: Segment, start_s: float, wearer: Wearer, rng: np.random.Generator) -> Course:
    """Lay out steps; at both ends of the segment the arm hangs still, so that any activity may stand beside it."""
    gait, count = wearer.gaits[segment.activity], segment.steps
    knots_s = start_s + _knots(segment.duration_s, count, gait.interval_sd, rng)
    phase = np.concatenate(([-0.5], np.arange(count), [count - 0.5]))
    foot = np.where(np.arange(count) % 2, -1.0, 1.0) * gait.asymmetry
    strength = np.pad(wearer.strength * (1 + foot) * (1 + gait.strength_sd * _normal(rng, count)), 1)
    from_an_end = np.minimum(np.arange(count), np.arange(count)[::-1])
    swing = np.pad(np.minimum(gait.swing_at_ends + _SWING_GAIN * from_an_end, 1.0), 1)
    angle = _swinging(knots_s, phase, swing, gait)

    def arm_g(t_s: Floats) -> Floats:
        return _walking(t_s, knots_s, phase, strength, angle, gait, wearer)

    return Course(
        step_t_s=knots_s[1:-1],
        rough_g=gait.rough_g * wearer.strength,
        rough_rad_s=STEPPING_ROUGH_RAD_S,
        arm_g=arm_g,
        turn_rad=angle,
        turn_to=(1.0, 0.0),
    )


def _knots(duration_s: float, count: int, interval_sd: float, rng: np.random.Generator) -> Floats:
    """Return start, `count` steps and end: intervals vary, half of one stands at either end."""
    intervals = 1 + interval_sd * _normal(rng, count + 1)
    intervals[0] = intervals[-1] = 0.5
    at: Floats = np.concatenate(([0.0], np.cumsum(intervals)))
    return at * float(duration_s / at[-1])


def _normal(rng: np.random.Generator, n: int) -> Floats:
    return np.clip(rng.standard_normal(n), -_SD_LIMIT, _SD_LIMIT)


def _swinging(knots_s: Floats, phase: Floats, swing: Floats, gait: Gait) -> Callable[[Floats], Floats]:
    """Return the arm's angle: θ = e (θ₀ + Θ cos(πφ + λ)) with e from 0 to 1 where somebody sets out; φ counts steps."""
    rates = _knot_rates(knots_s, phase)
    amplitude, mean = math.radians(gait.swing_deg), math.radians(gait.arm_deg)

    def angle(at_s: Floats) -> Floats:
        inside_s = np.clip(at_s, knots_s[0], knots_s[-1])
        turns = _hermite(inside_s, knots_s, phase, rates)
        turned: Floats = _eased(inside_s, knots_s, swing) * (
            mean + amplitude * np.cos(math.pi * turns + gait.swing_lag_rad)
        )
        return turned

    return angle


def _walking(
    t_s: Floats,
    knots_s: Floats,
    phase: Floats,
    strength: Floats,
    angle: Callable[[Floats], Floats],
    gait: Gait,
    wearer: Wearer,
) -> Floats:
    """Return acceleration along the arm's forward, side and upward directions, at `t_s`.

    With θ the angle and v the vertical acceleration: forward (1 + v) sin θ + L θ″, up (1 + v) cos θ + L θ′², in g.
    """
    rates = _knot_rates(knots_s, phase)
    before, now, after = (angle(t_s + shift) for shift in (-_DIFFERENCE_S, 0.0, _DIFFERENCE_S))
    rate = (after - before) / (2 * _DIFFERENCE_S)
    acceleration = (after - 2 * now + before) / _DIFFERENCE_S**2
    cycles = 2 * math.pi * _hermite(t_s, knots_s, phase, rates)
    harmonics = enumerate(zip(gait.vertical_g, gait.vertical_lag_rad, strict=True), start=1)
    wave = np.sum([a * np.cos(k * cycles + lag) for k, (a, lag) in harmonics], axis=0)
    weight = 1 + _eased(t_s, knots_s, strength) * wave
    length = wearer.arm_m / STANDARD_GRAVITY
    forward = weight * np.sin(now) + length * acceleration
    up = weight * np.cos(now) + length * rate**2
    return np.column_stack([forward, np.zeros(len(t_s)), up])


def _eased(t_s: Floats, knots_s: Floats, values: Floats) -> Floats:
    """Go from value to value along half a cosine between knots, flat at each."""
    place, part = _places(t_s, knots_s)
    eased: Floats = values[place] + (values[place + 1] - values[place]) * (1 - np.cos(math.pi * part)) / 2
    return eased


def _hermite(t_s: Floats, knots_s: Floats, values: Floats, rates: Floats) -> Floats:
    """Cubic Hermite interpolation: no kink at a step, which would be a blow in the arm's acceleration."""
    place, u = _places(t_s, knots_s)
    span_s = knots_s[place + 1] - knots_s[place]
    low, high = values[place], values[place + 1]
    from_low = (1 + 2 * u) * (1 - u) ** 2 * low + u * (1 - u) ** 2 * span_s * rates[place]
    curve: Floats = from_low + u**2 * (3 - 2 * u) * high + u**2 * (u - 1) * span_s * rates[place + 1]
    return curve


def _places(t_s: Floats, knots_s: Floats) -> tuple[NDArray[np.intp], Floats]:
    place = np.clip(np.searchsorted(knots_s, t_s, side="right") - 1, 0, len(knots_s) - 2)
    return place, (t_s - knots_s[place]) / (knots_s[place + 1] - knots_s[place])


def _knot_rates(knots_s: Floats, values: Floats) -> Floats:
    slopes = np.diff(values) / np.diff(knots_s)
    return np.concatenate((slopes[:1], (slopes[1:] + slopes[:-1]) / 2, slopes[-1:]))


def _motion_course(
    segment: Segment, motion: Motion, start_s: float, wearer: Wearer, rng: np.random.Generator
) -> Course:
    length_s = segment.duration_s
    every_s = min(motion.turn_every_s, length_s)
    # Out and back must fit between two turns.
    turn_s = min(motion.turn_s, every_s / 2)
    axis_rad, shake_rad = rng.uniform(0, 2 * math.pi, 2)
    tilt_rad = math.radians(motion.shake_up_deg)
    level = math.cos(tilt_rad)
    line = (level * math.cos(shake_rad), level * math.sin(shake_rad), math.sin(tilt_rad))

    def arm_g(t_s: Floats) -> Floats:
        since_s = t_s - start_s
        acc_g = _turning(since_s, motion, every_s, turn_s, axis_rad)
        # Whole turns only: a turn cut off by the end would be a blow.
        acc_g[since_s >= length_s // every_s * every_s] = (0.0, 0.0, 1.0)
        shaking = motion.shake_g * np.sin(2 * math.pi * motion.shake_hz * since_s)
        acc_g += np.outer(shaking, line)
        acc_g[:, 2] += motion.knock_g * wearer.strength * _knocking(since_s)
        return acc_g

    def turn_rad(t_s: Floats) -> Floats:
        since_s = t_s - start_s
        angle, _ = _turn(since_s, motion, every_s, turn_s)
        return np.where((since_s < 0) | (since_s >= length_s // every_s * every_s), 0.0, angle)

    return Course(
        step_t_s=np.empty(0),
        rough_g=motion.rough_g,
        rough_rad_s=0.0,
        arm_g=arm_g,
        turn_rad=turn_rad,
        turn_to=(math.cos(axis_rad), math.sin(axis_rad)),
    )


def _turning(since_s: Floats, motion: Motion, every_s: float, turn_s: float, axis_rad: float) -> Floats:
    """Turn gravity out within `turn_s`, hold, and back at the end of `every_s`, heaving on the way out."""
    angle, at_s = _turn(since_s, motion, every_s, turn_s)
    heave = np.where(at_s < turn_s, motion.heave_g * np.sin(2 * math.pi * at_s / turn_s), 0.0)
    aside, up = (1 + heave) * np.sin(angle), (1 + heave) * np.cos(angle)
    return np.column_stack([aside * math.cos(axis_rad), aside * math.sin(axis_rad), up])


def _turn(since_s: Floats, motion: Motion, every_s: float, turn_s: float) -> tuple[Floats, Floats]:
    """Return the angle in rad, and the time since this turn and its return began."""
    at_s = since_s % every_s
    out = np.clip(np.minimum(at_s, every_s - at_s) / turn_s, 0, 1)
    angle: Floats = math.radians(motion.turn_deg) * (1 - np.cos(math.pi * out)) / 2
    return angle, at_s


def _knocking(since_s: Floats) -> Floats:
    """Three decaying rings of unit height, then a pause, over and over."""
    number = np.floor(since_s * _KNOCKS_HZ)
    after_s = since_s - number / _KNOCKS_HZ
    ring = np.exp(-after_s / _RING_S) * np.cos(2 * math.pi * _RING_HZ * after_s)
    return np.where(number % _KNOCK_GROUP[1] < _KNOCK_GROUP[0], ring, 0.0)
