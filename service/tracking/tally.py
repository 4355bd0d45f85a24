"""What became of a device's packets and samples, as numbers that users see."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True, kw_only=True)
class Tally:
    """Counts since the session began.

    Every sample from the first received one of a boot to its newest is in one of `samples`, `samples_lost` and
    `samples_awaited`. `gaps` and `samples_lost` are what was told by Gap events; a hole is in `samples_awaited` until
    then.
    """

    packets: int = 0
    packets_bad: int = 0
    packets_duplicate: int = 0
    """Nothing in them was new."""
    packets_reordered: int = 0
    """Something in them was new, but newer samples had come before; history that was asked for is not meant."""
    samples: int = 0
    samples_lost: int = 0
    samples_awaited: int = 0
    samples_saturated: int = 0
    gaps: int = 0
    reboots: int = 0
