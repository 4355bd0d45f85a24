"""Compiles live counting in the background once many devices are connected; until then, and meanwhile, it is plain.

Compiling costs seconds of a core and 200 MB, which a handful of devices never earn back: plain, each takes 0.04 % of a
core. It runs in a thread of its own, so that the loop waits for no more than its turn, and no session for its first
packet; sessions go on with what was compiled, to the same bits.
"""

from __future__ import annotations

import gc
import logging
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from service.counters import registry
from service.signals.compiled import available

MANY: Final = 25
"""Devices; a quarter of an hour of so many costs what compiling does."""

logger = logging.getLogger(__name__)


class Compilation:
    """Compiles once, when there is something to compile and it is worth it."""

    def __init__(self) -> None:
        self.thread: threading.Thread | None = None
        """A daemon: the service ends without waiting for it."""

    def consider(self, devices: int, counters: Iterable[str]) -> None:
        """Start where `devices` are MANY, one of `counters` gains by it, and numba is there."""
        if self.thread is not None or devices < MANY or not available():
            return
        works = [work for name in counters if (work := registry.kind(name).compile_live) is not None]
        if works:
            self.thread = threading.Thread(target=_compile, args=[works], name="compilation", daemon=True)
            self.thread.start()


def _compile(works: Sequence[Callable[[], object]]) -> None:
    """Compile with Python's collector at rest: looking through all that a compiler makes would hold the loop."""
    gc.disable()
    try:
        for work in works:
            work()
    except Exception:  # plain counting goes on
        logger.exception("counting could not be compiled and goes on plainly")
    finally:
        gc.freeze()
        gc.enable()
