"""Steps of the fusion counter: of each final peak and valley, is it one, and is it certain? `fusion` says why.

A step is a row of `ROW` floats: `(index of the peak on the filtered norm, samples since the step before or 0, peak,
valley, pseudo zero crossing, displacement in m, direction in rad)`.
"""

from __future__ import annotations

from math import sin, sqrt
from typing import Final

from service.counters.fusion_checks import (
    DEPTH,
    GYROSCOPE,
    MAGNETOMETER,
    correlation,
    direction,
    displacement_m,
    field_movement,
    has_extremum,
    main_axis,
    variance,
)
from service.counters.fusion_state import (
    ACCEPTED,
    ALONG,
    AT,
    BEFORE_LAST,
    BOUT,
    BOUT_STEPS,
    BRIDGE,
    CROSSING,
    D1,
    D2,
    D3,
    DELAY,
    DELTA,
    FIELD,
    FILTERS,
    FIRST,
    GRID_HZ,
    HALF,
    HELD,
    IRREGULAR,
    JUMP,
    MATCHED,
    MAX_STEP,
    MEASURED,
    MOTION,
    PEAK_AT,
    PEAK_VALUE,
    PERIOD,
    PERIODIC,
    PREVIOUS,
    QUARTER,
    ROW,
    SHARE,
    SUSPECT_SHARE,
    SWING,
    TOLERANCE,
    TRUST,
    TUNED_TO,
    TURNS,
    VALUE,
    State,
)
from service.counters.fusion_swing import STILL, TAKEN, look

MIRRORED: Final = -0.7
"""Correlation of a step's swing with the one before from which on it is even: its extrema may then lie anywhere."""


def take_pair(s: State, now: int, out: State, rows: int) -> int:
    """Take a final peak and the valley after it for a step, if the checks agree: tune the filter, check, count."""
    at, delta = s[PEAK_AT], s[PEAK_VALUE] - s[VALUE]
    if s[BOUT_STEPS] > 0.0 and at - s[ACCEPTED] >= (BRIDGE if s[ACCEPTED] < s[FIRST] else s[MAX_STEP]):
        end_bout(s)
    crossing = (s[PEAK_VALUE] + s[VALUE]) / 2.0
    suspect = s[PREVIOUS] >= 0.0 and (s[PEAK_VALUE] <= s[CROSSING] or s[VALUE] >= s[CROSSING])
    first, last, shift = int(s[PREVIOUS]), int(at), int(s[DELAY])
    turn = STILL
    if s[TURNS] > 0.0:
        turn = look(s, first, last, min(last + _reach(s, last - first), now - 1))
    if s[PERIOD] > 0.0:
        _tune(s, 0.5 * s[PERIOD])
    elif s[DELTA] <= 0.0 or delta - s[DELTA] > s[JUMP] or delta - s[DELTA] < -s[JUMP]:
        _tune(s, s[AT] - at)
    s[DELTA], s[CROSSING] = delta, crossing
    before = int(s[BEFORE_LAST])
    s[BEFORE_LAST], s[PREVIOUS] = s[PREVIOUS], at
    measured = first >= 0 and last - first < s[MAX_STEP]
    distance = heading = 0.0
    if measured:
        heading = direction(s, MOTION, first - shift, last - shift)
        distance = _distance(s, heading, first - shift, last - shift)
        gyro = main_axis(s, MOTION, GYROSCOPE, first, last)
        if not suspect and variance(s, MOTION, gyro, first, last) > s[SWING]:
            if turn == TAKEN:
                return rows
            if turn >= 0:
                s[MATCHED] = float(turn)
            suspect = _unmatched(s, gyro, before, first, last, now)
    if not _far_enough(s, measured, distance, suspect):
        return rows
    return _step(s, at, crossing, distance, heading, out, rows)


def end_bout(s: State) -> None:
    """End the walk: its displacements and amplitude say nothing about the next."""
    s[BOUT_STEPS] = s[MEASURED] = s[DELTA] = 0.0


def _tune(s: State, half: float) -> None:
    """(12): the step frequency, rounded up, is the filter's number and gives the next Δt₁."""
    frequency = GRID_HZ / (2.0 * half)
    index = float(int(frequency))
    if index < frequency:
        index += 1.0
    if index > FILTERS:
        index = float(FILTERS)
    s[TUNED_TO] = index
    s[HALF] = GRID_HZ / (2.0 * index)


def _distance(s: State, heading: float, first: int, last: int) -> float:
    """Return the horizontal displacement (16) over a step in m, or its part along the step's direction."""
    north, east = displacement_m(s, MOTION, first, last)
    if s[ALONG] > 0.0:
        along = north * sin(QUARTER - heading) + east * sin(heading)
        return along if along >= 0.0 else -along
    return sqrt(north * north + east * east)


def _unmatched(s: State, gyro: int, before: int, first: int, last: int, now: int) -> bool:
    """Tell whether the main axis of a device that swings, or its trusted magnetometer's, does not go with the step."""
    mag = main_axis(s, MOTION, MAGNETOMETER, first, last)
    step = last - first
    rho = 0.0
    swings = turns = False
    if before >= 0 and first - before < s[MAX_STEP] and now - (first - step) < DEPTH and s[FIRST] <= first - step:
        rho = correlation(s, MOTION, gyro, first, last, step)
        swings = _periodic(s, rho)
        turns = _periodic(s, correlation(s, MOTION, mag, first, last, step))
    if s[IRREGULAR] > 0.0 and not swings:
        return True
    reach = _reach(s, step)
    to = min(last + reach, now - 1)
    mirrored = s[TURNS] > 0.0 and rho <= MIRRORED
    if not mirrored and not has_extremum(s, MOTION, gyro, last - reach, to):
        return True
    disturbed = field_movement(s, MOTION, first, last) > s[FIELD] or (swings and not turns)
    return not disturbed and not has_extremum(s, MOTION, mag, last - reach, to)


def _periodic(s: State, rho: float) -> bool:
    """Tell whether a step's swing is that of the step before, or its mirror image: it runs at half the step rate."""
    return rho >= s[PERIODIC] or rho <= -s[PERIODIC]


def _reach(s: State, step: int) -> int:
    """Return how far an extremum may be from its peak."""
    return int(s[TOLERANCE] * float(step)) + 1


def _far_enough(s: State, measured: bool, distance: float, suspect: bool) -> bool:
    """(17), (18): farther than a share of the mean of the last three accepted; the first three pass."""
    if not measured:
        return True
    if s[MEASURED] < 3.0:
        return not suspect or s[TRUST] > 0.0
    share = s[SUSPECT_SHARE] if suspect else s[SHARE]
    return distance > share * (s[D1] + s[D2] + s[D3]) / 3.0


def _step(s: State, at: float, crossing: float, distance: float, heading: float, out: State, rows: int) -> int:
    """Accept a step; write it once its bout is certain, together with those that waited for that."""
    spacing = at - s[ACCEPTED] if s[BOUT_STEPS] > 0.0 and s[ACCEPTED] >= s[FIRST] else 0.0
    if distance > 0.0:
        s[D1], s[D2], s[D3] = s[D2], s[D3], distance
        s[MEASURED] += 1.0
    s[ACCEPTED] = at
    s[BOUT_STEPS] += 1.0
    if s[BOUT_STEPS] > s[BOUT]:
        return _row(s, out, rows, at, spacing, crossing, distance, heading)
    held = HELD + int(s[BOUT_STEPS] - 1.0) * ROW
    _row(s, s, held, at, spacing, crossing, distance, heading)
    if s[BOUT_STEPS] < s[BOUT]:
        return rows
    for i in range(HELD, held + ROW):
        out[rows] = s[i]
        rows += 1
    return rows


def _row(s: State, to: State, place: int, at: float, spacing: float, crossing: float, d: float, heading: float) -> int:
    to[place], to[place + 1], to[place + 2], to[place + 3] = at, spacing, s[PEAK_VALUE], s[VALUE]
    to[place + 4], to[place + 5], to[place + 6] = crossing, d, heading
    return place + ROW
