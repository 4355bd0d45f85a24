"""Which packets to believe: corrupt bytes must neither end a count nor invent a gap.

A packet that claims another boot, or samples further ahead than a hole that is interpolated, is held until another one
bears it out: by lying near it, or by being believed and leading up to it. Otherwise it is refused. And packets that go
on from each other for RESTART_S and longer than a reordering, all of them older than what is awaited, come from a
device that has started again without a new boot number. What is sent again from history is judged apart: it can be
neither ahead nor a restart.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from service.samples import RawBlock
from service.signals.timebase import FILL_S

CONFIRM_S: Final = 10.0
"""A held packet is believed if another begins at most so long after it, or ends so long before it."""
REORDERING: Final = 5
"""Packets by which one may come late: a held one is refused when so many others have come, a hole may close so late."""
RESTART_S: Final = 2.0
"""Old samples in a row that make a restart: longer than any reordering."""

INDEX_SPAN: Final = 1 << 32
"""Sample indices are u32 on the wire."""


def index_ahead(index: int, awaited: int) -> int:
    """Return how many samples `index` lies ahead of `awaited` on the wrapping count; negative for older ones."""
    return (index - awaited + INDEX_SPAN // 2) % INDEX_SPAN - INDEX_SPAN // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Blocks to count now, in order; how many were refused for good, or are known; whether the device restarted.

    `overtaken` of the blocks since the held one that is believed now were older than it.
    """

    blocks: tuple[RawBlock, ...]
    refused: int = 0
    repeated: int = 0
    overtaken: int = 0
    restarted: bool = False


class Doubt:
    """Judges one device's blocks as they come."""

    def __init__(self) -> None:
        self._held: RawBlock | None = None
        self._others = 0
        self._overtaken = 0
        """Blocks with something new that have come since and did not bear it out, and those of them older than it."""
        self._old_next = -1
        self._old_samples = 0
        self._old_blocks = 0
        """Old blocks that went on from each other, and the index the next one would have."""

    def judge(self, block: RawBlock, *, boots: Collection[int], awaited: int | None, rate_hz: float) -> Verdict:
        """Decide on `block`. `boots` are the believable boot numbers (empty: any), `awaited` the next sample's index.

        `awaited` is None where the block's boot has sent nothing yet.
        """
        ahead = 0 if awaited is None else index_ahead(block.index, awaited)
        if (boots and block.boot not in boots) or ahead > FILL_S * rate_hz:
            return Verdict(blocks=(), refused=1) if block.history else self._doubted(block, rate_hz)
        if block.history:
            return Verdict(blocks=(block,))
        restarted = self._is_restart(block, ahead, rate_hz)
        if self._held is None:
            return Verdict(blocks=(block,), restarted=restarted)
        return self._with_held(block, self._held, ahead, restarted)

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data."""
        held = dataclasses.asdict(self._held) if self._held else None
        old = {"old_next": self._old_next, "old_samples": self._old_samples, "old_blocks": self._old_blocks}
        return {"held": held, "others": self._others, "overtaken": self._overtaken, **old}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over a snapshot's state."""
        self._held = RawBlock(**state["held"]) if state["held"] else None
        self._others, self._overtaken = state["others"], state["overtaken"]
        self._old_next, self._old_samples = state["old_next"], state["old_samples"]
        self._old_blocks = state["old_blocks"]

    def _doubted(self, block: RawBlock, rate_hz: float) -> Verdict:
        held = self._held
        if held is not None and held.boot == block.boot:
            if held.index == block.index:
                return Verdict(blocks=(), repeated=1)
            if 0 <= index_ahead(block.index, held.index + len(held)) <= CONFIRM_S * rate_hz:
                self._held = None
                return Verdict(blocks=(held, block), overtaken=self._overtaken)
            if 0 <= index_ahead(held.index, block.index + len(block)) <= CONFIRM_S * rate_hz:
                self._held = None
                return Verdict(blocks=(block, held), overtaken=self._overtaken + 1)
        self._held, self._others, self._overtaken = block, 0, 0
        return Verdict(blocks=(), refused=int(held is not None))

    def _with_held(self, block: RawBlock, held: RawBlock, ahead: int, restarted: bool) -> Verdict:
        """Believe `block`, and `held` too if the one leads up to the other exactly, or has gone past it.

        What was gone past can only be known already, or belong into a hole.
        """
        leads = index_ahead(held.index, block.index + len(block))
        is_new = ahead + len(block) > 0
        self._others += is_new
        self._overtaken += ahead >= 0 and leads >= 0
        if held.boot == block.boot and (leads == 0 or (is_new and leads + len(held) <= 0)):
            self._held = None
            # One that was gone past will be called late itself when it fills its hole; not so if it came again.
            fills = leads != 0 and held.index != block.index
            overtaken = max(0, self._overtaken - fills)
            return Verdict(blocks=(block, held), overtaken=overtaken, restarted=restarted)
        refused = self._others >= REORDERING
        if refused:
            self._held = None
        return Verdict(blocks=(block,), refused=int(refused), restarted=restarted)

    def _is_restart(self, block: RawBlock, ahead: int, rate_hz: float) -> bool:
        if ahead + len(block) > 0:
            self._old_samples = self._old_blocks = 0
            return False
        goes_on = block.index == self._old_next
        self._old_samples = len(block) + (self._old_samples if goes_on else 0)
        self._old_blocks = 1 + (self._old_blocks if goes_on else 0)
        self._old_next = (block.index + len(block)) % INDEX_SPAN
        if self._old_samples < RESTART_S * rate_hz or self._old_blocks <= REORDERING:
            return False
        self._old_samples = self._old_blocks = 0
        return True
