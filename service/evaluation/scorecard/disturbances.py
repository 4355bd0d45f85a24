"""What another wearable would have made of the same motion: a lower rate, a narrower range, fewer bits, turned, lossy.

A disturbance changes what the sensor measured, before the 50 Hz grid. A rate is lowered as a cheap wearable does it,
which sends the newest sample it has and filters nothing. Bits are spread over ±8 g, the range of our bracelet: 8 bits
resolve 62.5 mg. Rotations are drawn once for each recording, from its name. What happens to packets is in `wire`.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from service.evaluation.scorecard.sampled import Sampled, rotation

FEWEST_STEPS: Final = 50
"""Of a shorter walk, one step more or less is a change of several per cent."""
BITS_RANGE_G: Final = 8.0
MUST_PERCENT: Final = 3.0
"""The mean absolute change of a count must not exceed this."""
NONE_ABOVE_PERCENT: Final = 10.0

NATIVE: Final = "as recorded"
RATES: Final = (50.0, 25.0, 12.5)
RANGES_G: Final = (4.0, 2.0)
BITS: Final = (10, 8, 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """`change` gives of samples and a seed what is counted instead; None where it does not apply.

    `axis` is what it is a level of, None where it stands alone; `asked` tells whether the limits hold for it.
    """

    name: str
    change: Callable[[Sampled, int], Sampled | None]
    axis: str | None = None
    asked: bool = True


def at_rate(of: Sampled, _: int, rate_hz: float) -> Sampled | None:
    """Return the newest sample at each tick of a lower rate; None where it is none."""
    if rate_hz >= of.rate_hz:
        return None
    ticks = int((len(of) - 1) * rate_hz / of.rate_hz + 1e-9) + 1
    # A tick that rounding puts a hair before its sample still has it.
    at = np.floor(np.arange(ticks) * of.rate_hz / rate_hz + 1e-6).astype(np.intp)
    return of.taken(at, rate_hz)


def turned(of: Sampled, seed: int) -> Sampled:
    """Return the samples of a sensor worn in another, random attitude."""
    return of.turned(rotation(np.random.default_rng(seed)))


def clipped(of: Sampled, _: int, range_g: float) -> Sampled:
    """Return the samples of an accelerometer whose range ends at ±`range_g`."""
    return replace(of, acc_g=np.clip(of.acc_g, -range_g, range_g))


def rounded(of: Sampled, _: int, bits: int) -> Sampled:
    """Return the samples of an accelerometer of so many bits over ±BITS_RANGE_G."""
    lsb_g = 2 * BITS_RANGE_G / 2**bits
    counts = np.clip(np.round(of.acc_g / lsb_g), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return replace(of, acc_g=counts * lsb_g)


def cheap(of: Sampled, seed: int) -> Sampled | None:
    """Return the samples of a sensor worn otherwise, at 25 Hz, in 8 bits; at its own rate where that is lower."""
    other = turned(of, seed)
    return rounded(at_rate(other, seed, 25.0) or other, seed, 8)


DISTURBANCES: Final = (
    *(
        Disturbance(name=f"{rate:g} Hz", axis="rate", change=partial(at_rate, rate_hz=rate)) for rate in RATES
    ),
    Disturbance(name="rotated", change=turned),
    *(
        Disturbance(name=f"±{span:g} g", axis="range", change=partial(clipped, range_g=span), asked=span == 2.0)
        for span in RANGES_G
    ),
    *(
        Disturbance(name=f"{bits} bits", axis="bits", change=partial(rounded, bits=bits), asked=bits == 8)
        for bits in BITS
    ),
    Disturbance(name="25 Hz, 8 bits, rotated", change=cheap),
)  # fmt: skip


def seed_of(name: str) -> int:
    """Return the seed that a recording's name gives."""
    return zlib.crc32(name.encode())
