"""What was received behind a hole, compactly, until it can be counted for good.

15 minutes at 100 Hz of nine axes are 6.5 MB. Pieces that go on from each other are joined to chunks of about a stretch,
so that each stretch keeps a chunk that begins inside it and tells its tick: counted in chunks or as they came, the grid
is the same.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import Final

from service.samples import TICK_EVERY, Columns, DeviceInfo, RawBlock
from service.tracking.holes import Holes

CHUNK_SAMPLES: Final = TICK_EVERY
"""A chunk takes no more once it is so long."""


class Chunk:
    """Consecutive samples that hold the same sensors."""

    __slots__ = ("_columns", "_is_first", "_saturated", "boot", "index", "tick")

    def __init__(self, block: RawBlock, *, is_first: bool) -> None:
        self._is_first = is_first
        """Whether it follows a hole: a tick that comes with the first samples of another stretch is not heeded."""
        self.boot, self.index, self.tick = block.boot, block.index, block.tick
        self._columns = [None if c is None else tuple(array("d", one) for one in c) for c in _columns(block)]
        self._saturated = list(block.saturated)

    def __len__(self) -> int:
        acc = self._columns[0]
        return len(acc[0]) if acc else 0

    @property
    def end(self) -> int:
        """Index of the sample after it."""
        return self.index + len(self)

    def join(self, block: RawBlock) -> bool:
        """Take `block` in, if it goes on from here and nothing that its tick tells is lost by that."""
        told = block.tick is None or block.index % TICK_EVERY == 0 or self._tells(block.index // TICK_EVERY)
        columns = _columns(block)
        same = [c is None for c in columns] == [c is None for c in self._columns]
        if block.index != self.end or not told or not same or len(self) >= CHUNK_SAMPLES:
            return False
        self._saturated += [len(self) + at for at in block.saturated]
        for mine, more in zip(self._columns, columns, strict=True):
            for column, values in zip(mine or (), more or (), strict=True):
                column.extend(values)
        return True

    def block(self) -> RawBlock:
        """Return it as a block."""
        acc, gyro, mag = (None if c is None else (c[0].tolist(), c[1].tolist(), c[2].tolist()) for c in self._columns)
        return RawBlock(
            boot=self.boot,
            index=self.index,
            tick=self.tick,
            saturated=self._saturated,
            acc_g=acc or ((), (), ()),
            gyro_rad_s=gyro,
            mag_ut=mag,
        )

    def _tells(self, stretch: int) -> bool:
        """Whether it tells the tick of a stretch to whoever counts it: it has to begin inside of it."""
        heeded = not self._is_first and self.index % TICK_EVERY != 0
        return heeded and self.tick is not None and self.index // TICK_EVERY == stretch


class Kept:
    """One run's samples that wait to be counted for good, what the device said among them, and the holes."""

    def __init__(self, *, run: int, boot: int, first: int) -> None:
        self.run, self.boot, self.first = run, boot, first
        self.next_index = first
        """Index of the newest sample and one more."""
        self.holes = Holes()
        self.samples = 0
        self.saturated = 0
        self._chunks: list[Chunk] = []
        self._said: list[tuple[int, int, DeviceInfo]] = []
        """(index, serial number, what), in order."""
        self._serial = 0

    def add(self, block: RawBlock) -> None:
        """Keep samples that were not there before."""
        self.samples += len(block)
        self.saturated += len(block.saturated)
        self.next_index = max(self.next_index, block.index + len(block))
        at = bisect_left(self._chunks, block.index, key=lambda chunk: chunk.index)
        parted = any(index == block.index for index, _, _ in self._said)
        is_first = at == 0 or self._chunks[at - 1].end != block.index
        if is_first or parted or not self._chunks[at - 1].join(block):
            self._chunks.insert(at, Chunk(block, is_first=is_first))

    def say(self, said: DeviceInfo) -> None:
        """Keep what the device says behind its newest sample."""
        self._serial += 1
        self._said.append((self.next_index, self._serial, said))

    @property
    def is_ready(self) -> bool:
        """Whether the first samples wait for nothing."""
        return bool(self._chunks) and not (self.holes and self.holes.first < self._chunks[0].index)

    def lose_all(self) -> None:
        """Wait for nothing any more."""
        if self.holes:
            self.holes.lose(self.holes.first, self.next_index)

    def ready(self) -> RawBlock | None:
        """Return the first samples that wait for nothing; None where a hole is before them or there are none."""
        return self._chunks[0].block() if self.is_ready else None

    def counted(self, block: RawBlock) -> None:
        """Forget what `ready` returned."""
        self._chunks.pop(0)
        self.samples -= len(block)
        self.saturated -= len(block.saturated)

    def after(self, index: int) -> RawBlock | None:
        """Return the first samples kept from `index` on; None where there are none."""
        at = bisect_right(self._chunks, index, key=lambda chunk: chunk.index)
        if at and self._chunks[at - 1].end > index:
            return self._chunks[at - 1].block()
        return self._chunks[at].block() if at < len(self._chunks) else None

    def said(self, index: int, serial: int) -> Sequence[tuple[int, DeviceInfo]]:
        """Return (serial number, what) the device said after `serial` and up to sample `index`."""
        return [(number, what) for at, number, what in self._said if number > serial and at <= index]

    def heeded(self, serial: int) -> None:
        """Forget what was said up to `serial`."""
        self._said = [one for one in self._said if one[1] > serial]


def _columns(block: RawBlock) -> tuple[Columns | None, ...]:
    return block.acc_g, block.gyro_rad_s, block.mag_ut
