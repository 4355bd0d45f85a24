"""The same work on many things, over all cores: what each gives, in the order given, whatever happens to a process.

A process counts on one thread and is started anew, not forked. When cancelled, the processes are ended and all is left
at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from typing import Final, TypeVar

Progress = Callable[[int, int], None]
"""Is told how many things are done, and of how many."""

ENDED: Final = "the process that counted it ended: is there memory enough for --jobs?"

Item = TypeVar("Item")
Made = TypeVar("Made")


async def mapped(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    *,
    jobs: int,
    progress: Progress,
    ended: Callable[[Item], Made],
) -> list[Made]:
    """Return `work` of each item, `jobs` at a time; `ended` of an item whose process ended. `work` can be pickled."""
    if not items:
        return []
    # Not forked: threads of numba and asyncio do not outlive that.
    pool = ProcessPoolExecutor(min(jobs, len(items)), mp_context=multiprocessing.get_context("spawn"))
    done = 0

    async def result(item: Item, future: Future[Made]) -> Made:
        nonlocal done
        try:
            made = await _result(future)
        except BrokenExecutor:
            made = ended(item)
        done += 1
        progress(done, len(items))
        return made

    try:
        with _ctrl_c_ignored():
            futures = [pool.submit(work, item) for item in items]
        made = await asyncio.gather(*(result(item, future) for item, future in zip(items, futures, strict=True)))
        pool.shutdown()  # waited for: a pool that is still ending when Python ends may fail there
    except (asyncio.CancelledError, KeyboardInterrupt):
        for process in multiprocessing.active_children():
            process.terminate()
        pool.shutdown(cancel_futures=True)  # waited for: what it says of the ended processes goes to a loop that runs
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return made


async def _result(future: Future[Made]) -> Made:
    """Return what the pool makes; when cancelled, leave the future to the pool.

    Its thread tells every future that its process ended, and fails with a traceback where one is cancelled by then.
    """
    made = asyncio.wrap_future(future)
    made.add_done_callback(lambda each: each.cancelled() or each.exception())  # heard, also where nobody waits any more
    await asyncio.wait([made])
    return made.result()


@contextlib.contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    """Ignore Ctrl-C meanwhile: a process started here never heeds it, and leaves it to this one."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
