"""Cutting blocks of samples, so that the grid they give stays the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from service.samples import TICK_EVERY, Columns, RawBlock, SampleBlock


def cut(block: RawBlock, start: int, end: int) -> RawBlock | None:
    """Return the samples of `block` (its index unwrapped) from `start` to before `end`; None if it holds none."""
    first, last = max(0, start - block.index), min(len(block), end - block.index)
    if first >= last:
        return None
    if first == 0 and last == len(block):
        return block
    index = block.index + first
    # The tick is of the stretch the block began in; what is left of it may begin in the next.
    same_stretch = block.index // TICK_EVERY == index // TICK_EVERY
    return dataclasses.replace(
        block,
        index=index,
        tick=block.tick if same_stretch else None,
        saturated=[at - first for at in block.saturated if first <= at < last],
        acc_g=_cut(block.acc_g, first, last),
        gyro_rad_s=_cut(block.gyro_rad_s, first, last) if block.gyro_rad_s else None,
        mag_ut=_cut(block.mag_ut, first, last) if block.mag_ut else None,
    )


def pieces(block: SampleBlock, most: int) -> Sequence[SampleBlock]:
    """Return `block` in pieces of `most` samples, the last of what is left."""
    if len(block) <= most:
        return (block,)
    return [_piece(block, first, min(first + most, len(block))) for first in range(0, len(block), most)]


def _piece(block: SampleBlock, first: int, last: int) -> SampleBlock:
    return SampleBlock(
        start=block.start + first,
        acc_g=_cut(block.acc_g, first, last),
        gyro_rad_s=_cut(block.gyro_rad_s, first, last) if block.gyro_rad_s else None,
        mag_ut=_cut(block.mag_ut, first, last) if block.mag_ut else None,
    )


def _cut(columns: Columns, first: int, last: int) -> Columns:
    x, y, z = columns
    return x[first:last], y[first:last], z[first:last]
