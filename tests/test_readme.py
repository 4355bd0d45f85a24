"""The README's first command, as a newcomer runs it: a fresh clone, a new environment, steps on the first page."""

import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import psutil
import pytest
from processes import free_port
from test_project import ROOT, START

pytestmark = pytest.mark.full

FIRST_STEP_S = 9.0
"""From the start of `steplink demo` to the first counted step: the default counter is sure of a walk once it has seen
four steps and two seconds more."""
MEMORY_BYTES = 180e6
CTRL_C_S = 2.0
POLL_S = 0.05


@pytest.fixture(scope="module")
def clone(tmp_path_factory) -> Path:
    """A clean clone with the README's first command run in it, up to the demo itself."""
    folder = tmp_path_factory.mktemp("newcomer") / "steplink"
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    *install, demo = START.split(" && ")
    assert demo == ".venv/bin/steplink demo"
    subprocess.run(" && ".join(install), shell=True, cwd=folder, check=True, timeout=600)
    return folder


@contextmanager
def demo_running(clone: Path, log: Path, port: int) -> Iterator[subprocess.Popen]:
    """Run the demo on `port`, its output in `log`; nothing is left running, whatever happens."""
    with (
        log.open("wb") as out,
        subprocess.Popen(
            [".venv/bin/steplink", "demo", "--port", str(port)], cwd=clone, stdout=out, stderr=subprocess.STDOUT
        ) as demo,
    ):
        try:
            yield demo
        finally:
            demo.kill()


def wait_for_a_step(demo: subprocess.Popen, port: int, until: float) -> None:
    """Return as soon as a device has a step; fail at monotonic time `until`, or when the demo ends before."""
    seen: object = "no answer"
    while time.monotonic() < until and demo.poll() is None:
        with suppress(httpx.TransportError):
            seen = httpx.get(f"http://127.0.0.1:{port}/api/v1/devices").json()["items"]
            if any(device["steps"] for device in seen):
                return
        time.sleep(POLL_S)
    pytest.fail(f"no step within {FIRST_STEP_S} s; exit code {demo.poll()}, devices: {seen}")


def memory_bytes(pid: int) -> int:
    process = psutil.Process(pid)
    return sum(one.memory_info().rss for one in (process, *process.children(recursive=True)))


def test_a_newcomer_sees_steps_and_leaves_with_ctrl_c(clone, tmp_path):
    port, log = free_port(), tmp_path / "demo.log"
    begin = time.monotonic()
    with demo_running(clone, log, port) as demo:
        wait_for_a_step(demo, port, until=begin + FIRST_STEP_S)
        print(f"first step after {time.monotonic() - begin:.2f} s, {memory_bytes(demo.pid) / 1e6:.0f} MB")
        assert memory_bytes(demo.pid) <= MEMORY_BYTES
        assert httpx.get(f"http://127.0.0.1:{port}/healthz").json()["bluetooth"] == "ok"
        assert "<title>" in httpx.get(f"http://127.0.0.1:{port}/").text
        demo.send_signal(signal.SIGINT)
        assert demo.wait(CTRL_C_S) == 0
    text = log.read_text("utf-8")
    assert f"http://127.0.0.1:{port}/" in text
    assert "Traceback" not in text


def test_every_file_of_the_packages_is_installed(clone):
    tracked = subprocess.run(
        ["git", "ls-files", "service", "device_sim"], cwd=clone, check=True, capture_output=True, text=True
    ).stdout.split()
    (packages,) = (clone / ".venv" / "lib").glob("python*/site-packages")
    assert [name for name in tracked if not (packages / name).is_file()] == []


def test_the_start_leaves_a_clean_tree(clone):
    changed = subprocess.run(["git", "status", "--porcelain"], cwd=clone, check=True, capture_output=True, text=True)
    assert changed.stdout == ""
