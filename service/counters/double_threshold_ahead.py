"""Which peaks of the double threshold may become steps: told at once, long before a window closes.

Runs once a packet, plain; `double_threshold_kernel` keeps the state it reads.
"""

from __future__ import annotations

from service.counters.double_threshold_kernel import (
    AT,
    BOUT,
    BOUT_PEAKS,
    CAPACITY,
    CLOSED,
    COUNT,
    CREDIT,
    ENTRY,
    FILTERED,
    HALF,
    HEAD,
    HELD,
    HIGH,
    HIGH_KNOWN,
    LAST,
    LOW,
    LOW_KNOWN,
    LOWER,
    MAX_SPACING,
    MIN_SPACING,
    NEXT,
    PEAK,
    QUEUE,
    REST,
    ROW,
    SEEN,
    UPPER,
    VALLEY,
    VALLEYS,
    State,
)
from service.samples import Likely


def likely(s: State) -> list[Likely]:
    """Return every peak that can still become a step: index, height, and whether it passes what is in force.

    Those are the held ones of a bout that can still become certain, and all undecided ones that no rule excludes yet.
    One passes if it does by the thresholds of the last window and no other that does lies too near before it.
    """
    peaks, last = s[BOUT_PEAKS], s[LAST]
    waiting = _waiting(s, peaks, last) if s[COUNT] > 0.0 else []
    if not 0.0 < peaks < s[BOUT] or s[CREDIT] == 0.0:
        return waiting
    first = waiting[0][0] if waiting else s[NEXT] - s[HALF]
    if min(first, s[NEXT] - s[HALF]) - last >= s[MAX_SPACING]:
        return waiting
    held = range(HELD, HELD + int(peaks) * ROW, ROW)
    return [(s[i + 1], s[i + 3] - s[i + 4], True) for i in held] + waiting


def _waiting(s: State, peaks: float, last: float) -> list[Likely]:
    """Return the undecided peaks that no rule excludes yet."""
    found: list[Likely] = []
    nearest, rest, in_force = s[MIN_SPACING], s[REST], s[HIGH_KNOWN] > 0.0 and s[LOW_KNOWN] > 0.0
    low = s[LOW] if in_force else s[FILTERED]
    upper = (s[HIGH] + low) / 2.0
    after = sure_after = last + nearest if peaks > 0.0 else -1.0
    short = 0.0 if s[CREDIT] > 0.0 else s[BOUT] - peaks - 1.0
    q, end = QUEUE + int(s[HEAD]) * ENTRY, QUEUE + int(s[CAPACITY]) * ENTRY
    for _ in range(int(s[COUNT])):
        at, peak, known = s[q + AT], s[q + PEAK], s[q + CLOSED] > 0.0
        excluded = at <= after or (
            known and (peak <= s[q + UPPER] or (s[q + SEEN] >= s[VALLEYS] and s[q + VALLEY] >= s[q + LOWER]))
        )
        q += ENTRY
        if q == end:
            q = QUEUE
        if excluded:
            continue
        if short > 0.0:
            short -= 1.0  # a reference at most
            continue
        height = peak - low
        passes = in_force and peak > upper and height >= rest and at > sure_after
        if passes:
            sure_after = at + nearest
        found.append((at, height if height > 0.0 else 0.0, passes))  # noqa: FURB136  # a call costs more
    return found
