"""Which packets to believe: corrupt bytes must neither end a count nor invent a gap.

A packet that claims another boot, or samples further ahead than a hole that is interpolated, is held until the next one
bears it out by going on from it; otherwise it is refused. And packets that go on from each other for RESTART_S, all of
them older than what is awaited, come from a device that has started again without a new boot number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from service.samples import RawBlock
from service.signals.timebase import FILL_S

CONFIRM_S = 10.0
"""A held packet is believed if the next one begins at most so long after it."""
RESTART_S = 2.0
"""Old samples in a row that make a restart: longer than any reordering."""

INDEX_SPAN = 1 << 32
"""Sample indices are u32 on the wire."""


def index_ahead(index: int, awaited: int) -> int:
    """Return how many samples `index` lies ahead of `awaited` on the wrapping count; negative for older ones."""
    return (index - awaited + INDEX_SPAN // 2) % INDEX_SPAN - INDEX_SPAN // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Blocks to count now, in order; how many were refused for good; whether the device has started again."""

    blocks: tuple[RawBlock, ...]
    refused: int = 0
    restarted: bool = False


class Doubt:
    """Judges one device's blocks as they come."""

    def __init__(self) -> None:
        self._held: RawBlock | None = None
        self._old_next = -1
        self._old_samples = 0
        """Samples of old blocks that went on from each other, and the index the next one would have."""

    def judge(self, block: RawBlock, *, boots: Collection[int], awaited: int | None, rate_hz: float) -> Verdict:
        """Decide on `block`. `boots` are the believable boot numbers (empty: any), `awaited` the next sample's index.

        `awaited` is None where the block's boot has sent nothing yet.
        """
        held, self._held = self._held, None
        ahead = 0 if awaited is None else index_ahead(block.index, awaited)
        if (boots and block.boot not in boots) or ahead > FILL_S * rate_hz:
            return self._doubted(block, held, rate_hz)
        restarted = self._is_restart(block, ahead, rate_hz)
        return Verdict(blocks=(block,), refused=int(held is not None), restarted=restarted)

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data."""
        held = dataclasses.asdict(self._held) if self._held else None
        return {"held": held, "old_next": self._old_next, "old_samples": self._old_samples}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over a snapshot's state."""
        self._held = RawBlock(**state["held"]) if state["held"] else None
        self._old_next, self._old_samples = state["old_next"], state["old_samples"]

    def _doubted(self, block: RawBlock, held: RawBlock | None, rate_hz: float) -> Verdict:
        if held is not None and held.boot == block.boot:
            after = index_ahead(block.index, held.index + len(held))
            if 0 <= after <= CONFIRM_S * rate_hz:
                return Verdict(blocks=(held, block))
        self._held = block
        return Verdict(blocks=(), refused=int(held is not None))

    def _is_restart(self, block: RawBlock, ahead: int, rate_hz: float) -> bool:
        if ahead + len(block) > 0 or block.history:
            self._old_samples = 0
            return False
        goes_on = block.index == self._old_next
        self._old_samples = len(block) + (self._old_samples if goes_on else 0)
        self._old_next = (block.index + len(block)) % INDEX_SPAN
        if self._old_samples < RESTART_S * rate_hz:
            return False
        self._old_samples = 0
        return True
