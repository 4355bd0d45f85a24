"""Gathers a device's samples into chunks of a second, whatever the size of its packets.

A chunk ends at a multiple of its own length and wherever samples do not go on from each other: the same samples give
the same chunks, so that storing them again after a crash finds them there. One that has only begun can be stored as it
is (`begun`); once it is whole it takes the place of that. Live samples and those of a device's history arrive in turns:
each has a chunk of its own under way.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from service.errors import ParameterError
from service.samples import TICK_EVERY, Columns, RawBlock
from service.store import codec
from service.store.values import CHUNK_SAMPLES, SAMPLE_BYTES, Chunk, Layout, stretches

OPEN_CHUNKS: Final = 2
"""Chunks under way at once: of what is live, and of what is sent again."""


@dataclass(slots=True, kw_only=True)
class _Part:
    """A chunk under way."""

    run: int
    boot: int
    index: int
    at_ns: int
    layout: Layout
    ticks: list[int | None]
    columns: list[bytearray | None]

    @property
    def end(self) -> int:
        """Index after the last sample."""
        return self.index + len(self.columns[0] or b"") // SAMPLE_BYTES

    def join(self, part: _Part) -> bool:
        """Take `part` in; tell whether it goes on from here."""
        end = self.end
        same = (self.run, self.boot, end) == (part.run, part.boot, part.index) and self.layout == part.layout
        if not same or [one is None for one in self.columns] != [one is None for one in part.columns]:
            return False
        if end % TICK_EVERY:  # both touch the stretch in between
            known = self.ticks.pop()
            part.ticks[0] = part.ticks[0] if known is None else known
        self.ticks += part.ticks
        for mine, more in zip(self.columns, part.columns, strict=True):
            if mine is not None:
                mine.extend(more or b"")
        return True

    def chunk(self) -> Chunk:
        """Return it as it is."""
        acc, gyro, mag = (None if column is None else bytes(column) for column in self.columns)
        return Chunk(
            run=self.run,
            boot=self.boot,
            index=self.index,
            at_ns=self.at_ns,
            layout=self.layout,
            ticks=tuple(self.ticks),
            acc=acc or b"",
            gyro=gyro,
            mag=mag,
        )


class Chunker:
    """Chunks of one session's stream. Blocks come with unwrapped indices."""

    def __init__(self) -> None:
        self._open: list[_Part] = []
        """The one that grew last stands last."""
        self._told: list[tuple[int, int, int]] = []
        """Run, begin and end of those that `begun` knew last."""

    def add(self, block: RawBlock, *, run: int, layout: Layout, at_ns: int) -> list[Chunk]:
        """Take a block; return the chunks that it completes."""
        done: list[Chunk] = []
        length = chunk_samples(layout.rate_hz)
        for part in _parts(block, run, layout, at_ns):
            joined = self._joined(part)
            if joined.end % length == 0:
                done.append(joined.chunk())
            else:
                self._open.append(joined)
        while len(self._open) > OPEN_CHUNKS:
            done.append(self._open.pop(0).chunk())
        return done

    def begun(self) -> list[Chunk]:
        """Return the chunks under way that grew since the last call, as they are; they go on."""
        before, self._told = self._told, [(part.run, part.index, part.end) for part in self._open]
        return [part.chunk() for part, told in zip(self._open, self._told, strict=True) if told not in before]

    def _joined(self, part: _Part) -> _Part:
        """Return the chunk under way that `part` goes on from, which is taken out, with it; else `part`."""
        for at, begun in enumerate(self._open):
            if begun.join(part):
                return self._open.pop(at)
        return part


def chunk_samples(rate_hz: float) -> int:
    """Return how many samples a whole chunk has: a second's, within what one may have."""
    return min(CHUNK_SAMPLES, max(1, round(rate_hz)))


def by_stretch(chunk: Chunk) -> Iterator[Chunk]:
    """Yield a chunk in pieces as packets are: `ticks[0]` is that of the stretch a piece begins in.

    A stretch whose tick is not known goes with the one before it, as it came.
    """
    first = chunk.index
    for k, tick in enumerate(chunk.ticks[1:], first // TICK_EVERY + 1):
        if tick is not None:
            yield codec.cut(chunk, first, k * TICK_EVERY)
            first = k * TICK_EVERY
    yield codec.cut(chunk, first, chunk.end)


def blocks(chunk: Chunk) -> Iterator[RawBlock]:
    """Yield a chunk as blocks of the very values that were counted when the device sent them."""
    layout = chunk.layout
    for piece in by_stretch(chunk):
        limits = [index for column in codec.columns(piece) if column for index in _at_limit(column)]
        yield RawBlock(
            boot=piece.boot,
            index=piece.index,
            tick=piece.ticks[0],
            saturated=sorted(set(limits)),
            acc_g=_values(piece.acc, layout.lsb_per_g),
            gyro_rad_s=_values(piece.gyro, layout.lsb_per_rad_s) if piece.gyro and layout.lsb_per_rad_s else None,
            mag_ut=_values(piece.mag, layout.lsb_per_ut) if piece.mag and layout.lsb_per_ut else None,
        )


def _values(data: bytes, lsb: float) -> Columns:
    x, y, z = (np.frombuffer(data, "<i2").reshape(-1, 3).T / lsb).tolist()
    return x, y, z


def _at_limit(data: bytes) -> list[int]:
    """Return which samples hold a value at its limit."""
    values = np.frombuffer(data, "<i2").reshape(-1, 3)
    return [int(index) for index in np.flatnonzero(((values == -32768) | (values == 32767)).any(axis=1))]


def counts(columns: Columns, lsb: float) -> bytes:
    """Return samples as the integers that the device sent; ParameterError where one is none of 16 bits."""
    # A packet holds too few samples for numpy: this takes a third of its time.
    try:
        values = [round(value * lsb) for sample in zip(*columns, strict=True) for value in sample]
        return struct.pack(f"<{len(values)}h", *values)
    except (struct.error, ValueError, OverflowError):
        most = max((abs(value * lsb) for column in columns for value in column), default=0.0)
        raise ParameterError("samples", most, "within 16 bits in units of the layout") from None


def _parts(block: RawBlock, run: int, layout: Layout, at_ns: int) -> list[_Part]:
    """Cut a block where chunks end."""
    n, length = len(block), chunk_samples(layout.rate_hz)
    columns = [
        counts(block.acc_g, layout.lsb_per_g),
        counts(block.gyro_rad_s, _scale(layout.lsb_per_rad_s, "lsb_per_rad_s")) if block.gyro_rad_s else None,
        counts(block.mag_ut, _scale(layout.lsb_per_ut, "lsb_per_ut")) if block.mag_ut else None,
    ]
    parts, first, end = [], block.index, block.index + n
    while first < end:
        last = min(end, first + length - first % length)
        span = slice(SAMPLE_BYTES * (first - block.index), SAMPLE_BYTES * (last - block.index))
        known = first // TICK_EVERY == block.index // TICK_EVERY
        parts.append(
            _Part(
                run=run,
                boot=block.boot,
                index=first,
                at_ns=at_ns,
                layout=layout,
                ticks=[block.tick if known else None, *[None] * (stretches(first, last) - 1)],
                columns=[None if column is None else bytearray(column[span]) for column in columns],
            )
        )
        first = last
    return parts


def _scale(lsb: float | None, name: str) -> float:
    if lsb is None:
        raise ParameterError(name, lsb, "the scale of a sensor whose samples are to be stored")
    return lsb
