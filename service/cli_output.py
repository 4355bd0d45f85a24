"""What a command prints, whoever reads it: a terminal, a file, a pipe whose reader leaves early.

A reader that is gone (`… | head`) or knows fewer letters (a C locale) ends no command: what else it has to write, a
JSON file above all, is still to come.
"""

from __future__ import annotations

import contextlib
import os
import sys


def spell_out() -> None:
    """Print `?` for a letter that standard output does not know."""
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="replace")


def say(text: str) -> bool:
    """Print `text` at once; False, from then on in silence, where nobody reads any more."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _to_nowhere()
        return False
    return True


def _to_nowhere() -> None:
    """Let standard output lead nowhere: what is left in its buffer would fail again when Python ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with contextlib.suppress(OSError):  # where standard output is no file at all, there is no buffer either
        os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
