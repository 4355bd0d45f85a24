"""What the network learns from: recordings on the 50 Hz grid with what is known of their steps, and synthetic walks.

Three kinds of truth: the time of each step, their number alone, or that there are none. Where the quality is B the
truth is approximate, and weighs less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from service.evaluation.counting import grid_block
from service.evaluation.training import motion
from service.recordings.recording import Recording
from service.samples import GRID_HZ

UNSTATED: Final = frozenset({"eth2023_wrist", "eth2022_wrist", "brajdic_walk", "brajdic_handling", "voisard_lowback"})
"""Sets whose licence is not stated, or does not suit: they measure, and teach nothing."""

SYNTHETIC: Final = "device_sim"
"""The source of synthetic walks."""
EXERCISES: Final = "exercises"
"""The source of synthetic arm motion without a step."""

WALKS: Final = (
    "rest:6,normal:25,rest:4,slow:25,rest:5,fast:20,gesture:8",
    "rest:5,run:30,rest:8,normal:12,rest:6,stairs_up:15,stairs_down:15",
    "type:10,still_arm:30,rest:6,pocket:30,rest:4",
    "brush:20,rest:4,normal:8,wave:12,rest:3,slow:30",
    "rest:5,uphill:20,downhill:20,knock:8,rest:5,normal:6,rest:8,normal:6",
    "sit:8,rest:6,stand:8,slow:20,normal:20,fast:20,run:10",
    "rest:6,very_slow:40,rest:6,trolley:30,rest:5,in_place:25",
    "rest:5,normal:3,rest:5,slow:4,rest:6,fast:3,rest:5,normal:5,rest:6,pocket:4,rest:5,slow:6,type:8,normal:4,rest:6",
)
"""What the synthetic wearers do, in seconds each."""

DOUBTFUL_S: Final = 30.0
"""A step that hides in a recording of quality B without steps weighs in a shorter one."""

WEIGHTS: Final = {
    "pebble_wrist/walk": 0.24,
    "banglejs_walk/walk": 0.08,
    "oxford_opt/walk": 0.28,
    "dcaiti/walk": 0.04,
    "negatives_spar_watch/still": 0.14,
    "negatives_hmp/still": 0.13,
    "negatives_hmp/doubt": 0.03,
    "negatives_banglejs/still": 0.05,
    "pebble_wrist/still": 0.08,
    "device_sim/walk": 0.07,
    "device_sim/still": 0.05,
    "exercises/still": 0.1,
}
"""How often a piece of a clip is of a pool: half of the walks of the wrist, and all that was hard to refuse often."""

OTHERS: Final = 0.05
"""Of a pool not named there: somebody's own recordings."""

if TYPE_CHECKING:
    from device_sim.gait import Walker

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """One recording: acceleration n × 3 in g on the grid, and its truth.

    `subject` is '' where a recording does not say who wore it. `step_s` are the steps' times in seconds after the first
    sample, None where only their number is known.
    """

    source: str
    subject: str
    placement: str
    activity: str
    acc_g: Floats
    true_steps: int
    step_s: Floats | None = None
    trusted: bool = True
    recording: str = ""
    """Its file's name, without the ending."""
    quality: str | None = None
    steps_range: tuple[int, int] | None = None
    """What the number of steps may be, where that is all its wearer knew."""

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.acc_g) / GRID_HZ

    @property
    def at_wrist(self) -> bool:
        """Whether it was worn at a wrist."""
        return self.placement.startswith("wrist")


def material(source: str, recording: Recording) -> Material:
    """Return one recording as material; its true number of steps is known."""
    true = true_steps(recording)
    assert true is not None  # noqa: S101  # the caller has looked
    doubtful = recording.quality == "B" and not true and recording.duration_s < DOUBTFUL_S
    times = recording.step_t_s
    return Material(
        source=source,
        subject=recording.subject or "",
        placement=recording.placement or "unknown",
        activity=recording.activity or "unknown",
        acc_g=np.column_stack([np.asarray(column) for column in grid_block(recording).acc_g]),
        true_steps=true,
        step_s=None if times is None or not len(times) else times - recording.t_s[0],
        trusted=not doubtful,
        recording=recording.path.stem,
        quality=recording.quality,
        steps_range=recording.steps_range,
    )


def true_steps(recording: Recording) -> int | None:
    """Return how many steps a recording holds, None where it does not say."""
    if recording.true_steps is None and recording.step_t_s is not None:
        return len(recording.step_t_s)
    return recording.true_steps


def exercises(number: int, *, seed: int) -> list[Material]:
    """Return synthetic arm motion without a step, a minute each."""
    return [
        Material(
            source=EXERCISES,
            subject=f"arm {one}",
            placement="wrist",
            activity="exercise",
            acc_g=motion.exercise(60.0, np.random.default_rng([seed, one])),
            true_steps=0,
        )
        for one in range(number)
    ]


def synthetic(wearers: int, *, seed: int) -> list[Material]:
    """Return synthetic walks of as many wearers, at the wrist, with the time of every step."""
    from device_sim.gait import Walker  # noqa: PLC0415

    made = []
    for number in range(wearers):
        rng = np.random.default_rng([seed, number])
        walker = Walker(
            WALKS[number % len(WALKS)],
            seed=int(rng.integers(2**31)),
            strength=float(rng.uniform(0.5, 1.4)),
            arm_m=float(rng.uniform(0.3, 0.7)),
            noise_g=float(rng.uniform(0.002, 0.02)),
        )
        made.append(of_walker(walker, number))
    return made


def of_walker(walker: Walker, number: int) -> Material:
    """Return what the sensor of a synthetic wearer gives; whose steps have no times where there are none."""
    step_s = np.asarray(walker.step_times_until(walker.duration_s))
    return Material(
        source=SYNTHETIC,
        subject=f"walker {number}",
        placement="wrist",
        activity="schedule",
        acc_g=np.asarray(walker.read(round(walker.duration_s * GRID_HZ)), dtype=np.float64),
        true_steps=len(step_s),
        step_s=step_s if len(step_s) else None,
        recording=f"walker {number}",
    )
