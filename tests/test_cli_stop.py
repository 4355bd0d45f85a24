"""A signal ends a computation at once, even one that swallows the exception."""

import signal
import subprocess
import sys
import time

import pytest

from service.cli_stop import GRACE_S, Stopped, stopped_at_once

SWALLOWS = """
import time
from service.cli_stop import stopped_at_once
with stopped_at_once():
    for _ in range(1000):
        try:
            print("ready", flush=True)
            time.sleep(60)
        except BaseException:
            pass
"""

WITHIN_A_CALLBACK = """
import ctypes, time
from service.cli_stop import stopped_at_once
with stopped_at_once():
    @ctypes.CFUNCTYPE(None)
    def callback():
        print("ready", flush=True)
        time.sleep(60)
    callback()
    time.sleep(60)
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_an_exception_with_its_exit_code(number, code, monkeypatch):
    monkeypatch.setattr("service.cli_stop.threading.Timer", FakeTimer)
    before = signal.getsignal(number)
    with pytest.raises(Stopped) as stopped, stopped_at_once():
        signal.raise_signal(number)
    assert stopped.value.code == code
    assert signal.getsignal(number) is before


class FakeTimer:
    def __init__(self, *_):
        self.daemon = False

    def start(self):
        assert self.daemon


@pytest.mark.full
@pytest.mark.parametrize(
    ("code", "more"), [(SWALLOWS, "ready\n"), (WITHIN_A_CALLBACK, "")], ids=["handler", "callback"]
)
def test_who_swallows_the_exception_is_ended_all_the_same(code, more):
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert GRACE_S * 0.9 < time.monotonic() - began < GRACE_S + 1
    assert process.returncode == 130
    assert out == more
    assert err == "steplink: stopped before it was done\n"
