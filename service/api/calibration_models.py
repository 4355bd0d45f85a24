"""Schemas of calibrations: what is asked for, what is recorded, and what was learnt."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from service.pipeline.calibration import LONGEST_S, STEPS, State

MethodName = Literal["walk", "middle", "slowest_walk"]


class CalibrationWanted(BaseModel):
    """A recording to begin. It ends by itself after `steps` or `seconds`: exactly one of them is given."""

    model_config = ConfigDict(extra="forbid")

    counter: str = Field(description="Counter that learns; it need not run yet", examples=["double_threshold"])
    method: MethodName = Field(
        description=(
            "`walk` (double_threshold): a walk of set steps or time at one pace; the window is its mean spacing of "
            "steps. `middle` (double_threshold): `seconds` of anything; the window is learnt from the 300 samples in "
            "the middle. `slowest_walk` (gyro_zero_crossing): the user's slowest walk; both thresholds are learnt"
        )
    )
    pace: str | None = Field(
        default=None, min_length=1, max_length=40, description="What the walk was like, for people", examples=["slow"]
    )
    steps: int | None = Field(
        default=None,
        ge=STEPS[0],
        le=STEPS[1],
        description=f"Steps after which it ends, {STEPS[0]}–{STEPS[1]}; not for `middle`",
        examples=[50],
    )
    seconds: float | None = Field(
        default=None,
        ge=5,
        le=LONGEST_S,
        allow_inf_nan=False,
        description=f"Device time after which it ends, in s: 5–{LONGEST_S:g}, for `middle` 10–{LONGEST_S:g}",
    )


class CalibrationModel(BaseModel):
    """One recording of a device, and what its counter learnt."""

    number: int = Field(description="Its number among the device's calibrations, from 1", examples=[3])
    device: str = Field(examples=["sim-7f3a21"])
    counter: str = Field(examples=["double_threshold"])
    method: MethodName
    pace: str | None = Field(examples=["slow"])
    steps_wanted: int | None = Field(description="Steps after which it ends by itself", examples=[50])
    seconds_wanted: float | None = Field(description="Device time after which it ends by itself, s")
    state: State
    reason: str | None = Field(description="Why it failed, and what to do")
    began_at: datetime
    ended_at: datetime | None
    steps: int = Field(description="Steps counted so far", examples=[48])
    seconds: float = Field(description="Device time recorded so far, s", examples=[26.4])
    params: dict[str, int | float | str] | None = Field(
        description="Parameters learnt; null until it is done",
        examples=[{"window_mode": "fixed", "first_window": 27}],
    )
    detail: str | None = Field(
        description="What was learnt, for people", examples=["26.6 samples (0.53 s) a step over 47 intervals"]
    )


class CalibrationsChosen(BaseModel):
    """Done calibrations of one counter and method; of several, what they recorded is pooled."""

    model_config = ConfigDict(extra="forbid")

    numbers: list[int] = Field(min_length=1, max_length=100, examples=[[3, 4]])
