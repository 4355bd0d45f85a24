"""What goes through the hub: a Tracker's events with the device's id, host time and, if durable, an ordinal."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final

from service.events import (
    Awaited,
    Corrected,
    Counting,
    Described,
    Event,
    Gap,
    Gridded,
    Heard,
    Rebooted,
    Received,
    Segmented,
    Signal,
    StepCounted,
    Tentative,
    Walked,
)
from service.pipeline.lifecycle import State
from service.store.values import LogEntry, Note


@dataclass(frozen=True, slots=True, kw_only=True)
class StateChanged:
    """Durable: a device's connection came into another state; `reason` is a sentence where it was not wanted."""

    state: State
    reason: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceChanged:
    """Ephemeral: something a device's description says has changed, or a device was seen for the first time."""


Told = Event | StateChanged | DeviceChanged

EPHEMERAL = (Signal, Counting, Described, DeviceChanged)
"""Events of which only the newest matters: no ordinal, conflated for slow readers."""


UNNUMBERED = (*EPHEMERAL, Gridded, Received, Heard, Tentative, Awaited)
"""Events without an ordinal, that no log keeps; a Tentative is queued like a durable one, for a retraction is news."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """One event of one device. `at_ns` is host UTC of the moment it tells of, known to `uncertainty_s`."""

    device: str
    at_ns: int
    uncertainty_s: float
    ordinal: int | None
    event: Told


WALK: Final = "walk"
"""Kind of a log entry that tells of a walk."""
KINDS: Final[dict[str, type[Any]]] = {
    "state": StateChanged,
    "gap": Gap,
    "correction": Corrected,
    "reboot": Rebooted,
    "segment": Segmented,
    WALK: Walked,
}
"""Durable events that are no steps, by the name they are stored under."""
_NAMES: Final = {event: kind for kind, event in KINDS.items()}


def entry_of(notice: Notice, run: int) -> LogEntry:
    """Return a durable notice as the store keeps it."""
    event = notice.event
    told = event if isinstance(event, StepCounted) else Note(kind=_NAMES[type(event)], body=dataclasses.asdict(event))
    return LogEntry(
        ordinal=notice.ordinal or 0, at_ns=notice.at_ns, uncertainty_s=notice.uncertainty_s, run=run, told=told
    )


def notice_of(entry: LogEntry, device: str) -> Notice:
    """Return a stored event as it was told."""
    told = entry.told
    if isinstance(told, StepCounted):
        event: Told = told
    else:
        body = dict(told.body)
        event = KINDS[told.kind](**({**body, "state": State(body["state"])} if told.kind == "state" else body))
    return Notice(
        device=device, at_ns=entry.at_ns, uncertainty_s=entry.uncertainty_s, ordinal=entry.ordinal, event=event
    )
