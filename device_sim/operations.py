"""bumble operations that are carried through, whatever becomes of their caller.

bumble gives a late answer to whichever command or request comes next, so one that was sent is never cancelled: a
cancelled caller leaves it to finish. Every such task has an owner, who ends what is left when the radio is gone.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, Final, TypeVar

AGAIN_S: Final = 0.01
"""How long a cancelled operation may take before it is cancelled again."""
SETTLE_S: Final = 0.1
"""A controller answers a command in about a millisecond."""

T = TypeVar("T")


class Operations:
    """The unfinished operations of one owner."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._tasks: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def spawn(self, operation: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Begin an operation."""
        task = asyncio.create_task(operation, name=f"{self._name} operation")
        self._tasks.add(task)
        task.add_done_callback(self._finished)
        return task

    async def run(self, operation: Coroutine[Any, Any, T], timeout_s: float) -> asyncio.Task[T]:
        """Begin an operation and return its finished task; TimeoutError after `timeout_s`, when it still goes on."""
        task = self.spawn(operation)
        done, _ = await asyncio.wait({task}, timeout=timeout_s)
        if not done:
            raise TimeoutError(f"{self._name}: no answer in {timeout_s:g} s")
        return task

    def abandon(self) -> None:
        """Cancel what is left, until it has ended: nobody will answer it any more.

        Once is not enough: before Python 3.12 `wait_for` swallows a cancellation that comes with the answer, and what
        has several requests to make goes on with the next.
        """
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            asyncio.get_running_loop().call_later(AGAIN_S, self.abandon)

    async def settle(self) -> None:
        """Wait a moment for answers that are on their way, while there is somebody to give them."""
        if self._tasks:
            await asyncio.wait(set(self._tasks), timeout=SETTLE_S)

    async def close(self) -> None:
        """Abandon what is left and wait for it."""
        self.abandon()
        if self._tasks:
            await asyncio.wait(set(self._tasks))

    def _finished(self, task: asyncio.Task[Any]) -> None:
        self._tasks.discard(task)
        if not task.cancelled():
            task.exception()  # whoever waited has it; where nobody does, asyncio need not complain
