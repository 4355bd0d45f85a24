"""Document 001's time filter and tuning from its text, over a whole filtered norm: what the kernel must agree with."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil


@dataclass
class Event:
    at: int
    value: float
    peak: bool
    until: float = 0.0

    def beaten_by(self, value):
        return value > self.value if self.peak else value < self.value


def extrema(norm, first):
    """(3): three-point peaks and valleys from index `first` on."""
    for n in range(first, len(norm) - 1):
        if norm[n - 1] < norm[n] > norm[n + 1]:
            yield Event(n, norm[n], peak=True)
        elif norm[n - 1] > norm[n] < norm[n + 1]:
            yield Event(n, norm[n], peak=False)


def steps(norm, p, *, first, first_half):  # noqa: C901  # one page of the document, one function
    """Return (peak index, valley index, peak, valley) of each pair, every one of which counts: no check, no bout."""
    found: list[tuple[int, int, float, float]] = []
    events: list[Event] = []
    delta_t1, final, delta = first_half, 0, 0.0

    def settle():
        """The last event is final; with the peak before, a valley makes a pair, and a jump of Δa tunes (11), (12)."""
        nonlocal delta_t1, final, delta
        if final == len(events):
            return
        final = len(events)
        if events[-1].peak or len(events) < 2 or events[-2].value - events[-1].value <= p.rest_g:
            return
        peak, valley = events[-2:]
        if found and peak.at - found[-1][0] >= p.longest_step:
            delta = 0.0
        height = peak.value - valley.value
        if delta == 0.0 or abs(height - delta) > p.jump_g:
            frequency = min(ceil(50.0 / (2.0 * (valley.at - peak.at))), 5)
            delta_t1 = 50.0 / (2.0 * frequency)
        delta = height
        found.append((peak.at, valley.at, peak.value, valley.value))

    for new in extrema(norm, first):
        if events and new.at >= events[-1].until:
            settle()
        if events and new.at - events[-1].at > p.longest_half:
            settle()
            events, final, delta_t1 = [], 0, first_half
        if events and events[-1].peak == new.peak:
            if final < len(events) and events[-1].beaten_by(new.value):
                events[-1].at, events[-1].value = new.at, new.value
                if len(events) > 1:
                    delta_t1 = new.at - events[-2].at
            continue
        since = new.at - events[-1].at if events else delta_t1
        if events and since <= p.reject_share * min(delta_t1, p.half_limit):
            continue
        if events:
            settle()
            delta_t1 = since
        new.until = new.at + p.update_share * since
        events.append(new)
    settle()
    return found
