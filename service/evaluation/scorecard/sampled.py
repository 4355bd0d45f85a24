"""What a sensor measured, evenly spaced at the device's own rate: what a disturbance changes before it is counted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from service.evaluation.counting import raw_block
from service.recordings import Recording, stated_rate_hz
from service.samples import Columns, RawBlock, SampleBlock
from service.signals.timebase import Timebase

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """Acceleration (n×3, g), and where they were measured angular rate (rad/s) and field (µT), at `rate_hz`."""

    acc_g: Floats
    rate_hz: float
    gyro_rad_s: Floats | None = None
    mag_ut: Floats | None = None

    def __len__(self) -> int:
        return len(self.acc_g)

    def raw_block(self) -> RawBlock:
        """Return the samples as a device sends them, unrounded and in one piece."""
        return RawBlock(
            boot=1, index=0, tick=None, acc_g=columns(self.acc_g), gyro_rad_s=_or_none(self.gyro_rad_s),
            mag_ut=_or_none(self.mag_ut),
        )  # fmt: skip

    def on_grid(self) -> SampleBlock:
        """Return what the counters get of it: the 50 Hz grid."""
        return Timebase(self.rate_hz).feed(self.raw_block())[0]

    def turned(self, by: Floats) -> Sampled:
        """Return what the sensor would measure, worn otherwise by the rotation `by` (3×3)."""
        return replace(
            self,
            acc_g=self.acc_g @ by.T,
            gyro_rad_s=None if self.gyro_rad_s is None else self.gyro_rad_s @ by.T,
            mag_ut=None if self.mag_ut is None else self.mag_ut @ by.T,
        )

    def taken(self, at: NDArray[np.intp], rate_hz: float) -> Sampled:
        """Return the samples `at` these places, as taken at `rate_hz`."""
        return Sampled(
            acc_g=self.acc_g[at],
            rate_hz=rate_hz,
            gyro_rad_s=None if self.gyro_rad_s is None else self.gyro_rad_s[at],
            mag_ut=None if self.mag_ut is None else self.mag_ut[at],
        )


def sampled(recording: Recording) -> Sampled:
    """Return a recording as its device would have sent it."""
    block = raw_block(recording)
    return Sampled(
        acc_g=stacked(block.acc_g),
        rate_hz=stated_rate_hz(recording),
        gyro_rad_s=None if block.gyro_rad_s is None else stacked(block.gyro_rad_s),
        mag_ut=None if block.mag_ut is None else stacked(block.mag_ut),
    )


def columns(values: Floats) -> Columns:
    """Return n×3 as x, y, z."""
    x, y, z = (np.ascontiguousarray(column) for column in values.T)
    return x, y, z


def stacked(of: Columns) -> Floats:
    """Return x, y, z as n×3."""
    return np.column_stack([np.asarray(column) for column in of])


def _or_none(values: Floats | None) -> Columns | None:
    return None if values is None else columns(values)


def rotation(rng: np.random.Generator) -> Floats:
    """Return a random rotation (3×3), each as likely: the QR decomposition of normal numbers (Mezzadri 2007)."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    turned: Floats = q * np.sign(np.linalg.det(q))
    return turned


def rotation_onto(direction: Floats, onto: Floats) -> Floats:
    """Return the least rotation (3×3) that turns one direction onto another (Rodrigues); half a turn where opposite."""
    a, b = direction / np.linalg.norm(direction), onto / np.linalg.norm(onto)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-9:
        aside = np.eye(3)[int(np.argmin(np.abs(a)))]
        across = aside - (aside @ a) * a
        across /= np.linalg.norm(across)
        return 2 * np.outer(across, across) - np.eye(3)
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    made: Floats = np.eye(3) + skew + skew @ skew / (1 + cosine)
    return made
