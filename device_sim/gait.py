"""A synthetic walker whose true steps are known: acceleration at a wrist, from a schedule of activities.

The arm is a pendulum that swings once in two steps (gravity, centripetal and tangential terms); the body's vertical
acceleration has four harmonics of the step rate, stronger for one foot; steps vary in interval and strength. The
numbers are in `gait_profiles`, each with the recordings it was measured on. Everything follows from the seed: the
same walker gives the same samples, however they are asked for.

`sensors` adds the angular rate and the Earth's field that the same attitude gives: on eth2023 the arm's main axis turns
at 84°/s (median of 62 windows of 4 s, standard deviation), the normal row at 68; a second axis with half of that there
is left out here.

`mirrored` is the same person's other wrist: the same steps at the same moments, the arm half a stride behind, every
sideways motion the other way, a watch that faces outwards on that side too, and its own noise.

Left out: forward and sideways acceleration of the body, turns of the wearer, fatigue.
"""

from __future__ import annotations

import bisect
import dataclasses
import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from device_sim.gait_courses import Course, Wearer, course
from device_sim.gait_profiles import (
    ARM_M,
    EARTH_UT,
    GAITS,
    SENSOR_NOISE_G,
    SENSOR_NOISE_RAD_S,
    SENSOR_NOISE_UT,
    Gait,
)
from device_sim.gait_schedule import ACTIVITIES, Segment, parse_schedule
from service.errors import ParameterError
from service.samples import ACCELEROMETER_ONLY, Sensor, Sensors

__all__ = ["ACTIVITIES", "Segment", "Sensed", "Walker", "parse_schedule"]

Floats = NDArray[np.float64]

_BLOCK: Final = 512
"""Samples made at a time: fixed, so that noise does not depend on how samples are asked for."""
_OUTWARDS: Final = np.array([[-1.0], [-1.0], [1.0]])
"""What half a turn about the forearm makes of the sensor's forward, sideways and upward directions."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensed:
    """What a sensor with nine axes measures, each n×3 in its own axes."""

    acc_g: Floats
    gyro_rad_s: Floats
    mag_ut: Floats


class Walker:
    """Acceleration (g, gravity included) of somebody who follows `schedule`; a `device_sim.source.Source`.

    `sensors` says whether angular rate (rad/s) and field (µT) stand beside it; they change nothing in it.
    `gravity` is the direction, in the sensor's axes, of what it reads while the arm hangs still. `strength` scales
    the impacts and their roughness, `arm_m` is the length from shoulder to sensor, `noise_g` the sensor's white
    noise. `gaits` are the rows of its gaits, where the sensor is worn elsewhere than at the wrist. With `loop` the
    schedule begins again for ever, with other variations. `mirrored` is the other wrist. ParameterError where a value
    is out of range.
    """

    def __init__(
        self,
        schedule: str | Sequence[Segment],
        *,
        seed: int = 0,
        rate_hz: float = 50.0,
        loop: bool = False,
        gravity: tuple[float, float, float] = (-1.0, 0.0, 0.0),
        strength: float = 1.0,
        arm_m: float = ARM_M,
        noise_g: float = SENSOR_NOISE_G,
        gaits: Mapping[str, Gait] = GAITS,
        sensors: Collection[Sensor] = ACCELEROMETER_ONLY,
        mirrored: bool = False,
    ) -> None:
        self.schedule = parse_schedule(schedule) if isinstance(schedule, str) else tuple(schedule)
        if not self.schedule:
            raise ParameterError("schedule", schedule, "at least one segment is wanted")
        if not 0 < rate_hz < math.inf:
            raise ParameterError("rate_hz", rate_hz, "a rate above 0 is wanted")
        for name, value in (("strength", strength), ("arm_m", arm_m), ("noise_g", noise_g)):
            if not 0 <= value < math.inf:
                raise ParameterError(name, value, "0 or more is wanted")
        if seed < 0:
            raise ParameterError("seed", seed, "0 or more is wanted")
        self._rate_hz = rate_hz
        self._loop = loop
        self._seed = seed
        self._sensors = tuple(sensor for sensor in Sensor if sensor in {*ACCELEROMETER_ONLY, *sensors})
        self._mirrored = mirrored
        worn = {name: _half_a_stride_later(gait) for name, gait in gaits.items()} if mirrored else gaits
        self._wearer = Wearer(strength=strength, arm_m=arm_m, gaits=worn)
        self._axes = _axes(gravity) * (_OUTWARDS if mirrored else 1.0)
        self._noise_g = noise_g
        self._blocks = self._make_blocks()
        self._left: Floats = np.empty((0, 3 * len(self._sensors)))
        self._starts_s = [0.0, *itertools.accumulate(segment.duration_s for segment in self.schedule)]
        self._step_t_s: list[float] = []
        self._known = 0

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return self._rate_hz

    @property
    def sensors(self) -> Sensors:
        """What a sample holds."""
        return self._sensors

    @property
    def duration_s(self) -> float:
        """Length of the schedule, once through, in seconds."""
        return self._starts_s[-1]

    def read(self, n: int) -> Floats:
        """Return the next n samples, three columns a sensor; fewer at the end, then none, unless it loops."""
        parts, have = [self._left], len(self._left)
        while have < n and (block := next(self._blocks, None)) is not None:
            parts.append(block)
            have += len(block)
        samples = np.concatenate(parts)
        self._left = samples[n:]
        return samples[:n]

    def sensed(self) -> Sensed:
        """Return the whole schedule, once through, with angular rate and field; what has been read changes nothing.

        These are the samples that `read` gives, bit for bit.
        """
        blocks = [
            block for number in range(len(self.schedule)) for block in self._segment_blocks(number, tuple(Sensor))
        ]
        acc_g, gyro_rad_s, mag_ut = np.hsplit(np.concatenate(blocks), len(Sensor))
        return Sensed(acc_g=acc_g, gyro_rad_s=gyro_rad_s, mag_ut=mag_ut)

    def true_steps_until(self, t_s: float) -> int:
        """Return the steps taken up to `t_s` seconds after the start."""
        if not math.isfinite(t_s):
            raise ParameterError("t_s", t_s, "a finite time is wanted")
        while (self._loop or self._known < len(self.schedule)) and self._start_s(self._known) <= t_s:
            self._step_t_s += self._course(self._known).step_t_s.tolist()
            self._known += 1
        return bisect.bisect_right(self._step_t_s, t_s)

    def step_times_until(self, t_s: float) -> list[float]:
        """Return the times of all steps up to `t_s`, in seconds after the start: the moments of strongest impact."""
        return self._step_t_s[: self.true_steps_until(t_s)]

    def _start_s(self, number: int) -> float:
        turn, place = divmod(number, len(self.schedule))
        return turn * self.duration_s + self._starts_s[place]

    def _course(self, number: int) -> Course:
        """Lay out the `number`-th segment since the start; the same each time it is asked for."""
        segment = self.schedule[number % len(self.schedule)]
        rng = np.random.default_rng((self._seed, number))
        laid = course(segment, self._start_s(number), self._wearer, rng)
        return _mirrored(laid) if self._mirrored else laid

    def _make_blocks(self) -> Iterator[Floats]:
        for number in itertools.count() if self._loop else range(len(self.schedule)):
            yield from self._segment_blocks(number, self._sensors)

    def _segment_blocks(self, number: int, sensors: Sensors) -> Iterator[Floats]:
        """Yield the samples of the `number`-th segment, block by block."""
        laid = self._course(number)
        rng, other_rng = (np.random.default_rng((self._seed, number, use + 2 * self._mirrored)) for use in (1, 2))
        spread = math.hypot(laid.rough_rad_s, SENSOR_NOISE_RAD_S)
        first, last = (self._first_index(self._start_s(at)) for at in (number, number + 1))
        for block in range(first, last, _BLOCK):
            t_s = np.arange(block, min(block + _BLOCK, last)) / self._rate_hz
            noise = rng.standard_normal((len(t_s), 3)) * math.hypot(laid.rough_g, self._noise_g)
            columns = [(laid.arm_g(t_s) + noise) @ self._axes]
            if sensors != ACCELEROMETER_ONLY:
                # Drawn for both: what is asked for must not change the noise of the other.
                for_gyro, for_mag = other_rng.standard_normal((2, len(t_s), 3))
                if Sensor.GYROSCOPE in sensors:
                    columns.append((laid.rate_rad_s(t_s) + spread * for_gyro) @ self._axes)
                if Sensor.MAGNETOMETER in sensors:
                    columns.append((laid.field_ut(t_s, EARTH_UT) + SENSOR_NOISE_UT * for_mag) @ self._axes)
            yield np.hstack(columns)

    def _first_index(self, t_s: float) -> int:
        """Return the first sample at or after `t_s`; a hair before counts as at."""
        return math.ceil(t_s * self._rate_hz - 1e-6)


def _half_a_stride_later(gait: Gait) -> Gait:
    return dataclasses.replace(gait, swing_lag_rad=gait.swing_lag_rad + math.pi)


def _mirrored(laid: Course) -> Course:
    """Return the course with left and right exchanged; its turns follow from where they lead."""
    ahead, aside = laid.turn_to
    return dataclasses.replace(laid, arm_g=lambda t_s: laid.arm_g(t_s) * (1.0, -1.0, 1.0), turn_to=(ahead, -aside))


def _axes(gravity: tuple[float, float, float]) -> Floats:
    up = np.array(gravity, dtype=np.float64)
    length = float(np.linalg.norm(up))
    if up.shape != (3,) or not 0 < length < math.inf:
        raise ParameterError("gravity", gravity, "three finite numbers, not all 0, are wanted")
    up /= length
    # A phone that stands upright swings about its short side.
    side = np.array([0.0, 1.0, 0.0]) if abs(up[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    side -= side @ up * up
    side /= np.linalg.norm(side)
    return np.stack([np.cross(side, up), side, up])
