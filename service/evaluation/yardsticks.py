"""What a bench measures and measures against: one signal, a textbook's peak counter, the least loop that counts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.samples import GRID_HZ, Column, Packet, SampleBlock
from service.wearables import bracelet as wire

SCHEDULE: Final = "normal:240,slow:120,rest:30,fast:120,run:90"
"""Ten minutes; it begins with four of plain walking."""

ARM_HZ: Final = 0.9
"""The arm swings once in two steps."""

HEIGHT_G: Final = 0.05
DISTANCE: Final = 15
"""What the yardsticks ask of a peak; samples, 0.3 s."""


def walk(samples: int) -> SampleBlock:
    """Return a synthetic walker's acceleration, ten minutes over and over; rotation and field swing with the arm."""
    from device_sim.gait import Walker  # noqa: PLC0415

    x, y, z = (np.resize(column, samples) for column in Walker(SCHEDULE, seed=1).read(samples).T)
    swing = 2 * np.pi * ARM_HZ * np.arange(samples) / GRID_HZ
    noise = np.resize(np.random.default_rng(1).standard_normal(10_007), samples)
    gyro, field = 2.0 * np.sin(swing) + 0.05 * noise, 10.0 * np.cos(swing) + 0.5 * noise
    return SampleBlock(
        start=0,
        acc_g=(x, y, z),
        gyro_rad_s=(0.02 * noise, gyro, -0.02 * noise),
        mag_ut=(20.0 + field, field, 0.5 * noise - 40.0),
    )


def head(block: SampleBlock, samples: int) -> SampleBlock:
    """Return the first `samples` of `block`."""
    acc_g, gyro, mag = (
        None if columns is None else (columns[0][:samples], columns[1][:samples], columns[2][:samples])
        for columns in (block.acc_g, block.gyro_rad_s, block.mag_ut)
    )
    assert acc_g is not None  # noqa: S101  # every block has it
    return SampleBlock(start=block.start, acc_g=acc_g, gyro_rad_s=gyro, mag_ut=mag)


def packets(samples: int, packet_samples: int) -> Iterator[Packet]:
    """Yield what a bracelet on the walker's wrist says and sends: its description, then its data."""
    from device_sim.bracelet import Bracelet  # noqa: PLC0415
    from device_sim.gait import Walker  # noqa: PLC0415

    bracelet = Bracelet(Walker(SCHEDULE, seed=1), packet_samples=packet_samples)
    said = {
        wire.BOOT: bracelet.boot_value(),
        wire.SCALE: bracelet.scale_value(),
        wire.RATE: bracelet.rate_value(),
        wire.CLOCK: bracelet.clock_value(),
    }
    for uuid, value in said.items():
        yield Packet(characteristic=uuid, data=value, at_ns=0)
    for _ in range(samples // packet_samples):
        bracelet.measure(packet_samples)
        if (data := bracelet.next_packet(mtu=517)) is not None:
            yield Packet(characteristic=wire.DATA, data=data, at_ns=0)


def band() -> NDArray[np.float64]:
    """Return the textbook's band-pass, 0.5 to 3 Hz, as two second-order sections."""
    from scipy.signal import butter  # noqa: PLC0415

    return np.asarray(butter(2, [0.5, 3.0], "bandpass", fs=GRID_HZ, output="sos"), dtype=np.float64)


def textbook(block: SampleBlock, sos: NDArray[np.float64]) -> int:
    """Count as a textbook does: peaks of some height and distance of the band-passed norm."""
    from scipy.signal import find_peaks, sosfilt  # noqa: PLC0415

    x, y, z = (np.asarray(column) for column in block.acc_g)
    filtered = sosfilt(sos, np.sqrt(x * x + y * y + z * z))
    peaks, _ = find_peaks(filtered, height=HEIGHT_G, distance=DISTANCE)
    return len(peaks)


def minimal(x: Column, y: Column, z: Column, sos: NDArray[np.float64]) -> int:
    """Do the textbook's job in one pass and keep nothing but the number: the least loop that counts.

    Of two peaks nearer than the distance the first stays; the textbook keeps the higher.
    """
    b0, b1, b2, a1, a2 = sos[0, 0], sos[0, 1], sos[0, 2], sos[0, 4], sos[0, 5]
    d0, d1, d2, c1, c2 = sos[1, 0], sos[1, 1], sos[1, 2], sos[1, 4], sos[1, 5]
    r1 = r2 = s1 = s2 = before = last = 0.0
    steps, since = 0, DISTANCE
    for i in range(len(x)):
        norm = math.sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i])
        half = b0 * norm + r1
        r1, r2 = b1 * norm - a1 * half + r2, b2 * norm - a2 * half
        now = d0 * half + s1
        s1, s2 = d1 * half - c1 * now + s2, d2 * half - c2 * now
        since += 1
        if last > before and last >= now and last >= HEIGHT_G and since >= DISTANCE:
            steps += 1
            since = 0
        before, last = last, now
    return steps
