"""steplink's counter with numba: its state as arrays, and the compiled kernel that takes a packet in one call.

Compiling takes seconds. A recording waits for it (`kernel`); a session does not: it goes on plainly until somebody had
it compiled (`compile_live`), and then as it was, to the same bits. Network and rhythm are shared with the plain way, so
to change over is to copy a few lists.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from service.counters import steplink_ahead as ahead
from service.counters import steplink_bouts as bouts
from service.counters import steplink_front as front
from service.counters import steplink_kernel as scalar
from service.counters import steplink_network as network
from service.counters.steplink_frames import Frames
from service.samples import Columns
from service.signals.compiled import Kernel, available, compiled

BLOCK: Final = 4096
"""Samples of a recording that the kernel eats at once: buffers stay in the cache."""

_AHEAD: Final = ahead.ROW * (network.DELAY + 2) * bouts.FRAME
"""Room for what is likely: less than a step a sample since the newest answer."""

_live: Final[list[Kernel]] = []
"""The kernel, once live counting may go on with it."""


class Fed(NamedTuple):
    """What the kernel made of some samples: the filtered signal, rows of steps and of likely ones, and what is told."""

    trace: list[float]
    steps: list[float]
    likely: list[float]
    told: list[float]


def ready() -> Kernel | None:
    """Return the compiled kernel if live counting may go on with it by now."""
    return _live[0] if _live else None


def compile_live() -> None:
    """Compile, for seconds if it is the first time; then counters go on with the kernel, where numba is there."""
    made = kernel()
    if made is not None and not _live:
        _live.append(made)


@contextlib.contextmanager
def compiled_live() -> Iterator[None]:
    """Have live counting compiled while the context is open, and plain after it."""
    compile_live()
    try:
        yield
    finally:
        _live.clear()


@cache
def kernel() -> Kernel | None:
    """Return the compiled kernel, after seconds if it is the first time; None where numba is missing."""
    if not available():
        return None
    made = compiled(scalar.packet)
    frames = Frames(network.Weights(np.zeros(network.PLACES[-1], np.float32)), 0.0)
    Arrays(front.fresh(), [0.0] * bouts.SIZE, frames).feed(made, ([0.0], [0.0], [0.0]), 1)
    return made


class Arrays:
    """The state of one counter, taken over from its lists; `lists` gives it back."""

    def __init__(self, front_state: list[float], bouts_state: list[float], frames: Frames) -> None:
        self._front = np.array(front_state)
        self.bouts = np.array(bouts_state)
        self._shared = (
            frames.network.memory,
            frames.network.moves,
            frames.network.weights.flat,
            frames.rhythm.seen.reshape(-1),
        )
        self._rows, self._held = np.array(frames.rows), len(frames.rows) // front.ROW
        self._given, self._found = np.empty(scalar.GIVEN, np.float32), np.zeros(scalar.FOUND)
        self._room = -1
        self._out = self._answers = np.empty(0)

    def lists(self) -> tuple[list[float], list[float], list[float]]:
        """Return the state of the front end, of the bouts, and the rows of the frame that is not complete."""
        return self._front.tolist(), self.bouts.tolist(), self._rows[: self._held * front.ROW].tolist()

    def feed(self, packet: Kernel, columns: Columns, n: int) -> Fed:
        """Take n samples."""
        values = np.array(columns, np.float64)
        if n <= BLOCK:
            return self._feed(packet, values, n)
        parts = [
            self._feed(packet, np.ascontiguousarray(values[:, first : first + BLOCK]), min(BLOCK, n - first))
            for first in range(0, n, BLOCK)
        ]
        trace = [value for part in parts for value in part.trace]
        return Fed(trace, [value for part in parts for value in part.steps], parts[-1].likely, parts[-1].told)

    def _feed(self, packet: Kernel, values: np.ndarray[tuple[int, int], np.dtype[np.float64]], n: int) -> Fed:
        if n > self._room:
            self._make_room(n)
        x, y, z = values
        self._held, steps, end = packet(
            *(x, y, z, n, self._front, self.bouts, self._rows, self._held),
            *self._shared,
            *(self._given, self._found, self._answers, self._out),
        )
        out: list[float] = self._out[: end + len(bouts.TOLD)].tolist()
        return Fed(out[:n], out[n:steps], out[steps:end], out[end:])

    def _make_room(self, n: int) -> None:
        rows = np.empty((network.FRAME_ROWS + n // front.EVERY + 1) * front.ROW)
        held = self._held * front.ROW
        rows[:held] = self._rows[:held]
        self._rows, self._room = rows, n
        self._answers = np.empty(2 * (n // bouts.FRAME + 1))
        self._out = np.empty(n + bouts.room(n, float(bouts.HELD_MAX)) + _AHEAD + len(bouts.TOLD))
