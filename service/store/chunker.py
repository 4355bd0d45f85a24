"""Gathers a device's samples into chunks of a second, whatever the size of its packets.

A chunk ends at a multiple of its own length and wherever samples do not go on from each other: the same samples give
the same chunks, so that storing them again after a crash finds them there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from service.errors import ParameterError
from service.samples import TICK_EVERY, Columns, RawBlock
from service.store import codec
from service.store.values import CHUNK_SAMPLES, SAMPLE_BYTES, Chunk, Layout, stretches


class Chunker:
    """Chunks of one session's stream. Blocks come with unwrapped indices."""

    def __init__(self) -> None:
        self._open: Chunk | None = None

    def add(self, block: RawBlock, *, run: int, layout: Layout, at_ns: int) -> list[Chunk]:
        """Take a block; return the chunks that it completes."""
        done: list[Chunk] = []
        for piece in _pieces(block, run, layout, at_ns):
            joined = _join(self._open, piece)
            if joined is None:
                done += self.flush()
                joined = piece
            self._open = joined
            if joined.end % chunk_samples(layout.rate_hz) == 0:
                done += self.flush()
        return done

    def flush(self) -> list[Chunk]:
        """Return the chunk begun, if there is one, as it is: before a snapshot, and at stop."""
        chunk, self._open = self._open, None
        return [] if chunk is None else [chunk]


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
    values = np.rint(np.array(columns, dtype=np.float64).T * lsb)
    if not np.all((values >= -32768) & (values <= 32767)):
        raise ParameterError("samples", float(np.max(np.abs(values))), "within 16 bits in units of the layout")
    return values.astype("<i2").tobytes()


def _pieces(block: RawBlock, run: int, layout: Layout, at_ns: int) -> list[Chunk]:
    """Cut a block where chunks end."""
    n, length = len(block), chunk_samples(layout.rate_hz)
    acc = counts(block.acc_g, layout.lsb_per_g)
    gyro = counts(block.gyro_rad_s, _scale(layout.lsb_per_rad_s, "lsb_per_rad_s")) if block.gyro_rad_s else None
    mag = counts(block.mag_ut, _scale(layout.lsb_per_ut, "lsb_per_ut")) if block.mag_ut else None
    pieces, first, end = [], block.index, block.index + n
    while first < end:
        last = min(end, first + length - first % length)
        span = slice(SAMPLE_BYTES * (first - block.index), SAMPLE_BYTES * (last - block.index))
        known = first // TICK_EVERY == block.index // TICK_EVERY
        pieces.append(
            Chunk(
                run=run,
                boot=block.boot,
                index=first,
                at_ns=at_ns,
                layout=layout,
                ticks=(block.tick if known else None, *(None,) * (stretches(first, last) - 1)),
                acc=acc[span],
                gyro=gyro and gyro[span],
                mag=mag and mag[span],
            )
        )
        first = last
    return pieces


def _scale(lsb: float | None, name: str) -> float:
    if lsb is None:
        raise ParameterError(name, lsb, "the scale of a sensor whose samples are to be stored")
    return lsb


def _join(begun: Chunk | None, piece: Chunk) -> Chunk | None:
    """Return both as one; None where `piece` does not go on from `begun`."""
    if begun is None:
        return piece
    same = (begun.run, begun.boot, begun.layout, begun.end) == (piece.run, piece.boot, piece.layout, piece.index)
    if not same or [column is None for column in codec.columns(begun)] != [c is None for c in codec.columns(piece)]:
        return None
    shared = begun.ticks[-1] if begun.end % TICK_EVERY else None
    first = piece.ticks[0] if shared is None else shared
    return Chunk(
        run=begun.run,
        boot=begun.boot,
        index=begun.index,
        at_ns=begun.at_ns,
        layout=begun.layout,
        ticks=(*(begun.ticks[:-1] if begun.end % TICK_EVERY else begun.ticks), first, *piece.ticks[1:]),
        acc=begun.acc + piece.acc,
        gyro=begun.gyro and begun.gyro + (piece.gyro or b""),
        mag=begun.mag and begun.mag + (piece.mag or b""),
    )
