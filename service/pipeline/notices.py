"""What goes through the hub: a Tracker's events with the device's id, host time and, if durable, an ordinal."""

from __future__ import annotations

from dataclasses import dataclass

from service.pipeline.lifecycle import State
from service.samples import Counting, Described, Event, Gridded, Signal, Tentative


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


UNNUMBERED = (*EPHEMERAL, Tentative, Gridded)
"""Events without an ordinal, that no log keeps; a Tentative is queued like a durable one, for a retraction is news."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """One event of one device. `at_ns` is host UTC of the moment it tells of, known to `uncertainty_s`."""

    device: str
    at_ns: int
    uncertainty_s: float
    ordinal: int | None
    event: Told
