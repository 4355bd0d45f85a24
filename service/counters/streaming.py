"""A step counter made of scalar kernels: the part that every published algorithm shares.

An algorithm is four functions over one flat state of floats (`Kernel`), a fresh state, and how its rows read as steps;
`KernelCounter` keeps the state, opens and closes stretches at gaps, and runs the same kernels over lists while live or,
compiled, over the arrays of a whole recording. Steps and state are the same, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from service.counters.contract import Snapshot, check_snapshot, params_hash
from service.errors import CounterError
from service.samples import GRID_HZ, Band, Column, Columns, Likely, SampleBlock, Sensor, Step, Update
from service.signals.compiled import compiled

COMPILED_FROM: Final = 2000
"""A block longer than this goes through the compiled kernel, if numba is there."""

COMPILED_BLOCK: Final = 8192
"""Samples the compiled kernel eats at once: buffers stay in the cache."""

SAMPLES_A_ROW: Final = 12
"""Seldom are there more rows: steps and windows come every 20 samples or so."""

FIELDS: Final = {
    Sensor.ACCELEROMETER: attrgetter("acc_g"),
    Sensor.GYROSCOPE: attrgetter("gyro_rad_s"),
    Sensor.MAGNETOMETER: attrgetter("mag_ut"),
}
"""A block's columns of a sensor."""

Events = tuple[tuple[Step, ...], tuple[Band, ...]]

NOTHING: Final[Events] = ((), ())


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """One algorithm as scalar functions over a flat state `s`; columns are x, y, z of each of its `sensors`, in order.

    `begin(s, index, *first)` opens a stretch at grid index `index`, `first` being its first sample.
    `scan(*columns, n, s, out)` eats n samples, writes the filtered signal to `out[:n]` and rows after it, and returns
    where they end; it is compiled for whole recordings. `close(s, out)` ends the stretch (at a gap or the end), writes
    rows to `out[0:]` and returns where they end. `stop(s)` forgets what must not outlast the end of the stream.
    `likely(s)` gives every peak that can still become a step: grid index (the filter's delay not removed), strength,
    whether it passes what is in force.
    `s[next_index]` is the index of the sample to come, −1 before the first stretch; `s[:constants]` never changes. A
    row is `row` floats; `delay` is by how many samples the filtered signal lags, give or take
    `time_error`.
    """

    begin: Callable[..., None]
    scan: Callable[..., int]
    close: Callable[[Any, Any], int]
    stop: Callable[[Any], None]
    likely: Callable[[Any], list[Likely]]
    next_index: int
    constants: int
    row: int
    delay: float
    time_error: float = 0.0
    sensors: tuple[Sensor, ...] = (Sensor.ACCELEROMETER,)


class KernelCounter:
    """A streaming counter over `kernel`; see the contract.

    `state` is a fresh state, `room(n)` how many floats n samples and their rows may take, `events(rows)` reads rows as
    steps and bands, `latency_s` is the longest time from a step to its confirmation.
    """

    def __init__(
        self,
        name: str,
        params: object,
        *,
        kernel: Kernel,
        state: list[float],
        room: Callable[[int], int],
        events: Callable[[Sequence[float]], Events],
        latency_s: float,
        version: int = 1,
    ) -> None:
        self.name = name
        self.params = params
        self.version = version
        self.sensors = kernel.sensors
        self.latency_s = latency_s
        self.time_error_s = kernel.time_error / GRID_HZ
        self._kernel = kernel
        self._scan, self._named, self._next, self._delay = kernel.scan, kernel.likely, kernel.next_index, kernel.delay
        self._sensors = [(sensor, FIELDS[sensor]) for sensor in kernel.sensors]
        self._state = state
        self._room_for = room
        self._events = events
        self._room = 0
        self._out: list[float] = [0.0] * room(0)

    def update(self, block: SampleBlock) -> Update:
        """Count on over `block`; ValueError where it overlaps, CounterError where a sensor is missing."""
        columns = self._columns(block)
        n = len(columns[0])
        if n == 0:
            pending, likely = self._likely()
            return Update(pending=pending, likely=likely)
        rows = [] if block.start == self._state[self._next] else self._open(block.start, columns)
        if n > COMPILED_FROM:
            signal, more = np.empty(n), _Rows(n, self._kernel.row)
            self._scan_arrays(columns, n, more, signal)
            trace, found = signal.tolist(), more.all().tolist()
        else:
            trace, found = self._scan_lists(columns, n)
        steps, bands = self._events(rows + found) if rows or found else NOTHING
        pending, likely = self._likely()
        return Update(steps, pending, likely, (block.start - self._delay) / GRID_HZ, trace, bands)

    def finish(self) -> Update:
        """End the stream: what waits is decided with what is there."""
        steps, bands = self._events(self._close())
        self._kernel.stop(self._state)
        return Update(steps=steps, bands=bands)

    def snapshot(self) -> Snapshot:
        """Return the whole state as plain data."""
        state = self._state[self._kernel.constants :]
        return {"counter": self.name, "version": self.version, "params": params_hash(self.params), "state": state}

    def restore(self, state: Snapshot) -> None:
        """Take over a snapshot's state; SnapshotError where it is another counter's."""
        check_snapshot(state, name=self.name, version=self.version, params=self.params)
        self._state[self._kernel.constants :] = map(float, state["state"])

    def count(self, block: SampleBlock) -> NDArray[np.float64]:
        """Count a whole recording from a fresh state without making a Step of each: `update` and `finish`, faster.

        Returns the kernel's rows (m × `row`), those of `update` before those of `finish`.
        """
        if len(block) == 0:
            return np.empty((0, self._kernel.row))
        columns = self._columns(block)
        self._open(block.start, columns)
        rows = _Rows(len(block), self._kernel.row)
        self._scan_arrays(columns, len(block), rows)
        rows.add(np.array(self._close()))
        self._kernel.stop(self._state)
        return rows.all().reshape(-1, self._kernel.row)

    def read(self, rows: NDArray[np.float64]) -> tuple[Step, ...]:
        """Return the steps that `count`'s rows say."""
        return self._events(rows.ravel().tolist())[0]

    def _likely(self) -> tuple[int, Sequence[Likely]]:
        """Return how many steps are pending, and every one that may come, at its device time."""
        found = self._named(self._state)
        if not found:
            return 0, ()
        pending, delay = 0, self._delay
        likely: list[Likely] = []
        for index, strength, passes in found:
            likely.append(((index - delay) / GRID_HZ, strength, passes))
            pending += passes
        return pending, likely

    def _columns(self, block: SampleBlock) -> tuple[Column, ...]:
        columns: tuple[Column, ...] = ()
        for sensor, columns_of in self._sensors:
            found: Columns | None = columns_of(block)
            if found is None:
                raise CounterError(f"{self.name} needs a {sensor.value}, and the device sends none")
            columns = columns + found if columns else found
        return columns

    def _open(self, start: int, columns: tuple[Column, ...]) -> list[float]:
        """Begin a stretch at grid index `start`; return the rows of the stretch that ended."""
        awaited = self._state[self._kernel.next_index]
        if start < awaited:
            raise ValueError(f"block starts at {start}, {int(awaited)} was next")
        rows = self._close()
        self._kernel.begin(self._state, start, *(float(column[0]) for column in columns))
        return rows

    def _close(self) -> list[float]:
        if self._state[self._kernel.next_index] < 0.0:
            return []
        return self._out[: self._kernel.close(self._state, self._out)]

    def _scan_lists(self, columns: tuple[Column, ...], n: int) -> tuple[list[float], list[float]]:
        if n > self._room:
            self._room, self._out = n, [0.0] * self._room_for(n)
        for column in columns:
            if type(column) is not list:
                columns = tuple(map(_as_list, columns))
                break
        out = self._out
        end = self._scan(*columns, n, self._state, out)
        return out[:n], out[n:end] if end > n else []

    def _scan_arrays(
        self, columns: tuple[Column, ...], n: int, rows: _Rows, signal: NDArray[np.float64] | None = None
    ) -> None:
        """Feed the compiled kernel part by part; add to `rows`, and write the filtered signal where it is asked for."""
        arrays = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
        state = np.array(self._state)
        out = np.empty(self._room_for(COMPILED_BLOCK))
        scan = compiled(self._kernel.scan)
        for first in range(0, n, COMPILED_BLOCK):
            last = min(first + COMPILED_BLOCK, n)
            m = last - first
            end = scan(*[array[first:last] for array in arrays], m, state, out)
            if signal is not None:
                signal[first:last] = out[:m]
            rows.add(out[m:end])
        self._state = state.tolist()


class _Rows:
    """Rows of a recording of `samples`, flat, in one array that seldom grows: fresh memory costs more than a kernel."""

    __slots__ = ("_array", "_end")

    def __init__(self, samples: int, row: int) -> None:
        self._array = np.empty((samples // SAMPLES_A_ROW + 1) * row)
        self._end = 0

    def add(self, values: NDArray[np.float64]) -> None:
        end = self._end + len(values)
        if end > len(self._array):
            self._array = np.concatenate([self._array, np.empty(end)])
        self._array[self._end : end] = values
        self._end = end

    def all(self) -> NDArray[np.float64]:
        return self._array[: self._end]


def _as_list(column: Column) -> list[float]:
    return column if isinstance(column, list) else [float(value) for value in column]
