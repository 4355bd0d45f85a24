"""Raw samples of a session as one array in units of measure, made of its chunks without a loop over them.

Each value is the device's integer divided by its scale, as a codec makes it: bit for bit what a Tracker was given.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.errors import CounterError
from service.samples import Sensor
from service.store.values import Layout


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Consecutive samples of one run and layout: rows `row` … `row + samples − 1` of the array."""

    run: int
    boot: int
    index: int
    samples: int
    row: int
    at_ns: int
    """When the first of them arrived, as its chunk says."""
    layout: Layout


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawSignal:
    """n × 3 values in g, rad/s or µT, and the spans they consist of; between two spans samples are missing."""

    sensor: Sensor
    values: NDArray[np.float64]
    spans: Sequence[Span]


def assemble(
    slices: Iterable[Sequence[Sequence[Any]]],
    layouts: Mapping[int, tuple[int, Layout]],
    sensor: Sensor,
    low: tuple[int, int],
    high: tuple[int, int],
) -> RawSignal:
    """Return the samples in [low, high) of chunks (run, first, samples, layout, at_ns, counts) in order of place.

    The rows come in slices, so that no single call keeps other threads waiting for long.
    """
    heads, columns = [np.empty((0, 5), dtype=np.int64)], [np.empty((0, 3), dtype="<i2")]
    for rows in slices:
        heads.append(np.array([row[:5] for row in rows], dtype=np.int64))
        columns.append(np.frombuffer(b"".join([row[5] for row in rows]), dtype="<i2").reshape(-1, 3))
    run, first, samples, layout, at_ns = np.concatenate(heads).T
    counts = np.concatenate(columns)
    begin, end = _once(run, first, first + samples, low, high)
    kept = np.maximum(end - begin, 0)
    if not np.array_equal(kept, samples):
        counts = counts[_kept_rows(samples, begin - first, kept)]
    values = np.empty(counts.shape)
    np.divide(counts, _scale(layout, kept, layouts, sensor), out=values)
    there = kept > 0
    spans = _spans(run[there], begin[there], kept[there], layout[there], at_ns[there], layouts)
    return RawSignal(sensor=sensor, values=values, spans=spans)


Ints = NDArray[np.int64]


def _once(run: Ints, first: Ints, end: Ints, low: tuple[int, int], high: tuple[int, int]) -> tuple[Ints, Ints]:
    """Return where each chunk begins and ends without what was in an earlier one or lies outside of [low, high)."""
    begin, stop = first.copy(), end.copy()
    for one in np.unique(run):
        here = run == one
        floor = low[1] if one == low[0] else 0
        reached = np.maximum.accumulate(np.concatenate(([floor], end[here])))
        begin[here] = np.maximum(first[here], reached[:-1])
        if one == high[0]:
            stop[here] = np.minimum(end[here], high[1])
    return begin, stop


def _kept_rows(samples: Ints, skipped: Ints, kept: Ints) -> Ints:
    """Return the rows of the chunks' samples, joined, that are kept: `kept` of each after the first `skipped`."""
    source = np.cumsum(samples) - samples + skipped
    target = np.cumsum(kept) - kept
    rows: Ints = np.arange(int(kept.sum())) + np.repeat(source - target, kept)
    return rows


def _scale(
    layout: Ints, kept: Ints, layouts: Mapping[int, tuple[int, Layout]], sensor: Sensor
) -> float | NDArray[np.float64]:
    """Return the units in one of ours: one number where it never changed, else one for each sample."""
    scales = {number: _lsb(layouts[number][1], sensor) for number in np.unique(layout).tolist()}
    if len(set(scales.values())) <= 1:
        return next(iter(scales.values()), 1.0)
    return np.repeat(np.array([scales[number] for number in layout.tolist()]), kept)[:, np.newaxis]


def _lsb(layout: Layout, sensor: Sensor) -> float:
    lsb = {
        Sensor.ACCELEROMETER: layout.lsb_per_g,
        Sensor.GYROSCOPE: layout.lsb_per_rad_s,
        Sensor.MAGNETOMETER: layout.lsb_per_ut,
    }[sensor]
    if lsb is None:
        raise CounterError(f"this session has no scale of its {sensor.value}")
    return lsb


def _spans(
    run: Ints, begin: Ints, kept: Ints, layout: Ints, at_ns: Ints, layouts: Mapping[int, tuple[int, Layout]]
) -> list[Span]:
    """Join chunks that follow each other."""
    follows = (run[1:] == run[:-1]) & (layout[1:] == layout[:-1]) & (begin[1:] == begin[:-1] + kept[:-1])
    heads = np.concatenate(([0], np.flatnonzero(~follows) + 1))[: len(run)]
    rows = np.concatenate(([0], np.cumsum(kept)))
    ends = np.append(heads, len(run))[1:]
    spans = []
    for head, end in zip(heads.tolist(), ends.tolist(), strict=True):
        boot, units = layouts[int(layout[head])]
        spans.append(
            Span(
                run=int(run[head]),
                boot=boot,
                index=int(begin[head]),
                samples=int(rows[end] - rows[head]),
                row=int(rows[head]),
                at_ns=int(at_ns[head]),
                layout=units,
            )
        )
    return spans
