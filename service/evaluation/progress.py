"""How far a long command is, on one line of a terminal; nothing where stderr is none."""

from __future__ import annotations

import sys
import time
from typing import Final, Self, TextIO

WIDTH: Final = 30


class ProgressBar:
    """A bar that is drawn again at each call, and wiped off at the end of its `with`."""

    def __init__(self, stream: TextIO | None = None, *, of: str = "recordings") -> None:
        self._of = of
        self._stream = stream or sys.stderr
        self._shown = self._stream.isatty()
        self._began_s = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Show that `done` of `total` things are done."""
        if not self._shown:
            return
        left_s = (time.monotonic() - self._began_s) * (total - done) / max(done, 1)
        full = "█" * (WIDTH * done // total)
        self._stream.write(f"\r{full:░<{WIDTH}} {done}/{total} {self._of}, {left_s:.0f} s left\033[K")
        self._stream.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            self._stream.write("\r\033[K")
            self._stream.flush()
