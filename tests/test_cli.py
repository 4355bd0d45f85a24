"""The commands as a user types them: what they print, how they end, and one clear line for whatever is wrong."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import httpx
import numpy as np
import pytest
from processes import free_port

from service.cli import main

ENDS_WITHIN_S = 2.0


def environment():
    """As this process, but with no Bluetooth daemon to be found."""
    return {**os.environ, "DBUS_SYSTEM_BUS_ADDRESS": "unix:path=/nonexistent", "PYTHONUNBUFFERED": "1"}


def run(*words, timeout=20):
    command = [sys.executable, "-m", "service.cli", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, env=environment(), check=False)


def in_process(*words):
    """The exit code of a command that ends at once, without the second that a process of its own takes."""
    try:
        return main(words)
    except SystemExit as ended:
        return ended.code


@contextmanager
def running(*words):
    """A command in a process of its own, killed at the end if it still runs."""
    command = [sys.executable, "-m", "service.cli", *map(str, words)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment()
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(condition, within_s=15.0):
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        try:
            if found := condition():
                return found
        except httpx.TransportError:
            pass
        time.sleep(0.05)
    raise AssertionError("it did not come about")


def first_device(port):
    items = httpx.get(f"http://127.0.0.1:{port}/api/v1/devices", trust_env=False).json()["items"]
    return items[0] if items else None


def ends_cleanly(process, sent):
    began = time.monotonic()
    process.send_signal(sent)
    out, _ = process.communicate(timeout=10)
    assert time.monotonic() - began < ENDS_WITHIN_S
    assert process.returncode == 0, out
    assert "Traceback" not in out
    return out


@pytest.mark.parametrize("sent", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.full)])
def test_the_demo_counts_and_ends(sent):
    port = free_port()
    with running("demo", "--port", port) as demo:
        device = wait_for(lambda: (found := first_device(port)) and found["steps"] > 0 and found)
        assert device["state"] == "streaming"
        out = ends_cleanly(demo, sent)
    assert f"http://127.0.0.1:{port}/" in out


def devices(port):
    items = httpx.get(f"http://127.0.0.1:{port}/api/v1/devices", trust_env=False).json()["items"]
    return {device["id"]: device for device in items}


@pytest.mark.full
def test_a_demo_on_two_wrists_counts_both_alike():
    port = free_port()
    words = ["--wrists", 2, "--sensors", "all", "--beside", "gyro_zero_crossing", "--walk", "normal:20", "--once"]
    with running("demo", "--port", port, *words, "--speed", 4) as demo:
        wait_for(lambda: len(found := devices(port)) == 2 and all(one["state"] == "lost" for one in found.values()), 30)
        found = devices(port)
        assert {device: one["name"] for device, one in found.items()} == {"sim-1": "Left", "sim-2": "Right"}
        for one in found.values():
            assert one["samples"] == 1000
            assert one["counters"]["steplink"] == pytest.approx(36, abs=6)
            assert one["counters"]["gyro_zero_crossing"] == pytest.approx(36, abs=8)
        ends_cleanly(demo, signal.SIGINT)


@pytest.mark.full
def test_a_counter_without_its_sensor_is_on_the_log_and_in_the_device():
    port = free_port()
    with running("demo", "--port", port, "--counter", "fusion") as demo:
        wait_for(lambda: "fusion" in (((found := first_device(port)) and found["counter_faults"]) or ()))
        assert "needs gyroscope, magnetometer; the device has accelerometer" in ends_cleanly(demo, signal.SIGINT)


def test_a_recording_without_the_sensor_asked_for_is_told(tmp_path):
    path = tmp_path / "still.csv"
    path.write_text("time_s,x_g,y_g,z_g\n" + "".join(f"{i / 50},0,0,1\n" for i in range(50)))
    with running("sim", "--air", f"127.0.0.1:{free_port()}", "--recording", path, "--sensors", "all") as sim:
        assert "holds nothing of a gyroscope or magnetometer" in sim.stdout.readline()


@pytest.mark.full
def test_a_bracelet_in_one_terminal_and_the_service_in_another():
    port, air = free_port(), f"127.0.0.1:{free_port()}"
    with running("serve", "--air", air, "--port", port) as serve:
        health = wait_for(lambda: httpx.get(f"http://127.0.0.1:{port}/healthz", trust_env=False).json())
        assert health["status"] == "ok"
        with running("sim", "--air", air, "--speed", 4, "--id", "wrist-7") as sim:
            before = wait_for(lambda: (found := first_device(port)) and found["steps"] > 5 and found)
            assert before["id"] == "wrist-7"
            sim.kill()
            wait_for(lambda: first_device(port)["state"] == "lost")
        with running("sim", "--air", air, "--speed", 4, "--id", "wrist-7") as sim:
            after = wait_for(lambda: (found := first_device(port))["steps"] > before["steps"] and found)
            assert after["reboots"] == 1
            ends_cleanly(sim, signal.SIGINT)
        ends_cleanly(serve, signal.SIGINT)


@pytest.mark.full
def test_scan_lists_what_is_near():
    air = f"127.0.0.1:{free_port()}"
    with running("sim", "--air", air, "--name", "Wrist") as sim:
        assert "serve --air" in sim.stdout.readline() + sim.stdout.readline()
        found = run("scan", "--air", air, "--seconds", 1)
        assert found.returncode == 0
        assert "Wrist" in found.stdout
        ends_cleanly(sim, signal.SIGINT)


def test_scan_and_sim_end_on_ctrl_c_before_anything_came():
    air = f"127.0.0.1:{free_port()}"
    with running("sim", "--air", air) as sim:
        sim.stdout.readline()
        with running("scan", "--air", air, "--seconds", 60) as scan:
            assert "scanning" in scan.stdout.readline()
            ends_cleanly(scan, signal.SIGINT)


@pytest.mark.full
def test_playing_a_recording_once_ends_by_itself(tmp_path):
    path = tmp_path / "still.csv"
    path.write_text("time_s,x_g,y_g,z_g\n" + "".join(f"{i / 50},0,0,1\n" for i in range(50)))
    port, air = free_port(), f"127.0.0.1:{free_port()}"
    with (
        running("serve", "--air", air, "--port", port),
        running("sim", "--air", air, "--recording", path, "--once") as sim,
    ):
        out, _ = sim.communicate(timeout=20)
    assert sim.returncode == 0
    assert "has been played" in out


@pytest.mark.full
def test_a_demo_that_has_played_its_recording_shows_the_bracelet_gone():
    port = free_port()
    with running("demo", "--port", port, "--walk", "normal:8", "--once", "--speed", 4) as demo:
        wait_for(lambda: (found := first_device(port)) and found["state"] == "lost" and found["steps"] > 5)
        assert first_device(port)["cadence_spm"] is None
        assert "has been played" in ends_cleanly(demo, signal.SIGINT)


@pytest.mark.full
def test_a_table_of_somebodys_own_is_evaluated_and_played_by_its_columns(tmp_path):
    walk = [9.81 * (1 + 0.6 * np.sin(2 * np.pi * 2 * i / 50)) for i in range(1000)]
    path = tmp_path / "own.csv"
    path.write_text("ms;ax;ay;az\n" + "".join(f"{20 * i};0;0;{az:.4f}\n" for i, az in enumerate(walk)))
    words = ["--columns", "time=ms,x=ax,y=ay,z=az", "--units", "m/s2", "--time-unit", "ms"]
    answer = run("evaluate", path, *words, "--json", tmp_path / "rows.json", timeout=60)
    assert answer.returncode == 0, answer.stderr
    (row,) = json.loads((tmp_path / "rows.json").read_text())
    assert row["steps"] == pytest.approx(40, abs=3)
    port = free_port()
    with running("demo", "--port", port, "--recording", path, *words, "--speed", 4):
        wait_for(lambda: (found := first_device(port)) and found["steps"] > 5)
    wrong = run("evaluate", path, "--columns", "x=ax", timeout=30)
    assert wrong.returncode == 2
    assert "Traceback" not in wrong.stderr


def test_without_bluetooth_scan_says_what_to_do():
    answer = run("scan", "--seconds", 1)
    assert answer.returncode == 3
    assert "Bluetooth" in answer.stderr
    assert "steplink demo" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_without_bluetooth_the_service_runs_and_tells():
    port = free_port()
    with running("serve", "--port", port) as serve:
        url = f"http://127.0.0.1:{port}/healthz"
        health = wait_for(lambda: (h := httpx.get(url, trust_env=False).json())["bluetooth"] != "ok" and h)
        assert "adapter" in health["reason"]
        assert "adapter" in ends_cleanly(serve, signal.SIGINT)


def bad_recordings(folder):
    good = {"t": np.arange(100) / 50, "acc": np.ones((100, 3)) / 3**0.5, "rate_hz": 50.0}
    nan = good["acc"].copy()
    nan[50, 1] = np.nan
    np.savez(folder / "nan.npz", **{**good, "acc": nan})
    np.savez(folder / "shape.npz", **{**good, "acc": np.ones((100, 2))})
    np.savez(folder / "missing.npz", t=good["t"])
    (folder / "columns.csv").write_text("time_s,x_g,y_g\n0,0,0\n0.02,0,0\n")
    (folder / "garbage.npz").write_bytes(b"no zip")
    (folder / "song.mp3").write_bytes(b"\0" * 100)


@pytest.mark.parametrize(
    "name", ["nan.npz", "shape.npz", "missing.npz", "columns.csv", "garbage.npz", "song.mp3", "absent.npz"]
)
def test_a_bad_recording_is_one_line(tmp_path, capsys, name):
    bad_recordings(tmp_path)
    assert in_process("demo", "--port", "0", "--recording", str(tmp_path / name)) == 2
    said = capsys.readouterr().err
    assert name in said
    assert said.count("\n") == 1


@pytest.mark.full
def test_a_store_in_use_or_none_is_one_line(tmp_path):
    store, text = tmp_path / "s.db", tmp_path / "text.db"
    text.write_text("no database")
    port = free_port()
    with running("serve", "--port", port, "--store", store):
        wait_for(lambda: httpx.get(f"http://127.0.0.1:{port}/healthz", trust_env=False).json())
        for path, said in (
            (store, "in use by another steplink"),
            (text, "no database of steplink"),
            (tmp_path, "file"),
        ):
            refused = run("serve", "--port", 0, "--store", path)
            assert refused.returncode == 2
            assert said in refused.stderr
            assert len(refused.stderr.strip().splitlines()) == 1
    assert text.read_text() == "no database"


def test_a_port_in_use_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        answer = run("demo", "--port", taken.getsockname()[1])
    assert answer.returncode == 2
    assert "--port" in answer.stderr
    assert answer.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["demo", "--host", "0.0.0.0"], "access control"),
        (["demo", "--port", "70000"], "65535"),
        (["demo", "--counter", "abacus"], "double_threshold"),
        (["demo", "--preset", "magic"], "tuned"),
        (["demo", "--beside", "abacus"], "double_threshold"),
        (["demo", "--param", "double_threshold.bout=99"], "double_threshold.bout = '99': from 2 to 12"),
        (["demo", "--param", "bout=3"], "NAME.KEY=VALUE"),
        (["demo", "--param", "adaptive_peak.walk_g=1.3"], "add --beside adaptive_peak"),
        (["demo", "--walk", "fly:10"], "fly"),
        (["demo", "--name", "far too long"], "8"),
        (["demo", "--id", ""], "1 to 20"),
        (["demo", "--id", "a/b"], "without /"),
        (["demo", "--seed", "-5"], "0 or more"),
        (["demo", "--walk", "normal:99999h"], "24 h"),
        (["demo", "--speed", "0"], "0.01"),
        (["demo", "--packet-samples", "-1"], "packet"),
        (["demo", "--sensors", "thermometer"], "gyroscope"),
        (["demo", "--counter", "autocorrelation", "--param", "autocorrelation.t_min=60"], "t_max"),
        (["demo", "--beside", "plus_minus", "--param", "plus_minus.score_over=39"], "half"),
        (["evaluate", ".", "--counter", "adaptive_peak", "--param", "adaptive_peak.run_g=1"], "walk_g"),
        (["demo", "--wrists", "3"], "1, 2"),
        (["demo", "--wrists", "2", "--id", "mine"], "names and ids of their own"),
        (["demo", "--wrists", "2", "--recording", "walk.csv"], "one wrist"),
        (["sim", "--air", "nowhere"], "nowhere"),
        (["serve", "--air", "example.org:80"], "example.org"),
        (["scan", "--seconds", "0"], "0.1"),
        ([], "COMMAND"),
    ],
)
def test_a_wrong_option_is_told_and_ends_with_2(words, said, capsys):
    assert in_process(*words) == 2
    answer = capsys.readouterr().err
    assert said in answer
    assert "Traceback" not in answer


def test_a_wrong_option_ends_the_process_with_2():
    answer = run("demo", "--host", "0.0.0.0")
    assert answer.returncode == 2
    assert "access control" in answer.stderr
    assert "Traceback" not in answer.stderr
