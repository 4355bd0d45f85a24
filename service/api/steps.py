"""Steps of a device, page by page."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from service.api import models
from service.api.views import step_view, utc
from service.errors import ParameterError
from service.pipeline.device import Device
from service.samples import StepCounted

PAGE_LIMIT = 1000
"""Most items of one page."""


class StepsQuery(BaseModel):
    """Which steps: after a cursor, from a time, to a time."""

    model_config = ConfigDict(extra="forbid")

    after: str | None = Field(
        default=None,
        pattern=r"^.+:\d{1,18}$",
        description="Cursor: `next` of the page before, or `device:ordinal` of the last step known",
        examples=["sim-7f3a21:42"],
    )
    from_: datetime | None = Field(
        default=None, alias="from", description="Earliest host time, with an offset", examples=["2026-01-02T03:00:00Z"]
    )
    to: datetime | None = Field(default=None, description="Host time before which steps are told, with an offset")
    counter: str | None = Field(default=None, description="Only this counter's; all where it is left out")
    limit: int = Field(default=100, ge=1, le=PAGE_LIMIT, description=f"Most steps of one page, 1–{PAGE_LIMIT}")


def list_page(device: Device, query: StepsQuery) -> models.Page[models.StepEvent]:
    """Return the page of a device's steps that `query` asks for; ParameterError where it makes no sense."""
    for name, moment in (("from", query.from_), ("to", query.to)):
        if moment is not None and moment.tzinfo is None:
            raise ParameterError(name, moment.isoformat(), "a time with an offset, as 2026-01-02T03:04:05Z")
    last = _ordinal(query.after, device) if query.after else 0
    if query.counter is not None and query.counter not in device.session.tracker.steps:
        known = ", ".join(device.session.tracker.steps)
        raise ParameterError("counter", query.counter, f"this device has {known}")
    found = [
        notice
        for notice in device.session.steps()
        if (notice.ordinal or 0) > last
        and (query.from_ is None or utc(notice.at_ns) >= query.from_)
        and (query.to is None or utc(notice.at_ns) < query.to)
        and (query.counter is None or (isinstance(notice.event, StepCounted) and notice.event.counter == query.counter))
    ]
    items = [step_view(notice) for notice in found[: query.limit]]
    more = len(found) > query.limit
    return models.Page(items=items, next=f"{device.id}:{items[-1].ordinal}" if more else None)


def _ordinal(cursor: str, device: Device) -> int:
    key, _, ordinal = cursor.rpartition(":")
    if key not in {device.id, device.address}:
        raise ParameterError("after", cursor, f"a cursor of this device, as {device.id}:42")
    return int(ordinal)
