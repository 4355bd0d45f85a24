"""What the synthetic walker's wearer does: one measured row an activity.

Measured by us on the recordings' development split, in windows of 4 s: least squares of the acceleration's norm at ½,
1, 1½, 2, 3 and 4 times the step rate (N½…N4), of its vector at half the step rate (V½), in g, medians over the
windows whose harmonics explain 60 % of the norm's variance (30 % outside pebble_wrist): so these are regular walks.
`vertical_g`, `swing_deg` and `arm_deg` are what makes a walker of 0.6 m arm length show those medians; they are the
model's numbers, not anatomy. `asymmetry`, `strength_sd` and `interval_sd` come from the crests of the filtered norm,
corrected for what that estimator finds in a walker of known variation. Not reproduced: N1½, two to four times too
weak in walks; the foot-to-foot difference in the pocket, half of the real one; windows without a clear step rate.
Phases of a walk's vertical harmonics are those of oxford_opt's step-locked mean (4 neck pouch, 2 armband recordings;
switches in the shoes give the steps).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

WALK_LAG_RAD: Final = (0.0, 0.65 * math.pi, 0.31 * math.pi, 0.28 * math.pi)
"""Phases of cosines at 1…4 times the step rate; the first is at its height at the step."""

ARM_M: Final = 0.6
"""Shoulder to wrist, ours. With it the normal row swings 17°, where eth2023's gyroscope says 18…21°, and the run row
26°, where that of eth2022 and 2023 says 38…42°, elbow included."""

SENSOR_NOISE_G: Final = 0.003
"""White, per axis: the quietest 2 s of the eth2023 recordings have 0.0017…0.0067."""

SENSOR_NOISE_RAD_S: Final = 0.005
"""White, per axis: the quietest 2 s of eth2023 and dcaiti have 0.005…0.022."""
SENSOR_NOISE_UT: Final = 0.15
"""White, per axis: the quietest 2 s of dcaiti and brajdic_walk have 0.12…0.31."""
STEPPING_ROUGH_RAD_S: Final = 0.13
"""White remainder of the angular rate while stepping, per axis, from first differences in windows of 4 s: medians
6.5°/s on brajdic_walk, 7.9 on eth2023, 8.9 on dcaiti."""
EARTH_UT: Final = (21.0, 0.0, -43.0)
"""Forward, sideways, upward: central Europe, walking north; eth2023 has norms of 59…80 µT indoors, dcaiti 30…37."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gait:
    """How somebody steps: `vertical_g` at 1…4 times the step rate, standard deviations as fractions of the mean.

    `asymmetry` is how much stronger than the mean one foot lands, `arm_deg` the forearm's mean angle to the vertical,
    `swing_deg` its swing to either side, `rough_g` the white remainder above 10 Hz. At
    a step the arm is at its foremost or hindmost, where `swing_lag_rad` is 0. `swing_at_ends` is the share of the
    swing that the first and last step have. `measured` says where it is from.
    """

    cadence_spm: float
    interval_sd: float
    strength_sd: float
    asymmetry: float
    vertical_g: tuple[float, float, float, float]
    swing_deg: float
    arm_deg: float
    rough_g: float
    swing_lag_rad: float = 0.0
    swing_at_ends: float = 0.0
    vertical_lag_rad: tuple[float, float, float, float] = WALK_LAG_RAD
    measured: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What an arm does without a step: it turns, heaves, shakes, knocks.

    Every `turn_every_s` (once where it is infinite) it turns by `turn_deg` within `turn_s` and later back, heaving by
    `heave_g` (up first; negative: down first). It shakes with `shake_g` at `shake_hz`, along a line
    `shake_up_deg` above the horizontal, and knocks three times a second.
    """

    turn_deg: float = 0.0
    turn_s: float = 1.0
    turn_every_s: float = math.inf
    heave_g: float = 0.0
    shake_hz: float = 1.0
    shake_g: float = 0.0
    shake_up_deg: float = 0.0
    knock_g: float = 0.0
    rough_g: float = 0.0
    measured: str


GAITS: Final[dict[str, Gait]] = {
    "slow": Gait(
        cadence_spm=90,
        interval_sd=0.08,
        strength_sd=0.2,
        asymmetry=0.1,
        vertical_g=(0.23, 0.078, 0.076, 0.073),
        swing_deg=17.8,
        arm_deg=6.8,
        rough_g=0.017,
        measured=(
            "pebble_wrist, 86 windows at 79…95/min: N½ .042 N1 .138 N1½ .028 N2 .067 N3 .047 N4 .030 V½ .08; "
            "variations of pebble walk_30, walk_30_slow and 8 banglejs_walk; roughness of eth2023 (ours)"
        ),
    ),
    "normal": Gait(
        cadence_spm=108,
        interval_sd=0.055,
        strength_sd=0.25,
        asymmetry=0.15,
        vertical_g=(0.441, 0.117, 0.093, 0.095),
        swing_deg=17.1,
        arm_deg=10.8,
        rough_g=0.019,
        measured=(
            "pebble_wrist, 1313 windows at 100…115/min: N½ .083 N1 .333 N1½ .083 N2 .112 N3 .073 N4 .066 V½ "
            ".22; strength of 53 walk_100 and walk_200; asymmetry and roughness of eth2023 01, 02, 04 (pebble "
            ".06); intervals between both and oxford_opt"
        ),
    ),
    "fast": Gait(
        cadence_spm=118,
        interval_sd=0.055,
        strength_sd=0.25,
        asymmetry=0.15,
        vertical_g=(0.471, 0.167, 0.06, 0.091),
        swing_deg=17.5,
        arm_deg=17.8,
        rough_g=0.03,
        measured=(
            "pebble_wrist, 23 windows at 116…124/min: N½ .168 N1 .340 N1½ .089 N2 .143 N3 .041 N4 .053 V½ .35; "
            "variations as normal, roughness between normal and stairs (ours)"
        ),
    ),
    "run": Gait(
        cadence_spm=163,
        interval_sd=0.012,
        strength_sd=0.1,
        asymmetry=0.108,
        vertical_g=(2.253, 1.077, 0.099, 0.001),
        swing_deg=26.2,
        arm_deg=2.8,
        rough_g=0.16,
        swing_lag_rad=2.21,
        vertical_lag_rad=(0.0, -0.15, 0.41, 1.39),
        measured=(
            "pebble_wrist/running_100 (eth clips at 2 g): N½ .144 N1 1.352 N1½ .119 N2 1.076 N3 .152 N4 .072 V½ "
            "1.85, sd 1.32, mean 2.35, peaks 4.46 g, all fitted with the phases; roughness of eth2022 jog"
        ),
    ),
    "stairs_up": Gait(
        cadence_spm=133,
        interval_sd=0.08,
        strength_sd=0.27,
        asymmetry=0.1,
        vertical_g=(0.613, 0.098, 0.078, 0.057),
        swing_deg=7.8,
        arm_deg=13.7,
        rough_g=0.057,
        measured=(
            "eth2022 walk_upstairs_hands-in-pockets, one recording: N½ .088 N1 .529 N1½ .080 N2 .074 N3 .038 N4 "
            ".019 V½ .24; hands in pockets, so little swing; intervals slow's"
        ),
    ),
    "stairs_down": Gait(
        cadence_spm=131,
        interval_sd=0.08,
        strength_sd=0.27,
        asymmetry=0.1,
        vertical_g=(0.788, 0.061, 0.092, 0.107),
        swing_deg=22.2,
        arm_deg=23.4,
        rough_g=0.072,
        measured=(
            "eth2022 walk_steps_down, one recording: N½ .357 N1 .465 N1½ .111 N2 .068 N3 .049 N4 .033 V½ .63; "
            "variations as stairs_up"
        ),
    ),
    "uphill": Gait(
        cadence_spm=108,
        interval_sd=0.068,
        strength_sd=0.26,
        asymmetry=0.125,
        vertical_g=(0.527, 0.108, 0.086, 0.076),
        swing_deg=12.5,
        arm_deg=12.3,
        rough_g=0.038,
        measured=(
            "nothing: no recording of a slope. Ours: half way from normal to stairs_up, at the cadence of normal"
        ),
    ),
    "downhill": Gait(
        cadence_spm=108,
        interval_sd=0.068,
        strength_sd=0.26,
        asymmetry=0.125,
        vertical_g=(0.615, 0.089, 0.093, 0.101),
        swing_deg=19.7,
        arm_deg=17.1,
        rough_g=0.045,
        measured=(
            "nothing: no recording of a slope. Ours: half way from normal to stairs_down, at the cadence of normal"
        ),
    ),
    "still_arm": Gait(
        cadence_spm=108,
        interval_sd=0.055,
        strength_sd=0.09,
        asymmetry=0.05,
        vertical_g=(0.331, 0.054, 0.052, 0.025),
        swing_deg=6.4,
        arm_deg=5.3,
        rough_g=0.023,
        measured=(
            "eth2023 labeled_01 (gyroscope: 5°): N½ .019 N1 .314 N1½ .013 N2 .053 N3 .042 N4 .019 V½ .09; "
            "intervals as normal"
        ),
    ),
    "pocket": Gait(
        cadence_spm=107,
        interval_sd=0.055,
        strength_sd=0.1,
        asymmetry=0.27,
        vertical_g=(0.442, 0.236, 0.096, 0.131),
        swing_deg=19.1,
        arm_deg=10.1,
        rough_g=0.025,
        measured=(
            "pebble_wrist/walk_50_hands_in_pocket, one recording: N½ .055 N1 .303 N1½ .148 N2 .205 N3 .069 N4 "
            ".085 V½ .23; intervals as normal"
        ),
    ),
    "very_slow": Gait(
        cadence_spm=48,
        interval_sd=0.12,
        strength_sd=0.25,
        asymmetry=0.1,
        vertical_g=(0.115, 0.039, 0.038, 0.037),
        swing_deg=9.0,
        arm_deg=5.0,
        rough_g=0.015,
        measured="nothing: no recording is as slow. Ours: half the impacts and swing of slow, less regular",
    ),
    "trolley": Gait(
        cadence_spm=100,
        interval_sd=0.06,
        strength_sd=0.15,
        asymmetry=0.05,
        vertical_g=(0.12, 0.04, 0.03, 0.02),
        swing_deg=1.0,
        arm_deg=45.0,
        rough_g=0.05,
        measured=(
            "nothing: no recording of hands on a handle. Ours: a third of still_arm's impacts reach the wrist, the arm "
            "does not swing, wheels shake it as a car does"
        ),
    ),
    "in_place": Gait(
        cadence_spm=100,
        interval_sd=0.06,
        strength_sd=0.2,
        asymmetry=0.1,
        vertical_g=(0.25, 0.08, 0.06, 0.05),
        swing_deg=5.0,
        arm_deg=20.0,
        rough_g=0.03,
        measured="nothing: no recording of it. Ours: impacts between slow and normal, hardly any swing",
    ),
}

MOTIONS: Final[dict[str, Motion]] = {
    "rest": Motion(
        measured="negatives_banglejs/static, pebble_wrist/not_moving: norm's sd 0.003…0.006 g, the sensor's"
    ),
    "sit": Motion(
        turn_deg=75,
        turn_s=2.7,
        heave_g=-0.28,
        rough_g=0.02,
        measured="negatives_hmp, 71 sitdown_chair: turn 75° in 2.7 s, norm 0.79…1.34 g (1st and 99th percentile)",
    ),
    "stand": Motion(
        turn_deg=77,
        turn_s=2.8,
        heave_g=0.26,
        rough_g=0.02,
        measured="negatives_hmp, 70 standup_chair: turn 77° in 2.8 s, norm 0.75…1.28 g",
    ),
    "type": Motion(
        turn_deg=14,
        turn_s=1.0,
        turn_every_s=10,
        rough_g=0.016,
        measured="negatives_banglejs, work57min: in 10 s a turn of 14° and norm's sd 0.016 g; 12.5 Hz hides the keys",
    ),
    "knock": Motion(
        knock_g=1.0,
        rough_g=0.01,
        measured="nothing: no recording has it. Ours: 3 knocks a second, 1 g, ringing at 12 Hz for 30 ms, pauses",
    ),
    "gesture": Motion(
        turn_deg=35,
        turn_s=1.0,
        turn_every_s=3,
        heave_g=0.25,
        rough_g=0.03,
        measured="pebble_wrist/raise_arm: about 10 turns of 35° in 27 s, norm 0.62…1.35 g",
    ),
    "brush": Motion(
        shake_hz=5.6,
        shake_g=0.6,
        shake_up_deg=50,
        turn_deg=20,
        turn_s=2,
        turn_every_s=10,
        rough_g=0.1,
        measured="negatives_hmp, 10 brush_teeth: 4.0…6.4 Hz at 0.3…0.9 g, norm's sd 0.36 g",
    ),
    "wave": Motion(
        shake_hz=0.8,
        shake_g=0.6,
        shake_up_deg=15,
        rough_g=0.05,
        measured="pebble_wrist/hand_movements_x: 0.8 Hz at 0.61 g, norm's sd 0.145 g: rhythm of a slow walk",
    ),
    "drive": Motion(
        turn_deg=10,
        turn_s=2,
        turn_every_s=10,
        rough_g=0.047,
        measured="negatives_banglejs/drive29: per 10 s a turn of 10°, norm's sd 0.047 g",
    ),
    "turn_round": Motion(
        turn_deg=10,
        turn_s=1.0,
        turn_every_s=3,
        heave_g=0.15,
        rough_g=0.03,
        measured="nothing: no recording has it. Ours: turning on the spot, 10° of tilt, half a heave",
    ),
    "shake": Motion(
        shake_hz=2.5,
        shake_g=1.0,
        shake_up_deg=30,
        rough_g=0.05,
        measured="nothing: no recording has it. Ours: shaken on the spot, in the rhythm of a run",
    ),
    "rotate": Motion(
        turn_deg=90,
        turn_s=0.5,
        turn_every_s=1.0,
        rough_g=0.03,
        measured="nothing: no recording has it. Ours: 90° to and fro once a second, on the spot",
    ),
}
