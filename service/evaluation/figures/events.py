"""What the fusion counter makes of each extremum: watched from outside, sample by sample, through its own state.

The counter runs as it does live; after every sample its snapshot says which extremum stands last. So a figure shows the
counter's own decisions, and whatever the kernel comes to do it will show that. The three-point rule (3) alone is
repeated here, on the counter's own filtered norm, to find the extrema that were not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from service.counters import fusion_state as state
from service.counters import registry
from service.counters.fusion import PAPER
from service.evaluation.counting import pieces
from service.evaluation.figures.sources import Floats, Source


class Kind(Enum):
    """What became of an extremum."""

    TAKEN = "taken"
    REPLACED = "replaced"
    REJECTED = "rejected"
    PASSED_OVER = "passed over"


WORTH: Final = {Kind.REPLACED: (10.0, 2), Kind.REJECTED: (3.0, 4), Kind.TAKEN: (1.0, 30), Kind.PASSED_OVER: (-1.0, 30)}
"""What an event adds to a stretch that is to be shown, and how many may: some of each, and no muddle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One extremum of the filtered norm; `at` in samples after the source's first, the filter's delay taken off.

    `reject` and `update` are the regions (from, to) that it opens; None where it opens none. The first ends with the
    last sample that would have been rejected as an extremum (Δt₁ may change meanwhile), both where it is replaced.
    """

    at: float
    norm_g: float
    kind: Kind
    reject: tuple[float, float] | None = None
    update: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """The counter's filtered norm, a value for each sample of the source, and its extrema in their order."""

    norm_g: Floats
    events: Sequence[Event]


def events(source: Source) -> Watched:
    """Run the fusion counter with the published parameters over the source, and tell what it does."""
    counter = registry.make("fusion", "paper")
    found: dict[int, Event] = {}
    trace: list[float] = []
    before = _Belief.of([0.0] * state.SIZE)
    for piece in pieces(source.signal, 1):
        trace += counter.update(piece).trace
        now = _Belief.of(_whole(counter.snapshot()["state"]))
        _note(found, trace, source.signal.start, before, now)
        before = now
    lag = round(_delay(source))
    norm_g = np.array(trace)
    shifted = np.concatenate([norm_g[lag:], np.full(min(lag, len(norm_g)), np.nan)])
    return Watched(norm_g=shifted, events=[_shifted(event, lag) for event in found.values()])


def busiest(watched: Watched, length: int) -> tuple[slice, float]:
    """Return the stretch of `length` samples (or all) whose events are worth most, and what they are worth."""
    samples = len(watched.norm_g)
    length = min(length, samples)
    worth = np.zeros(samples - length + 1)
    for kind, (each, most) in WORTH.items():
        there = np.zeros(samples)
        there[[int(event.at) for event in watched.events if event.kind is kind and event.at >= 0]] = 1.0
        worth += each * np.minimum(np.convolve(there, np.ones(length), mode="valid"), most)
    first = int(np.argmax(worth))
    return slice(first, first + length), float(worth[first])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Belief:
    """The part of the state that says which extremum stands, and until when."""

    kind: float
    at: float
    half: float
    due: float

    @classmethod
    def of(cls, s: Sequence[float]) -> _Belief:
        return cls(kind=s[state.KIND], at=s[state.AT], half=s[state.HALF], due=s[state.DUE])


def _whole(changing: Sequence[float]) -> list[float]:
    """Put a snapshot's state back where `fusion_state` names its places: behind the constants."""
    return [0.0] * state.CONSTANTS + list(changing)


def _note(found: dict[int, Event], trace: Sequence[float], start: int, before: _Belief, now: _Belief) -> None:
    """Note what the last sample decided: it makes the one before it an extremum, or none."""
    if len(trace) < 3:
        return
    at, (older, last, newest) = len(trace) - 2, trace[-3:]
    if now.at == start + at:
        if now.kind == before.kind and (replaced := round(before.at) - start) in found:
            found[replaced] = replace(found[replaced], kind=Kind.REPLACED, update=(replaced, at))
        found[at] = Event(at=at, norm_g=last, kind=Kind.TAKEN, update=_update(now, at, start))
    elif before.kind and ((older < last > newest) or (older > last < newest)):
        same = before.kind == (state.PEAK if last > newest else state.VALLEY)
        found[at] = Event(at=at, norm_g=last, kind=Kind.PASSED_OVER if same else Kind.REJECTED)
    standing, newest_at = round(now.at) - start, at + 1
    reach = PAPER.reject_share * min(now.half, PAPER.half_limit)
    if standing in found and newest_at - standing <= reach:
        found[standing] = replace(found[standing], reject=(standing, newest_at))


def _update(now: _Belief, at: int, start: int) -> tuple[float, float] | None:
    """Return from where to where another may replace it; None where it was final at once."""
    return (at, now.due - start) if now.due < state.NEVER else None


def _delay(source: Source) -> float:
    """Return by how many samples the filtered norm lags."""
    probe = registry.make("fusion", "paper").update(pieces(source.signal, 1)[0])
    return source.signal.start - probe.trace_from_s * state.GRID_HZ


def _shifted(event: Event, lag: int) -> Event:
    def back(span: tuple[float, float] | None) -> tuple[float, float] | None:
        return None if span is None else (span[0] - lag, span[1] - lag)

    return replace(event, at=event.at - lag, reject=back(event.reject), update=back(event.update))
