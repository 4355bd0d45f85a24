"""What the API says, as schemas: devices, steps, and every event of the live feed.

Times named `at` or `since` are UTC with an explicit offset; times named `*_s` are device time, seconds after the
device's boot. Accelerations are in g. `ordinal` counts a device's durable events from 1; ephemeral ones have none.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, Strict

from service.api.gait_models import CADENCE, GAIT, REFUSED, GaitModel, RefusedModel
from service.pipeline.lifecycle import State

Item = TypeVar("Item")

_DEVICE = "sim-7f3a21"
_AT = "2026-01-02T03:04:05.678000Z"

_DEVICE_UNCERTAINTY = "How far `device_s` may be off: half a sample, the device's clock, and the counter's filters"
_AT_UNCERTAINTY = "How far `at` may be off: `device_uncertainty_s` and the spread of delays; not the link's least delay"
_HEADING = "Direction of walking, clockwise from magnetic north; null where the sensors give none"
_HEADING_IS_LINE = "Whether it is that direction or the opposite one: a swinging limb does not tell; then under 180"
_HEADING_UNCERTAINTY = "Standard uncertainty of `heading_deg`"


class Page(BaseModel, Generic[Item]):
    """A list, and the cursor of what follows it: null at the end."""

    items: list[Item]
    next: str | None = Field(default=None, description="Pass as `after` for the next page; null at the end")


class Device(BaseModel):
    """A device as it stands now."""

    id: str = Field(description="The id the device gave itself; its link address until it has", examples=[_DEVICE])
    name: str | None = Field(examples=["Bracelet"])
    address: str = Field(description="Link address", examples=["F0:51:E9:7F:3A:21"])
    state: State
    reason: str | None = Field(description="Why it is lost, as a sentence")
    since: datetime = Field(description="When it came into this state", examples=[_AT])
    session_since: datetime = Field(description="Since when `steps` counts", examples=[_AT])
    primary: str = Field(description="Counter whose count `steps` is", examples=["steplink"])
    steps: int = Field(description="Confirmed steps since the session began; never falls", examples=[128])
    steps_now: int = Field(description="`steps` plus those that are likely; may fall", examples=[130])
    counters: dict[str, int] = Field(
        description="Each counter's own confirmed steps since it began",
        examples=[{"steplink": 128, "double_threshold": 169}],
    )
    counter_faults: dict[str, str] = Field(
        description="Why a counter does not count: a sensor the device lacks or does not send, or under 10 samples a"
        " second"
    )
    sensors: list[str] | None = Field(
        description="What the device says it measures; null until it has", examples=[["accelerometer", "gyroscope"]]
    )
    cadence_spm: float | None = Field(description=CADENCE, examples=[108.4])
    gait: GaitModel | None = Field(description=GAIT)
    refused: dict[str, RefusedModel] = Field(
        description=REFUSED, examples=[{"double_threshold": {"rest": 0, "other": 38, "perhaps": 3}}]
    )
    battery_percent: int | None = Field(examples=[87])
    rate_hz: float | None = Field(description="Nominal sampling rate", examples=[50.0])
    measured_rate_hz: float | None = Field(
        description="Sampling rate by the device's own clock, of the last ten to twenty minutes; null before it has"
        " told two ticks since its boot, or without a clock",
        examples=[50.0105],
    )
    measured_rate_uncertainty_hz: float | None = Field(
        description="The rate by that clock lies no further off: one tick (1/1024 s) in the time it was measured over",
        examples=[0.0008],
    )
    clock_drift_ppm: float | None = Field(
        description="How much faster its clock runs than the server's, over up to 68 minutes, negative where slower; of"
        " a device without a clock, how much faster it samples than it says; null until known to 50 ppm, which takes"
        " some minutes",
        examples=[-12.3],
    )
    clock_drift_uncertainty_ppm: float | None = Field(
        description="How far that may be off, 19 times in 20", examples=[2.9]
    )
    rssi_dbm: int | None = Field(examples=[-58])
    packets: int
    packets_bad: int = Field(description="Packets that broke the format; skipped")
    packets_duplicate: int = Field(description="Packets that held nothing new; skipped")
    packets_reordered: int = Field(description="Packets that came behind later ones; put in their place")
    samples: int
    samples_awaited: int = Field(
        description="Samples that did not arrive and are asked for again: what is behind them is in `steps_now` only"
    )
    samples_lost: int = Field(description="Samples that did not arrive and will not")
    samples_saturated: int = Field(description="Samples with a value at its limit, counted: the true one is unknown")
    gaps: int
    reboots: int
    register_steps: int | None = Field(
        description="The device's own count since its boot, where it has one: to compare with, never part of `steps`",
        examples=[125],
    )
    history_s: float | None = Field(
        description="How many seconds of samples it can send again; 0 none, null unknown", examples=[600.0]
    )
    manufacturer: str | None
    model: str | None
    firmware: str | None


class _Event(BaseModel):
    model_config = ConfigDict(ser_json_inf_nan="null")

    device: str = Field(examples=[_DEVICE])
    at: datetime = Field(description="UTC of the moment it tells of", examples=[_AT])


class _Durable(_Event):
    ordinal: int = Field(description="Number among the device's durable events, from 1", examples=[42])


class StepEvent(_Durable):
    """One confirmed step. `strength`, `peak`, `valley` and both thresholds are in g on the filtered signal.

    `upper` and `lower` are null for a counter without thresholds.
    """

    type: Literal["step"] = "step"
    device_s: float = Field(description="Device time of the step", examples=[21.34])
    boot: int
    counter: str = Field(examples=["double_threshold"])
    steps: int = Field(description="This counter's count with this step", examples=[37])
    device_uncertainty_s: float = Field(description=_DEVICE_UNCERTAINTY, examples=[0.01])
    at_uncertainty_s: float = Field(description=_AT_UNCERTAINTY, examples=[0.02])
    strength: float = Field(examples=[0.61])
    interval_s: float | None = Field(description="Time since the step before; null for the first", examples=[0.54])
    heading_deg: float | None = Field(description=_HEADING, examples=[47.0])
    heading_uncertainty_deg: float | None = Field(description=_HEADING_UNCERTAINTY, examples=[24.0])
    heading_is_line: bool | None = Field(description=_HEADING_IS_LINE)
    peak: float | None = Field(examples=[1.32])
    valley: float | None = Field(examples=[0.71])
    upper: float | None = Field(examples=[1.02])
    lower: float | None = Field(examples=[0.74])


class TentativeEvent(_Event):
    """A step of the primary counter that is likely, some 0.2 s after it happened; or that it has taken back.

    Every step is told so before it is confirmed by the `step` event with the same `counter`, `device_s` and `boot`;
    what is not confirmed is retracted. It has no ordinal and no log keeps it. See the guide, `navigation`.
    """

    type: Literal["tentative"] = "tentative"
    counter: str = Field(description="The primary, whose `step` confirms it", examples=["double_threshold"])
    status: Literal["likely", "retracted"]
    passes: bool = Field(description="Passes the thresholds in force when it was told: nine in ten of these are steps")
    device_s: float = Field(description="Device time of the step", examples=[21.34])
    boot: int
    device_uncertainty_s: float = Field(description=_DEVICE_UNCERTAINTY, examples=[0.01])
    at_uncertainty_s: float = Field(description=_AT_UNCERTAINTY, examples=[0.02])
    strength: float = Field(description="Height above the valleys, in the counter's unit", examples=[0.6])
    interval_s: float | None = Field(
        description="Time since the last confirmed step or likely one that passes; null after a pause", examples=[0.54]
    )
    heading_deg: float | None = Field(description=_HEADING, examples=[47.0])
    heading_uncertainty_deg: float | None = Field(description=_HEADING_UNCERTAINTY, examples=[24.0])
    heading_is_line: bool | None = Field(description=_HEADING_IS_LINE)


class StateEvent(_Durable):
    """The connection came into another state."""

    type: Literal["state"] = "state"
    state: State
    reason: str | None


class CorrectionEvent(_Durable):
    """Samples came late, and what was told behind them has been counted again: by how much that changed it."""

    type: Literal["correction"] = "correction"
    boot: int = Field(description="Boot that the times belong to", examples=[1])
    from_s: float = Field(description="Device time from which was counted again", examples=[22.4])
    to_s: float = Field(description="Device time up to which was counted again", examples=[55.5])
    removed: int = Field(description="Steps told as likely that are none", examples=[1])
    added: int = Field(description="Steps that had not been told", examples=[2])


class AwaitedEvent(_Event):
    """Samples did not arrive and are asked for again; a gap or a correction follows, or nothing where none was needed.

    Until then what comes behind them is tentative: it is in `steps_now`, not in `steps`. It has no ordinal.
    """

    type: Literal["awaited"] = "awaited"
    from_s: float = Field(description="Device time of the last sample before them", examples=[22.4])
    to_s: float = Field(description="Device time of the first sample after them", examples=[42.4])
    samples: int = Field(description="How many are missing", examples=[1000])


class GapEvent(_Durable):
    """Samples did not arrive and will not. Filled gaps (up to 0.6 s) were interpolated; no step lies inside others."""

    type: Literal["gap"] = "gap"
    from_s: float
    to_s: float
    samples: int
    filled: bool


class RebootEvent(_Durable):
    """The device started again: device time begins at zero, the count goes on."""

    type: Literal["reboot"] = "reboot"
    boot: int
    previous: int


class SegmentEvent(_Durable):
    """From now on another counter, or other parameters of it, count the device's steps."""

    type: Literal["segment"] = "segment"
    primary: str = Field(examples=["autocorrelation"])
    steps: int = Field(description="The device's steps so far")


class WalkEvent(_Durable):
    """A walk began or is over, by a primary that recognises walking; for a beginning, told once it is certain."""

    type: Literal["walk"] = "walk"
    status: Literal["began", "ended"]
    counter: str = Field(description="The primary that says so", examples=["steplink"])
    device_s: float = Field(
        description="Device time at which it began, in retrospect, or was no walk any more", examples=[21.34]
    )
    boot: int


class BandModel(BaseModel):
    """Both thresholds over a window of device time."""

    from_s: float
    to_s: float
    upper: float
    lower: float


class SignalEvent(_Event):
    """The primary counter's filtered signal, for plots; some may be left out for a slow reader."""

    type: Literal["signal"] = "signal"
    from_s: float = Field(description="Device time of the first value", examples=[21.2])
    rate_hz: int = 50
    values: list[float] = Field(description="g", examples=[[1.01, 1.04, 1.11]])
    bands: list[BandModel]


class CountingEvent(_Event):
    """Both counts, cadence and whether somebody walks, at each packet."""

    type: Literal["counting"] = "counting"
    now_s: float = Field(description="Device time of the newest sample")
    steps: int
    steps_now: int
    cadence_spm: float | None = Field(description=CADENCE)
    gait: GaitModel | None = Field(description=GAIT)


class DeviceEvent(_Event):
    """A device was heard for the first time, or its description changed."""

    type: Literal["device"] = "device"
    value: Device


class Snapshot(BaseModel):
    """The first message of a live feed: every device as it stands now."""

    type: Literal["snapshot"] = "snapshot"
    at: datetime
    devices: list[Device]


class Lagging(BaseModel):
    """The last message to a reader that was too slow; the feed closes with code 4408."""

    type: Literal["lagging"] = "lagging"
    detail: str


LiveMessage = Annotated[
    StepEvent
    | TentativeEvent
    | StateEvent
    | GapEvent
    | CorrectionEvent
    | AwaitedEvent
    | RebootEvent
    | SegmentEvent
    | WalkEvent
    | SignalEvent
    | CountingEvent
    | DeviceEvent
    | Snapshot
    | Lagging,
    Field(discriminator="type"),
]
DurableEvent = Annotated[
    StepEvent | StateEvent | GapEvent | CorrectionEvent | RebootEvent | SegmentEvent | WalkEvent,
    Field(discriminator="type"),
]


class ParameterModel(BaseModel):
    """One parameter of a counter: a number with unit and range, or one of a few words."""

    name: str = Field(examples=["rest_raw"])
    text: str = Field(description="What it does")
    unit: str | None
    whole: bool = Field(description="Whether it must be a whole number")
    low: float | None = Field(description="Smallest value, inclusive")
    high: float | None = Field(description="Largest value, inclusive")
    options: list[str] | None = Field(description="The words it takes")
    presets: dict[str, float | str] = Field(
        description="Its value in each preset; steplink has no paper, and both are the same",
        examples=[{"paper": 1.0, "tuned": 5.75}],
    )


class CounterModel(BaseModel):
    """A counter that can be asked for."""

    name: str = Field(examples=["double_threshold"])
    source: str = Field(description="The paper it is from", examples=["Adaptive double threshold: Wang, Peng, Zhou"])
    sensors: list[str] = Field(description="What a device must have", examples=[["accelerometer"]])
    latency_s: dict[str, float] = Field(
        description="Longest time from a step to its confirmation, by preset", examples=[{"paper": 4.6, "tuned": 8.2}]
    )
    calibrations: list[str] = Field(
        description="Ways to learn parameters of it from a walk on a device", examples=[["walk", "middle"]]
    )
    parameters: list[ParameterModel]


class ChoiceModel(BaseModel):
    """A counter, its preset, and the parameters that differ from it."""

    model_config = ConfigDict(extra="forbid")

    name: str = Field(examples=["double_threshold"])
    preset: str = Field(default="tuned", description="paper or tuned; steplink has no paper, and either is the same")
    params: dict[str, Annotated[float, Strict()] | str] = Field(default_factory=dict, examples=[{"rest_raw": 4.0}])


class LineupModel(BaseModel):
    """The counters of a device, the primary first: its count is the device's `steps`."""

    model_config = ConfigDict(extra="forbid")

    counters: list[ChoiceModel] = Field(min_length=1, max_length=16)


class OwnerModel(BaseModel):
    """Whose data a device's are."""

    model_config = ConfigDict(extra="forbid")

    person: str = Field(
        min_length=1, max_length=80, pattern=r"^[^/\x00-\x1f]+$", description="A name or a pseudonym", examples=["P07"]
    )


class Forgotten(BaseModel):
    """What was deleted."""

    sessions: int = Field(description="Sessions whose samples, steps and events are gone for good")


class Readiness(BaseModel):
    """Whether everything works that should, and what does not."""

    ready: bool
    reasons: list[str] = Field(description="A sentence for each thing that does not work, and what to do")


class Health(BaseModel):
    """That the service runs, whether it can hear devices, and whether what it counts is stored."""

    status: Literal["ok"] = "ok"
    version: str = Field(examples=["0.1.0"])
    devices: int
    bluetooth: Literal["ok", "unavailable"]
    reason: str | None = Field(description="Why nothing can be heard, and what to do")
    store: Literal["ok", "unavailable"]
    store_reason: str | None = Field(description="Why nothing is stored; counting goes on and is stored later")


class Problem(BaseModel):
    """What went wrong, as a sentence."""

    detail: str
