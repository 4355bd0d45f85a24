"""Packets' samples as few large blocks where they go on from each other: stored they are the same, at less cost."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence

from service.events import Received
from service.samples import TICK_EVERY, Columns

Arrived = tuple[Received, int]
"""Samples, and the host time (UTC, ns) at which they arrived."""


def joined(arrived: Iterable[Arrived]) -> Iterator[Arrived]:
    """Yield the same samples in the same order, each block as long as a block may be.

    It ends where samples do not go on, and where the next packet has a tick of its own: at a new stretch of TICK_EVERY.
    It counts as arrived when its first packet did.
    """
    group: list[Arrived] = []
    for part in arrived:
        if group and not _goes_on(group, part[0]):
            yield _one(group)
            group = []
        group.append(part)
    if group:
        yield _one(group)


def _goes_on(group: Sequence[Arrived], told: Received) -> bool:
    """Whether `told` can be joined to the group."""
    first, last, block = group[0][0], group[-1][0], told.block
    return (
        told.run == first.run
        and block.boot == first.block.boot
        and block.index == last.block.index + len(last.block)
        and block.index // TICK_EVERY == first.block.index // TICK_EVERY
        and block.tick == first.block.tick
        and block.sensors is first.block.sensors
    )


def _one(group: Sequence[Arrived]) -> Arrived:
    if len(group) == 1:
        return group[0]
    (first, at_ns), blocks = group[0], [told.block for told, _ in group]
    starts = itertools.accumulate(map(len, blocks), initial=0)
    saturated = [start + at for start, block in zip(starts, blocks, strict=False) for at in block.saturated]
    whole = dataclasses.replace(
        first.block,
        saturated=saturated,
        acc_g=_columns([block.acc_g for block in blocks]),
        gyro_rad_s=_columns([block.gyro_rad_s for block in blocks if block.gyro_rad_s])
        if first.block.gyro_rad_s
        else None,
        mag_ut=_columns([block.mag_ut for block in blocks if block.mag_ut]) if first.block.mag_ut else None,
    )
    return dataclasses.replace(first, block=whole), at_ns


def _columns(parts: Sequence[Columns]) -> Columns:
    """Return the columns of one sensor one after the other."""
    x, y, z = (list(itertools.chain.from_iterable(axis)) for axis in zip(*parts, strict=True))
    return x, y, z
