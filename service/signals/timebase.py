"""Device time: where each of a device's samples lies on the 50 Hz grid, and the grid samples themselves.

A device numbers its samples and tells its tick (1/1024 s since boot) at every 128th of them. Between two of those the
samples are evenly spaced. The spacing of a stretch of 128 is fixed when the stretch begins, from ticks of stretches
before it: so an emitted grid sample never changes, and packets of any size give the same grid.

The nominal rate is believed until a tick disproves it (deviates by more than its own resolution); then the rate is
fitted over the last one to two hundred seconds of ticks and half the deviation is made good within the next stretch.
A hole of up to FILL_S is interpolated; a longer one breaks the grid: it goes on at the first sample's own tick.
Gyroscope and magnetometer lie on the grid of the acceleration; where blocks lack one, the grid goes on without it.
"""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

from service.events import Gap
from service.samples import GRID_HZ, TICK_EVERY, TICK_HZ, Columns, RawBlock, SampleBlock
from service.signals import grid
from service.signals.compiled import compiled
from service.signals.rate import Rate, RateSpan

FILL_S = 0.6
"""Longest hole that is interpolated: less than one step at the slowest pace."""

_INDEX_SPAN = 1 << 32
"""Sample indices are u32 on the wire."""
_TICK_SPAN = 1 << 16
"""A packet carries 16 bits of the tick."""
_TICK = GRID_HZ / TICK_HZ
"""One tick in grid units."""
_ANCHOR_STRETCHES = 64
"""Stretches between two anchors of the rate fit: 164 s at 50 Hz, where a tick's resolution is worth 6 ppm."""
_CORRECTION = 0.5
"""Share of a deviation made good within one stretch."""
_PACE_LIMIT = 1.25
"""A corrected stretch is at most so much faster or slower than the fitted rate, so that time never runs back."""
_BREAK_LIMIT = 1.05
"""Nor is a rate believed that a hole alone says and that is so far from the one before."""
_SENSORS = ("acc_g", "gyro_rad_s", "mag_ut")


class Timebase:
    """Turns a device's blocks, in order and without overlap, into blocks of the grid.

    `rate_hz` is the device's nominal rate. `feed` takes blocks whose index has been unwrapped (it only grows).
    """

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._fit = _RateFit(GRID_HZ / rate_hz)
        self._span = RateSpan()
        self._expected: int | None = None
        self._stretch = 0
        self._start = 0.0
        """Grid place of the stretch's first sample."""
        self._pace = self._fit.pace
        """Grid units a sample within the stretch."""
        self._clock: tuple[int, int] | None = None
        self._lanes: dict[str, list[float]] = {}

    @property
    def measured_rate_hz(self) -> float:
        """The rate the grid goes by: fitted to the device's ticks, the nominal one until ticks disprove it."""
        return GRID_HZ / self._fit.pace

    @property
    def rate(self) -> Rate | None:
        """The rate as the device's ticks tell it by now, and how well; None until it has told two."""
        return self._span.rate

    @property
    def now_s(self) -> float:
        """Device time of the newest sample, in seconds after boot."""
        return self._lanes["acc_g"][grid.PLACE] / GRID_HZ if self._lanes else 0.0

    @property
    def uncertainty_s(self) -> float:
        """How well device time knows where in a signal a sample of the grid lies, in seconds.

        Half the spacing of the grid or of the device's own samples, whichever is wider; where it tells ticks, also half
        a tick and how far the newest one lies off the grid.
        """
        return (0.5 * max(1.0, self._fit.pace) + self._fit.deviation) / GRID_HZ

    def set_clock(self, index: int, tick: int) -> None:
        """Take the device's full tick at a sample: tells the high bits of the ticks in packets."""
        self._clock = (index, tick)

    def feed(self, block: RawBlock) -> tuple[SampleBlock, Gap | None]:
        """Place `block`; return the grid samples it completes (perhaps none) and the hole before it, if any."""
        hole = 0 if self._expected is None else block.index - self._expected
        broken = self._expected is None or hole / self.rate_hz > FILL_S
        last_s = self.now_s
        if broken:
            self._begin(block)
        self._follow_sensors(block)
        tick = self._fit.observe(block, self._start, self._stretch)
        if tick is not None:
            self._span.observe(self._stretch, tick)
        first_s = (self._start + (block.index - self._stretch * TICK_EVERY) * self._pace) / GRID_HZ
        gap = None
        if hole > 0:
            gap = Gap(from_s=last_s, to_s=first_s, index=block.index - hole, samples=hole, filled=not broken)
        self._expected = block.index + len(block)
        return self._place(block), gap

    def snapshot(self) -> dict[str, Any]:
        """Return the whole state as plain data."""
        parts = {"_fit": vars(self._fit), "_span": vars(self._span)}
        return copy.deepcopy({**vars(self), **parts})

    @classmethod
    def restored(cls, state: dict[str, Any]) -> Timebase:
        """Return a timebase that goes on from `state`."""
        made = cls(state["rate_hz"])
        state = copy.deepcopy(state)
        vars(made._fit).update(state.pop("_fit"))
        vars(made._span).update(state.pop("_span", {}))
        vars(made).update(state)
        return made

    def _begin(self, block: RawBlock) -> None:
        """Start the grid afresh at `block`: where its own tick says, or where the rate does if the two agree.

        The grid never goes back: a tick that would have it do so is not believed.
        """
        stretch = block.index // TICK_EVERY
        told = self._start + (stretch - self._stretch) * TICK_EVERY * self._fit.pace
        emitted = self._lanes["acc_g"][grid.NEXT] if self._lanes else 0.0
        start = told
        if block.tick is not None:
            start = self._fit.anchor(stretch, told, _full_tick(block.tick, self._expected_tick(stretch, told)))
        if start + (block.index - stretch * TICK_EVERY) * self._fit.pace < emitted:
            start = told
        self._stretch, self._start, self._pace = stretch, start, self._fit.pace
        lane = [0.0] * grid.SIZE
        lane[grid.PLACE] = start + (block.index - stretch * TICK_EVERY) * self._pace
        lane[grid.NEXT] = float(math.ceil(lane[grid.PLACE] - grid.EPSILON))
        self._lanes = {"acc_g": lane}

    def _follow_sensors(self, block: RawBlock) -> None:
        """Forget a sensor that `block` lacks; a new one begins beside the acceleration, at its first value."""
        if block.gyro_rad_s is None and block.mag_ut is None and len(self._lanes) == 1:
            return  # nothing to do, and most devices' case
        for name in _SENSORS:
            columns = getattr(block, name)
            if columns is None:
                self._lanes.pop(name, None)
            elif name not in self._lanes:
                lane = self._lanes["acc_g"].copy()
                lane[grid.X], lane[grid.Y], lane[grid.Z] = (float(column[0]) for column in columns)
                self._lanes[name] = lane

    def _expected_tick(self, stretch: int, start: float) -> float:
        """Return about which tick the stretch begins at, counted from where it was last known.

        That is where the grid broke off or where the device told its clock, whichever is nearer: it tells it at each
        connection, and by the rate alone the high bits are lost in a day (half of 64 s are 370 ppm of it).
        """
        if self._clock is None:
            return start / _TICK
        index, tick = self._clock
        samples = (stretch * TICK_EVERY - index + _INDEX_SPAN // 2) % _INDEX_SPAN - _INDEX_SPAN // 2
        if self._expected is not None and abs(samples) >= stretch * TICK_EVERY - self._expected:
            return start / _TICK
        return tick + samples * self._fit.pace / _TICK

    def _place(self, block: RawBlock) -> SampleBlock:
        """Run the kernel over `block`, stretch by stretch."""
        names = list(self._lanes)
        begun = int(self._lanes["acc_g"][grid.NEXT])
        made: dict[str, list[Any]] = {name: [] for name in names}
        done, n = 0, len(block)
        while done < n:
            stretch, offset = divmod(block.index + done, TICK_EVERY)
            if stretch != self._stretch:
                self._advance(stretch)
            end = min(n, done + TICK_EVERY - offset)
            for name in names:
                columns = getattr(block, name)
                if (done, end) != (0, n):
                    columns = tuple(column[done:end] for column in columns)
                made[name].append(self._run(name, columns, block.index + done, end - done))
            done = end
        joined = {name: _joined(parts) for name, parts in made.items()}
        return SampleBlock(start=begun, **joined)

    def _advance(self, stretch: int) -> None:
        """Go on to a later stretch: fix where it starts and how fast it runs."""
        self._start += TICK_EVERY * self._pace + (stretch - self._stretch - 1) * TICK_EVERY * self._fit.pace
        self._pace = self._fit.next_pace(self._start, stretch)
        self._stretch = stretch

    def _run(self, name: str, columns: Columns, index: int, n: int) -> tuple[int, Any]:
        lane = self._lanes[name]
        lane[grid.START], lane[grid.FIRST] = self._start, float(self._stretch * TICK_EVERY)
        lane[grid.PACE], lane[grid.INDEX] = self._pace, float(index)
        place = self._start + (index + n - 1 - lane[grid.FIRST]) * self._pace
        room = 3 * max(0, int(place - lane[grid.NEXT]) + 2)
        if isinstance(columns[0], np.ndarray):
            state = np.array(lane)
            out = np.empty(room)
            m = compiled(grid.scan)(*columns, n, state, out)
            lane[:] = state.tolist()
            return m, out
        plain = [0.0] * room
        return grid.scan(*columns, n, lane, plain), plain


class _RateFit:
    """The rate, fitted to ticks once they disprove the nominal one, and the pace of the next stretch."""

    def __init__(self, pace: float) -> None:
        self.pace = pace
        self._seen: tuple[int, float] | None = None
        """Newest stretch whose tick is known, and its grid place by that tick."""
        self._error = 0.0
        """How far that tick lies ahead of the grid, grid units."""
        self._anchors: list[tuple[int, float]] = []

    @property
    def deviation(self) -> float:
        """How far the device's clock and the grid may differ, grid units; 0 where it has told no tick."""
        return abs(self._error) + _TICK / 2 if self._seen else 0.0

    def anchor(self, stretch: int, start: float, tick: int) -> float:
        """Return where a stretch begins after a break: `start` if the tick agrees with it, else the tick's place.

        In the latter case the rate was another too, unless that would be absurd.
        """
        place = _tick_place(tick)
        if abs(place - start) <= _TICK:
            return start
        pace = self._fitted(stretch, place)
        if 1 / _BREAK_LIMIT <= pace / self.pace <= _BREAK_LIMIT:
            self.pace = pace
        return place

    def observe(self, block: RawBlock, start: float, stretch: int) -> int | None:
        """Take the tick of the stretch `block` begins in, once, and return it with its high bits.

        `start` is where the grid has that stretch.
        """
        at = block.index // TICK_EVERY
        if block.tick is None or at != stretch or (self._seen is not None and self._seen[0] >= at):
            return None
        tick = _full_tick(block.tick, start / _TICK)
        place = _tick_place(tick)
        self._seen, self._error = (at, place), place - start
        if not self._anchors or at - self._anchors[-1][0] >= _ANCHOR_STRETCHES:
            self._anchors = [*self._anchors[-1:], (at, place)]
        return tick

    def next_pace(self, start: float, stretch: int) -> float:
        """Return the pace of the stretch that begins at `start`, from ticks of stretches before it."""
        if self._seen is None or abs(self._error) <= _TICK:
            return self.pace
        at, place = self._seen
        self.pace = self._fitted(at, place)
        ahead = place + (stretch - at) * TICK_EVERY * self.pace - start
        wanted = self.pace + _CORRECTION * ahead / TICK_EVERY
        return min(max(wanted, self.pace / _PACE_LIMIT), self.pace * _PACE_LIMIT)

    def _fitted(self, at: int, place: float) -> float:
        """Return the pace from the first anchor to a stretch whose tick says `place`; as it is where there is none."""
        since, origin = self._anchors[0] if self._anchors else (at, place)
        if at <= since or place <= origin:  # a clock that stands still tells no rate
            return self.pace
        return (place - origin) / ((at - since) * TICK_EVERY)


def _tick_place(tick: int) -> float:
    """Return the grid place in the middle of the tick's span."""
    return (tick + 0.5) * _TICK


def _full_tick(low: int, expected: float) -> int:
    """Return the tick nearest to `expected` whose low bits are `low`."""
    around = int(expected)
    return around + (low - around + _TICK_SPAN // 2) % _TICK_SPAN - _TICK_SPAN // 2


def _joined(parts: list[tuple[int, Any]]) -> Columns:
    """Return x, y, z of all parts as columns, each part interleaved and as long as its count says."""
    if any(isinstance(out, np.ndarray) for _, out in parts):
        flat = np.concatenate([out[: 3 * m] for m, out in parts])
        return flat[0::3].copy(), flat[1::3].copy(), flat[2::3].copy()
    if len(parts) == 1:
        m, out = parts[0]
        return out[0 : 3 * m : 3], out[1 : 3 * m : 3], out[2 : 3 * m : 3]
    whole = [value for m, out in parts for value in out[: 3 * m]]
    return whole[0::3], whole[1::3], whole[2::3]
