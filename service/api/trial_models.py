"""Schemas of trials: devices carried on one walk, and what each counted beside the true number."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from service.pipeline.trial import TRUE_STEPS_MAX, State

TrueSteps = Annotated[
    int | None,
    Field(default=None, ge=0, le=TRUE_STEPS_MAX, description="Steps that were really taken", examples=[200]),
]
_NAME = "Test item: how it was walked"


class TrialWanted(BaseModel):
    """A trial to begin, on two different devices that stream."""

    model_config = ConfigDict(extra="forbid")

    devices: list[str] = Field(min_length=2, max_length=2, description="Ids", examples=[["sim-1", "sim-2"]])
    name: str | None = Field(default=None, min_length=1, max_length=80, description=_NAME, examples=["slow"])
    wrists: dict[str, Literal["left", "right"]] = Field(
        default_factory=dict, description="Where each is worn", examples=[{"sim-1": "left", "sim-2": "right"}]
    )


class TrialEnd(BaseModel):
    """What is known at the end of a walk."""

    model_config = ConfigDict(extra="forbid")

    true_steps: TrueSteps


class TrialChange(BaseModel):
    """What may be told later; what is left out stays."""

    model_config = ConfigDict(extra="forbid")

    true_steps: TrueSteps
    name: str = Field(default="", min_length=1, max_length=80, description=_NAME)


class TrialRow(BaseModel):
    """One device's count. Error and accuracy are null until the trial is done and the true number known."""

    device: str = Field(examples=["sim-1"])
    wrist: Literal["left", "right"] | None
    counter: str = Field(description="The device's primary when the trial began", examples=["steplink"])
    steps: int = Field(description="Confirmed steps in the trial", examples=[196])
    steps_now: int = Field(description="`steps` plus those that are likely; may fall", examples=[196])
    error: int | None = Field(description="`steps` − true", examples=[-4])
    accuracy_percent: float | None = Field(
        description="100·(1 − |error|/true); null where none was true", examples=[98]
    )
    note: str | None = Field(description="What makes the count doubtful: losses, gaps, restarts, another counter")


class TrialMean(BaseModel):
    """The mean over the trial's devices."""

    steps: float = Field(examples=[195.5])
    error: float | None = Field(examples=[-4.5])
    accuracy_percent: float | None = Field(examples=[97.75])


class TrialModel(BaseModel):
    """A walk that several devices counted, as Table 4 of Wang 2018."""

    number: int = Field(examples=[1])
    name: str = Field(description=_NAME, examples=["slow"])
    state: State = Field(description="`settling`: ended, and the last steps are still being confirmed")
    began_at: datetime
    ended_at: datetime | None
    true_steps: int | None = Field(examples=[200])
    rows: list[TrialRow]
    mean: TrialMean
