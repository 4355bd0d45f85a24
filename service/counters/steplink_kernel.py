"""A packet through the whole of steplink's counter as one scalar kernel, for sessions with the `fast` extra.

What `steplink_network` and `steplink_rhythm` do in numpy for any number of frames stands here for one, over the same
memory: `packet` takes turns with them at any sample, and steps and state are the same bits. All the network's sums are
whole numbers, so it may pass over what is 0; and the rhythm's sums are. It is made to be compiled; plain it would take
milliseconds a frame.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from math import exp
from typing import Final

import numpy as np

from service.counters import steplink_network as network
from service.counters import steplink_rhythm as rhythm
from service.counters.steplink_ahead import scan_likely
from service.counters.steplink_bouts import LOW, TOLD, advance
from service.counters.steplink_front import ROW, SENSED, scan
from service.counters.steplink_network import FRAME_ROWS, LAYERS, POOLED, WIDE
from service.counters.steplink_rhythm import (
    ACCEPTED,
    COLUMNS,
    FACTORS,
    LAGS,
    LOGIT,
    ROWS_HZ,
    SLOWEST_HZ,
    SPAN_HZ,
    WINDOW,
)

Floats = MutableSequence[float]
Values = MutableSequence[np.float32]
Places = Sequence[int]

PLACE, INPUTS, OUTPUTS, TAPS, STEP, ADDS, VALUES, NEW, WEIGHTS = range(9)
PLAN: Final = np.array(
    [
        [
            place,
            layer.inputs,
            layer.outputs,
            layer.taps,
            layer.every * layer.inputs,
            layer.adds,
            network.values_a_frame(i),
            place + layer.reach * layer.inputs,
            weights,
        ]
        for i, (layer, place, weights) in enumerate(zip(LAYERS, network.layout(1), network.PLACES, strict=False))
    ]
)
"""A row a layer; PLACE is where its memory begins, NEW where a frame goes."""

LAST: Final = len(LAYERS) - 1
FRAMED_FROM: Final = network.FRAMED_FROM

ROUNDING: Final = np.float32(1.5 * 2.0**23)
ROUNDING_64: Final = 1.5 * 2.0**52
"""Added and taken away again, it rounds as `rint` does."""
NONE: Final = np.float32(0.0)
MOST: Final = np.float32(network.LIMIT)
POOLED_32: Final = np.float32(POOLED)

APART: Final = WINDOW + LAGS
UNBIASED: Final = rhythm.UNBIASED
PERIODS: Final = rhythm.PERIODS
COSTS: Final = rhythm.COSTS
CURVE: Final = len(FACTORS)

SUMS: Final = max(layer.outputs for layer in LAYERS)
GIVEN: Final = SUMS + max(LAYERS[0].outputs * FRAME_ROWS, WIDE * POOLED)
"""Room for the sums of a layer, and for what one gives that does not go into the next as it is."""
CORRELATED: Final = COLUMNS * APART
FOUND: Final = CORRELATED + 2 * LAGS
"""Room for the levelled columns, and for both correlations."""


def packet(
    x: Floats,
    y: Floats,
    z: Floats,
    n: int,
    f: Floats,
    s: Floats,
    rows: Floats,
    held: int,
    memory: Values,
    moves: Places,
    weights: Values,
    seen: Floats,
    given: Values,
    found: Floats,
    answers: Floats,
    out: Floats,
) -> tuple[int, int, int]:
    """Count n samples; `rows` begins with `held` of the frame that is not complete.

    Writes the filtered signal to `out`, the rows of steps after it, then those of likely ones, then what is TOLD.
    Returns how many rows are held now, where steps and where likely ones end.
    """
    held += scan(x, y, z, n, f, out, rows[held * ROW :])
    frames = held // FRAME_ROWS
    for k in range(frames):
        first = k * FRAME_ROWS * ROW
        logit, pace = infer(rows, first, memory, moves, weights, given)
        keep(rows, first, seen)
        if logit > s[LOW]:
            pace = refined_hz(pace, seen, found)
        answers[k], answers[frames + k] = logit, pace
    done = frames * FRAME_ROWS
    held -= done
    for i in range(held * ROW):
        rows[i] = rows[done * ROW + i]
    steps = n + advance(s, out, n, answers, answers[frames:], out[n:])
    end = steps + scan_likely(s, out[steps:])
    for i in range(len(TOLD)):
        out[end + i] = s[TOLD[i]]
    return held, steps, end


def infer(
    rows: Floats, first: int, memory: Values, moves: Places, weights: Values, given: Values
) -> tuple[float, float]:
    """Return logit and the network's cadence for the frame of rows from `first` on."""
    new = PLAN[0, NEW]
    for row in range(FRAME_ROWS):
        for i in range(SENSED):
            memory[new + row * SENSED + i] = np.float32(rows[first + row * ROW + i])
    _layer(0, memory, weights, given, given, SUMS)
    outputs, to = PLAN[0, OUTPUTS], PLAN[1, NEW]
    for i in range(POOLED):
        for o in range(outputs):
            at = SUMS + 2 * i * outputs + o
            memory[to + i * outputs + o] = max(given[at], given[at + outputs])
    for layer in range(1, FRAMED_FROM - 1):
        _layer(layer, memory, weights, given, memory, PLAN[layer + 1, NEW])
    _layer(FRAMED_FROM - 1, memory, weights, given, given, SUMS)
    _pool(given, memory, PLAN[FRAMED_FROM, NEW])
    for layer in range(FRAMED_FROM, LAST):
        _layer(layer, memory, weights, given, memory, PLAN[layer + 1, NEW])
    _sum(LAST, PLAN[LAST, PLACE], memory, weights, given)
    for i in range(len(moves)):
        memory[i] = memory[moves[i]]
    return float(given[0]) * LOGIT, SLOWEST_HZ + SPAN_HZ / (1.0 + exp(0.5 - float(given[1]) * LOGIT))


def _layer(layer: int, memory: Values, weights: Values, sums: Values, to: Values, end: int) -> None:
    """Write what a layer gives to `to`, from `end` on."""
    outputs = PLAN[layer, OUTPUTS]
    for value in range(PLAN[layer, VALUES]):
        at = value * PLAN[layer, INPUTS]
        _sum(layer, PLAN[layer, PLACE] + at, memory, weights, sums)
        for o in range(outputs):
            given = max((sums[o] + ROUNDING) - ROUNDING, NONE)
            if PLAN[layer, ADDS]:
                given += memory[PLAN[layer, NEW] + at + o]
            to[end] = min(given, MOST)
            end += 1


def _sum(layer: int, at: int, memory: Values, weights: Values, sums: Values) -> None:
    """Sum up one value of a layer, the oldest that it looks at being at `at`."""
    inputs, outputs, taps, step = PLAN[layer, INPUTS], PLAN[layer, OUTPUTS], PLAN[layer, TAPS], PLAN[layer, STEP]
    weight = PLAN[layer, WEIGHTS]
    for o in range(outputs):
        sums[o] = weights[weight + taps * inputs * outputs + o]
    for tap in range(taps):
        for i in range(inputs):
            given = memory[at + tap * step + i]
            if given != NONE:
                for o in range(outputs):
                    sums[o] += given * weights[weight + o]
            weight += outputs


def _pool(given: Values, memory: Values, to: int) -> None:
    """Write mean and greatest of the frame's values."""
    for o in range(WIDE):
        total = most = given[SUMS + o]
        for i in range(1, POOLED):
            value = given[SUMS + i * WIDE + o]
            total += value
            most = max(most, value)
        memory[to + o] = (total / POOLED_32 + ROUNDING) - ROUNDING
        memory[to + WIDE + o] = most


def keep(rows: Floats, first: int, seen: Floats) -> None:
    """Move a frame of rows into the window that the rhythm is looked for in."""
    for column in range(COLUMNS):
        at = column * WINDOW
        for i in range(WINDOW - FRAME_ROWS):
            seen[at + i] = seen[at + i + FRAME_ROWS]
        for i in range(FRAME_ROWS):
            seen[at + WINDOW - FRAME_ROWS + i] = rows[first + i * ROW + SENSED + column]


def refined_hz(rough_hz: float, seen: Floats, found: Floats) -> float:
    """Return the cadence that the correlations have near `rough_hz`; that itself where they have none."""
    _correlate(seen, found)
    best, highest, similar = 0, -9.0, 0.0
    for k in range(CURVE):
        value = 0.0
        for part in range(3):
            value += _between(
                found, CORRELATED + (LAGS if part == 2 else 0), ROWS_HZ / rough_hz * PERIODS[part * CURVE + k]
            )
        value /= 3.0
        if value - COSTS[k] > highest:
            best, highest, similar = k, value - COSTS[k], value
    if 0 < best < CURVE - 1 and similar > ACCEPTED:
        return rough_hz * float(FACTORS[best])
    return rough_hz


def _between(found: Floats, first: int, lag: float) -> float:
    """Return the correlation at a lag between two."""
    whole = int(lag)
    if whole >= LAGS - 1:
        return 0.0
    before = found[first + whole]
    return before + (found[first + whole + 1] - before) * (lag - whole)


def _correlate(seen: Floats, found: Floats) -> None:
    """Write r_m and r_t, normalised and unbiased."""
    for i in range(2 * LAGS):
        found[CORRELATED + i] = 0.0
    for column in range(COLUMNS):
        at, level = column * APART, 0.0
        for i in range(WINDOW):
            level += seen[column * WINDOW + i]
        level = (level / WINDOW + ROUNDING_64) - ROUNDING_64
        for i in range(WINDOW):
            found[at + i] = seen[column * WINDOW + i] - level
        r = CORRELATED if column == 0 else CORRELATED + LAGS
        for i in range(WINDOW):
            value = found[at + i]
            for lag in range(LAGS):
                found[r + lag] += value * found[at + i + lag]
    for r in range(CORRELATED, CORRELATED + 2 * LAGS, LAGS):
        power = max(found[r], 1.0)
        for lag in range(LAGS):
            found[r + lag] = found[r + lag] / power * UNBIASED[lag]
