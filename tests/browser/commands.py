"""Steplink's commands as processes of their own, ended with the test."""

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

START_S = 30.0
"""Longest time a command may take to say that it runs, on a busy machine."""


@contextmanager
def running(*arguments: str, says: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run `steplink ARGUMENTS…` until its output matches the pattern `says`; yield the process and what matched."""
    command = [sys.executable, "-m", "service.cli", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            yield process, _first_match(process, says)
        finally:
            process.kill()


def _first_match(process: subprocess.Popen[str], says: str) -> str:
    assert process.stdout is not None
    limit = threading.Timer(START_S, process.kill)
    limit.start()
    heard = ""
    try:
        for line in process.stdout:
            heard += line
            if match := re.search(says, line):
                return match.group()
    finally:
        limit.cancel()
    raise AssertionError(f"{process.args!r} ended or said nothing fitting within {START_S} s: {heard}")
