"""Ctrl-C and SIGTERM for commands that end by themselves: at once, whatever is being computed.

asyncio heeds a signal when the computation comes back to its loop, which a compilation or a plot does not for seconds.
An exception raised in its midst is quick, but may be swallowed there: then the process is ended all the same.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Final, Never

GRACE_S: Final = 1.0
"""For clearing away: processes, temporary files."""

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class Stopped(KeyboardInterrupt):
    """The command was stopped; `code` is what a shell expects then: 128 and the signal's number."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.code = 128 + number


@contextlib.contextmanager
def stopped_at_once() -> Iterator[None]:
    """Raise Stopped at a signal; after GRACE_S, if the process still runs, end it without further ado."""
    before = [signal.signal(number, _stop) for number in _SIGNALS]
    report = sys.unraisablehook

    def unless_stopped(lost: sys.UnraisableHookArgs) -> None:
        """Report what nothing can catch, but not a signal that came within a compiler's callback."""
        if not isinstance(lost.exc_value, Stopped):
            report(lost)

    sys.unraisablehook = unless_stopped
    try:
        yield
    finally:
        sys.unraisablehook = report
        for number, handler in zip(_SIGNALS, before, strict=True):
            signal.signal(number, handler)


def tell() -> None:
    """Say that the result is missing."""
    print("steplink: stopped before it was done", file=sys.stderr, flush=True)


def _stop(number: int, _: object) -> Never:
    stopped = Stopped(number)
    timer = threading.Timer(GRACE_S, _end, [stopped.code])
    timer.daemon = True
    timer.start()
    raise stopped


def _end(code: int) -> None:
    for process in multiprocessing.active_children():
        process.terminate()
    tell()
    os._exit(code)
