"""The people of a table: synthetic walkers who do what a condition says, with every sensor a phone has.

Person k is the same in every condition of every paper: a strength, an arm's length and a pace of their own. Everything
follows from the condition's label and k.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from service.evaluation.papers.conditions import Condition, Part
from service.samples import GRID_HZ, Columns, SampleBlock

if TYPE_CHECKING:
    from device_sim.gait import Segment

STAND_S: Final = 3.0
"""Before and after each walk the papers' people stand; ours."""
MAGNET_UT: Final = (40.0, -30.0, 25.0)
"""A loudspeaker's field at arm's length, once in eight seconds; ours, of the order of the Earth's."""
MAGNET_S: Final = (1.0, 8.0)
_SPREAD: Final = {"strength": 0.12, "arm": 0.06, "pace": 0.05}
"""Standard deviations between people, as fractions; ours. Paces at free speed differ by about 7 % (Öberg 1993)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Factors on the rows of `device_sim.gait_profiles`."""

    strength: float
    arm: float
    pace: float


def person(k: int) -> Person:
    """Return person k: factors within two standard deviations of 1."""
    rng = np.random.default_rng((2018, k))
    drawn = np.clip(rng.standard_normal(3), -2, 2)
    return Person(**{name: 1 + sd * float(z) for (name, sd), z in zip(_SPREAD.items(), drawn, strict=True)})


def block(condition: Condition, k: int, *, mirrored: bool = False, noise_g: float | None = None) -> SampleBlock:
    """Return what person k's sensor measures in `condition`, on the 50 Hz grid, all three sensors.

    `mirrored` is the other wrist: the arm half a swing later. `noise_g` is the sensor's white noise.
    """
    from device_sim.gait import Walker  # noqa: PLC0415  # the simulator, only where people are wanted
    from device_sim.gait_poses import POSES  # noqa: PLC0415
    from device_sim.gait_profiles import SENSOR_NOISE_G  # noqa: PLC0415

    who, pose = person(k), POSES[condition.pose]
    gaits = dict(pose.gaits)
    if mirrored:
        gaits = {name: replace(gait, swing_lag_rad=gait.swing_lag_rad + math.pi) for name, gait in gaits.items()}
    stand = Part(activity="rest", duration_s=STAND_S)
    parts = (stand, *condition.parts, stand)
    sensed = Walker(
        tuple(_segment(part, who, gaits[part.activity].cadence_spm if part.steps else None) for part in parts),
        seed=zlib.crc32(condition.label.encode()) % 100_000 * 100 + k,
        rate_hz=float(GRID_HZ),
        gravity=pose.gravity,
        strength=who.strength,
        arm_m=pose.arm_m * who.arm,
        noise_g=SENSOR_NOISE_G if noise_g is None else noise_g,
        gaits=gaits,
    ).sensed()
    mag_ut = sensed.mag_ut + _magnet(len(sensed.mag_ut)) if condition.disturbed else sensed.mag_ut
    return SampleBlock(
        start=0, acc_g=_columns(sensed.acc_g), gyro_rad_s=_columns(sensed.gyro_rad_s), mag_ut=_columns(mag_ut)
    )


def _segment(part: Part, who: Person, cadence_spm: float | None) -> Segment:
    """Lay out a part: steps stay as many, and a cadence that the paper sets is kept by everybody."""
    from device_sim.gait import Segment  # noqa: PLC0415

    if cadence_spm is None:
        return Segment(activity=part.activity, duration_s=part.duration_s)
    spm = cadence_spm * who.pace if part.cadence_spm is None else part.cadence_spm
    return Segment(activity=part.activity, duration_s=60 * part.steps / spm, cadence_spm=spm)


def _magnet(n: int) -> NDArray[np.float64]:
    """Return the field (n×3, µT) of a magnet that passes: a bell of a second's width, over and over."""
    width_s, every_s = MAGNET_S
    since_s = np.arange(n) / GRID_HZ % every_s - every_s / 2
    bell: NDArray[np.float64] = np.exp(-((2 * since_s / width_s) ** 2))
    return np.outer(bell, MAGNET_UT)


def _columns(values: NDArray[np.float64]) -> Columns:
    x, y, z = (np.ascontiguousarray(column) for column in values.T)
    return x, y, z
