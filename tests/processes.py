"""Air, bracelet and service as processes of their own, each to be killed and started again by a test."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx

AIR_ALONE = str(Path(__file__).with_name("air_alone.py"))
START_S = 30.0
"""Longest time a process may take to say that it runs, on a busy machine."""


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Part:
    """One process, started while entered; `words` are those of `steplink`, or of python for a file."""

    def __init__(self, *words, log):
        is_file = str(words[0]).endswith(".py")
        self._command = [sys.executable, *(() if is_file else ("-m", "service.cli")), *map(str, words)]
        self._log = log
        self._process = None

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self):
        with self._log.open("ab") as log:
            environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
            self._process = subprocess.Popen(self._command, stdout=log, stderr=log, env=environment)

    def kill(self):
        """End it with -9, at once."""
        self._process.kill()
        self._process.wait()

    def end(self):
        """End it as Ctrl-C does; it must end well."""
        self._process.send_signal(signal.SIGINT)
        assert self._process.wait(timeout=10) == 0, self.said()

    def until_said(self, word):
        """Wait until its log holds `word`."""
        until_s = time.monotonic() + START_S
        while word not in self.said():
            self.check_runs()
            assert time.monotonic() < until_s, self.said()
            time.sleep(0.02)

    def check_runs(self):
        assert self._process.poll() is None, self.said()

    def said(self):
        return self._log.read_text()


class Parts:
    """Where air, bracelet and service are, and what they are told; the service stores at `database`."""

    def __init__(self, folder, *, speed, walk, seed, beside=()):
        self.database = folder / "s.db"
        self.folder, self.port, self.air = folder, free_port(), f"127.0.0.1:{free_port()}"
        self._sim = ["--speed", speed, "--walk", walk, "--seed", seed, "--sensors", "accelerometer"]
        self._beside = [word for name in beside for word in ("--beside", name)]

    def air_alone(self):
        return Part(AIR_ALONE, self.air, log=self.folder / "air.log")

    def bracelet(self):
        """The bracelet, and the air with it where none is served."""
        return Part("sim", "--air", self.air, *self._sim, log=self.folder / "bracelet.log")

    def service(self):
        words = ["--air", self.air, "--port", self.port, "--store", self.database, *self._beside]
        return Part("serve", *words, log=self.folder / "service.log")

    def device(self):
        """The bracelet as the service sees it; None while there is none of either."""
        with contextlib.suppress(httpx.TransportError):
            found = httpx.get(f"http://127.0.0.1:{self.port}/api/v1/devices", trust_env=False).json()["items"]
            return found[0] if found else None
        return None

    def until(self, condition, *, within_s=START_S, parts=()):
        """Wait until `condition(device)` holds, while `parts` run; return the device."""
        until_s = time.monotonic() + within_s
        while time.monotonic() < until_s:
            for part in parts:
                part.check_runs()
            device = self.device()
            if device is not None and condition(device):
                return device
            time.sleep(0.05)
        raise AssertionError(f"it did not come about: {self.device()}")

    def goes_on(self, before, parts):
        """Wait until the session goes on by itself and nothing is missing any more; return the device."""
        return self.until(
            lambda device: (
                device["state"] == "streaming"
                and device["reboots"] == before["reboots"]
                and device["samples"] > before["samples"] + 500
                and device["samples_awaited"] == 0
            ),
            parts=parts,
        )
