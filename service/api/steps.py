"""Steps and walks of a device, page by page."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from service.api import models
from service.api.views import nanoseconds, step_view, walk_view
from service.counters import registry
from service.errors import ParameterError
from service.pipeline.device import Device
from service.pipeline.notices import WALK, Notice, notice_of
from service.store.codec import STEP
from service.store.values import LogQuery

PAGE_LIMIT = 1000
"""Most items of one page."""


class EventsQuery(BaseModel):
    """Which events: after a cursor, from a time, to a time."""

    model_config = ConfigDict(extra="forbid")

    after: str | None = Field(
        default=None,
        pattern=r"^.+:\d{1,18}$",
        description="Cursor: `next` of the page before, or `device:ordinal` of the last one known",
        examples=["sim-7f3a21:42"],
    )
    from_: datetime | None = Field(
        default=None, alias="from", description="Earliest host time, with an offset", examples=["2026-01-02T03:00:00Z"]
    )
    to: datetime | None = Field(default=None, description="Host time before which they are told, with an offset")
    session: Literal["current", "all"] = Field(
        default="current",
        description="`all`: those of earlier sessions too, perhaps another person's; each counts its `steps` from 1",
    )
    limit: int = Field(default=100, ge=1, le=PAGE_LIMIT, description=f"Most of one page, 1–{PAGE_LIMIT}")


class StepsQuery(EventsQuery):
    """Which steps: after a cursor, from a time, to a time, of a counter."""

    counter: str | None = Field(default=None, description="Only this counter's; all where it is left out")


async def steps_page(device: Device, query: StepsQuery) -> models.Page[models.StepEvent]:
    """Return the page of a device's steps that `query` asks for; ParameterError where it makes no sense."""
    if query.counter is not None and query.counter not in registry.COUNTERS:
        raise ParameterError("counter", query.counter, f"one of {', '.join(registry.COUNTERS)}")
    notices, after = await _page(device, query, STEP, query.counter)
    return models.Page(items=[step_view(notice) for notice in notices], next=after)


async def walks_page(device: Device, query: EventsQuery) -> models.Page[models.WalkEvent]:
    """Return the page of a device's walks that `query` asks for, each with its beginning and its end."""
    notices, after = await _page(device, query, WALK)
    return models.Page(items=[walk_view(notice) for notice in notices], next=after)


async def _page(
    device: Device, query: EventsQuery, kind: str, counter: str | None = None
) -> tuple[list[Notice], str | None]:
    """Return the events of a kind that `query` asks for, and the cursor of what follows."""
    for name, moment in (("from", query.from_), ("to", query.to)):
        if moment is not None and moment.tzinfo is None:
            raise ParameterError(name, moment.isoformat(), "a time with an offset, as 2026-01-02T03:04:05Z")
    asked = LogQuery(
        device=device.id,
        after=max(
            _ordinal(query.after, device) if query.after else 0,
            device.session.after if query.session == "current" else 0,
        ),
        from_ns=None if query.from_ is None else nanoseconds(query.from_),
        to_ns=None if query.to is None else nanoseconds(query.to),
        kinds=frozenset({kind}),
        counter=counter,
        limit=query.limit,
    )
    page = await device.session.journal.page(asked)
    after = None if page.next_after is None else f"{device.id}:{page.next_after}"
    return [notice_of(entry, device.id) for entry in page.entries], after


def _ordinal(cursor: str, device: Device) -> int:
    key, _, ordinal = cursor.rpartition(":")
    if key not in {device.id, device.address}:
        raise ParameterError("after", cursor, f"a cursor of this device, as {device.id}:42")
    return int(ordinal)
