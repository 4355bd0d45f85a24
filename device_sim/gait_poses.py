"""How a walker carries a phone: for each way, the rows of its gaits, measured like those of the wrist.

Chen 2015 and Khedr 2017 test phones held, swung, in pockets and in bags. A pose is rows for
`Walker(gaits=…)` and the length `arm_m` from the joint the phone swings about. Measured by us on the recordings'
development split as in `gait_profiles`: windows of 4 s whose harmonics explain 30 % of the norm's variance, split at
98 and 115 steps a minute; then five turns of a fit made a walker show the same medians of N½, N1, N2, N3, N4 and V½
(`asymmetry`, `vertical_g`, `swing_deg`) and the same spread of crests (`strength_sd`). Found again within 3 %, but for
N1½, which walkers have too weak (half in bags, a quarter in the pocket). Intervals vary as the wrist's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from device_sim.gait_profiles import ARM_M, GAITS, Gait

_THIGH_DEG: Final = 20.0
"""Swing of the thigh to either side of the vertical on level ground, as gait textbooks give it (Perry, Gait Analysis:
25° forward, 20° back). Ours, as a leg's acceleration does not tell: V½ holds the body's sway too."""
_CLIMBING_DEG: Final = {"stairs_up": 28.0, "stairs_down": 16.0, "uphill": 23.0, "downhill": 18.0}
"""Ours, nothing measured: the hip bends about 60° upstairs, 30° down; slopes lie nearer the level."""
_CLIMBING_MEAN_DEG: Final = {"stairs_up": 25.0, "stairs_down": 12.0, "uphill": 8.0, "downhill": 4.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """One way to carry a sensor; `gravity` is what it reads at rest, `measured` says where the rows are from."""

    gaits: Mapping[str, Gait]
    arm_m: float
    gravity: tuple[float, float, float]
    measured: str


Row = tuple[float, tuple[float, float, float, float], float, float, float]


def _rows(slow: Row, normal: Row, fast: Row, *, rough_g: float = 0.02, swing_at_ends: float = 0.0) -> dict[str, Gait]:
    """Lay (cadence, vertical, asymmetry, swing, strength_sd) over the wrist's rows; a run has its own body's."""
    rows = dict(GAITS)
    for name, (spm, vertical_g, asymmetry, swing_deg, strength_sd) in zip(
        ("slow", "normal", "fast"), (slow, normal, fast), strict=True
    ):
        rows[name] = replace(
            GAITS[name],
            cadence_spm=spm,
            vertical_g=vertical_g,
            asymmetry=asymmetry,
            swing_deg=swing_deg,
            arm_deg=0.0,
            strength_sd=strength_sd,
            rough_g=rough_g,
            swing_at_ends=swing_at_ends,
        )
    rows["run"] = replace(GAITS["run"], swing_deg=fast[3], arm_deg=0.0, swing_at_ends=swing_at_ends)
    return rows


def _thigh(rows: dict[str, Gait]) -> dict[str, Gait]:
    climbing = {
        name: replace(GAITS[name], swing_deg=_CLIMBING_DEG[name], arm_deg=_CLIMBING_MEAN_DEG[name], swing_at_ends=0.5)
        for name in _CLIMBING_DEG
    }
    return rows | climbing


FLAT: Final = Pose(
    gaits=_rows(
        (88, (0.136, 0.039, 0.049, 0.057), 0.192, 2.9, 0.179),
        (107, (0.255, 0.037, 0.035, 0.034), 0.152, 3.6, 0.182),
        (122, (0.360, 0.040, 0.033, 0.028), 0.164, 4.6, 0.185),
    ),
    arm_m=0.0,
    gravity=(0.0, 0.4, 0.9),
    measured="brajdic_walk hand and hand_using, 256 windows; its gyroscope says 3.6° (20°/s at half of 106/min)",
)
CALL: Final = Pose(
    gaits=_rows(
        (89, (0.155, 0.060, 0.071, 0.079), 0.02, 3.0, 0.123),
        (111, (0.427, 0.095, 0.138, 0.081), 0.032, 5.3, 0.073),
        (119, (0.449, 0.148, 0.087, 0.081), 0.040, 3.4, 0.054),
    ),
    arm_m=0.0,
    gravity=(0.3, 0.9, 0.3),
    measured="nobody recorded a call. Nearest: oxford_opt neck_pouch and brajdic_walk shirt_pocket, 170 windows",
)
SWINGING: Final = Pose(
    gaits=GAITS,
    arm_m=ARM_M,
    gravity=(0.0, -1.0, 0.0),
    measured="the wrist's rows: the only recordings of a swinging hand are set apart from development",
)
POCKET: Final = Pose(
    gaits=_thigh(
        _rows(
            (86, (0.231, 0.082, 0.091, 0.128), 0.300, _THIGH_DEG, 0.05),
            (107, (0.403, 0.141, 0.089, 0.139), 0.264, _THIGH_DEG, 0.067),
            (121, (0.562, 0.193, 0.120, 0.147), 0.287, _THIGH_DEG, 0.05),
            swing_at_ends=0.5,
        )
    ),
    arm_m=0.2,
    gravity=(0.0, -1.0, 0.0),
    measured="brajdic_walk front_pocket, 104 windows; the thigh's swing is from textbooks",
)
BACKPACK: Final = Pose(
    gaits=_rows(
        (86, (0.157, 0.061, 0.077, 0.114), 0.077, 3.7, 0.111),
        (107, (0.318, 0.127, 0.078, 0.048), 0.045, 4.7, 0.159),
        (127, (0.563, 0.180, 0.096, 0.036), 0.041, 3.5, 0.196),
    ),
    arm_m=0.0,
    gravity=(1.0, 0.2, 0.1),
    measured="brajdic_walk backpack, 107 windows",
)
BAG: Final = Pose(
    gaits=_rows(
        (91, (0.155, 0.072, 0.052, 0.073), 0.300, 2.9, 0.123),
        (113, (0.448, 0.084, 0.100, 0.054), 0.172, 4.5, 0.115),
        (119, (0.451, 0.120, 0.077, 0.082), 0.147, 4.6, 0.082),
    ),
    arm_m=0.0,
    gravity=(0.2, -0.3, 0.9),
    measured="brajdic_walk and oxford_opt bag, 247 windows, 6 of them slow",
)
WRIST: Final = Pose(gaits=GAITS, arm_m=ARM_M, gravity=(-1.0, 0.0, 0.0), measured="the rows of gait_profiles")

POSES: Final[Mapping[str, Pose]] = MappingProxyType(
    {
        "wrist": WRIST,
        "flat": FLAT,
        "call": CALL,
        "swinging": SWINGING,
        "pocket": POCKET,
        "backpack": BACKPACK,
        "bag": BAG,
    }
)
