"""`steplink evaluate` and `steplink bench` as a user types them."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from evaluation.made import save, still, walk

pytestmark = pytest.mark.full

ENDS_WITHIN_S = 2.0


def command(*words):
    return [sys.executable, "-m", "service.cli", *map(str, words)]


def run(*words, cwd=None, **environment):
    return subprocess.run(
        command(*words), capture_output=True, text=True, timeout=90, cwd=cwd, env=os.environ | environment, check=False
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two data sets, a damaged file and a text that is no recording."""
    made = tmp_path_factory.mktemp("data")
    save(walk(20, 100), made / "walks" / "plain.npz", placement="wrist", activity="walk")
    save(walk(20, 25, step_t_s=None, true_steps=42), made / "walks" / "counted.npz", placement="pocket")
    save(still(60), made / "rests" / "desk.npz", placement="wrist", activity="desk")
    np.savez(made / "rests" / "nan.npz", t=np.arange(100) / 50, acc=np.full((100, 3), np.nan))
    (made / "index.csv").write_text("recording,true_steps\nplain,40\n")
    return made


def test_a_folder_is_evaluated(folder, tmp_path, bare):
    out = tmp_path / "rows.json"
    answer = run(
        "evaluate",
        "walks",
        "rests",
        ".",
        "--counter",
        "double_threshold",
        "--json",
        out,
        "--jobs",
        2,
        cwd=folder,
        **bare,
    )
    assert answer.returncode == 0, answer.stderr
    assert "passed over texts without acceleration: ./index.csv (--columns" in answer.stderr
    assert answer.stderr.count("\n") == 1
    rows = {row["path"]: row for row in json.loads(out.read_text("utf-8"))}
    assert list(rows) == ["walks/counted.npz", "walks/plain.npz", "rests/desk.npz", "rests/nan.npz"]
    assert rows["walks/plain.npz"]["steps"] == rows["walks/plain.npz"]["tp"] == 40
    assert rows["walks/counted.npz"]["dataset"] == "walks"
    assert "nan" in rows["rests/nan.npz"]["error"]
    assert "not counted: 1 of 4 recordings\n" in answer.stdout
    assert "accuracy %" in answer.stdout


def test_counters_presets_and_parameters(folder, tmp_path, bare):
    out = tmp_path / "rows.json"
    words = ["--preset", "paper", "--param", "double_threshold.bout=4", "--json", out, "--counter", "all", "walks"]
    answer = run("evaluate", *words, "--jobs", 1, cwd=folder, **bare)
    assert answer.returncode == 0, answer.stderr
    rows = json.loads(out.read_text("utf-8"))
    counters = {row["counter"] for row in rows}
    assert "double_threshold" in counters
    assert len(rows) == 2 * len(counters)
    assert {row["preset"] for row in rows} == {"paper"}
    assert {row["params"]["bout"] for row in rows if row["counter"] == "double_threshold"} == {4}
    assert "preset paper double_threshold.bout=4" in answer.stdout


def test_where_nothing_is_counted_the_exit_code_is_1(folder):
    answer = run("evaluate", folder / "rests" / "nan.npz")
    assert answer.returncode == 1
    assert "nan" in answer.stdout
    assert "Traceback" not in answer.stdout + answer.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["evaluate"], "PATH"),
        (["evaluate", "absent"], "no such file"),
        (["evaluate", "walks", "--counter", "abacus"], "double_threshold"),
        (["evaluate", "walks", "--param", "steplink.pause=99"], "from 0 to 6"),
        (["evaluate", "walks", "--param", "bout=3"], "NAME.KEY=V"),
        (["evaluate", "walks", "--json", "absent/rows.json"], "folder that exists"),
        (["evaluate", "walks", "--units", "mg"], "--columns"),
        (["bench", "--counter", "abacus"], "double_threshold"),
        (["bench", "--json", "."], "a file"),
    ],
)
def test_what_is_wrong_is_one_line(folder, words, said):
    answer = run(*words, cwd=folder)
    assert answer.returncode == 2
    assert said in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert answer.stdout == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [(["evaluate", ".", "--preset", "best"], "tuned"), (["evaluate", ".", "--jobs", "0"], "1–256"),
     (["evaluate", ".", "--lsb-per-g", "much"], "--lsb-per-g"), (["bench", "--samples", "3"], "1000")],
)  # fmt: skip
def test_what_an_option_does_not_take_is_told(words, said):
    answer = run(*words)
    assert answer.returncode == 2
    assert said in answer.stderr
    assert "Traceback" not in answer.stderr


@pytest.mark.skipif(os.name != "posix", reason="a terminal's Ctrl-C goes to a process group")
@pytest.mark.parametrize("after_s", [0.7, 2.5])
def test_ctrl_c_ends_all_processes_at_once(tmp_path, after_s):
    for k in range(40):
        save(walk(600, 100), tmp_path / "many" / f"{k}.npz")
    words = command("evaluate", tmp_path, "--counter", "all", "--jobs", 2)
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        time.sleep(after_s)
        assert process.poll() is None
        began = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        out, _ = process.communicate(timeout=20)
    assert time.monotonic() - began < ENDS_WITHIN_S
    assert process.returncode == 130
    assert out == "steplink: stopped before it was done\n"


@pytest.mark.skipif(os.name != "posix", reason="a terminal's Ctrl-C goes to a process group")
def test_ctrl_c_is_quiet_whenever_it_comes(tmp_path):
    for k in range(40):
        save(walk(60, 100), tmp_path / "many" / f"{k}.npz")
    words = command("evaluate", tmp_path, "--counter", "all", "--jobs", 2)
    for after_s in np.linspace(0.9, 2.1, 8):
        with subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        ) as process:
            time.sleep(after_s)
            os.killpg(process.pid, signal.SIGINT)
            out, _ = process.communicate(timeout=20)
        assert "Traceback" not in out
        assert process.returncode == 130


@pytest.mark.parametrize("after_s", [1.0, 4.0])
def test_ctrl_c_ends_a_bench_at_once(after_s):
    with subprocess.Popen(command("bench"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(after_s)
        assert process.poll() is None
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    assert time.monotonic() - began < ENDS_WITHIN_S
    assert process.returncode == 130
    assert "Traceback" not in err


@pytest.mark.parametrize("after_s", [0.8, 2.0])
def test_ctrl_c_ends_a_papers_tables_at_once(tmp_path, after_s):
    for k in range(60):
        save(walk(600, 100), tmp_path / "many" / f"{k}.npz", placement="wrist", activity="nothing")
    with subprocess.Popen(
        command("evaluate", "--paper", "wang2018", tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        time.sleep(after_s)
        assert process.poll() is None
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=20)
    assert time.monotonic() - began < ENDS_WITHIN_S
    assert process.returncode == 130
    assert "Traceback" not in out


def test_rows_are_written_though_nobody_reads_the_table(folder, tmp_path):
    reads, writes = os.pipe()
    os.close(reads)
    for name, out, environment in (
        ("gone", writes, {}),
        ("letters", subprocess.DEVNULL, {"PYTHONIOENCODING": "ascii"}),
    ):
        words = command("evaluate", "walks", "--jobs", 1, "--json", tmp_path / name)
        with subprocess.Popen(
            words, stdout=out, stderr=subprocess.PIPE, text=True, cwd=folder, env=os.environ | environment
        ) as process:
            _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, ""), name
        assert len(json.loads((tmp_path / name).read_text("utf-8"))) == 2
    os.close(writes)


def test_the_bench_prints_and_writes_its_figures_and_says_what_it_lacks(tmp_path, bare):
    out = tmp_path / "bench.json"
    answer = run("bench", "--samples", 2000, "--counter", "double_threshold", "--json", out, **bare)
    assert answer.returncode == 0, answer.stderr
    assert "pip install 'steplink[fast]'" in answer.stderr
    figures = json.loads(out.read_text("utf-8"))
    assert all(set(figure) == {"name", "value", "unit"} for figure in figures)
    assert [line[:58].strip() for line in answer.stdout.splitlines()] == [figure["name"] for figure in figures]
    names = {figure["name"] for figure in figures}
    assert {"double_threshold offline plain", "double_threshold live", "find_peaks"} <= names
    assert not [name for name in names if "fast" in name]


def test_a_table_without_time_is_read_at_the_rate_declared(tmp_path, bare):
    made = walk(20, 50)
    rows = [
        " ".join(map(repr, [0.0, 0.0, 1.0, *acc, *rate]))
        for acc, rate in zip(made.acc_g.tolist(), made.gyro_rad_s.tolist(), strict=True)
    ]
    (tmp_path / "own.txt").write_text("\n".join(rows))
    words = ["evaluate", "own.txt", "--columns", "x=4,y=5,z=6,gx=7,gy=8,gz=9", "--json", "rows.json"]
    refused = run(*words, cwd=tmp_path, **bare)
    assert refused.returncode == 1
    assert "--rate-hz" in refused.stdout
    answer = run(*words, "--rate-hz", 50, "--counter", "double_threshold", "gyro_zero_crossing", cwd=tmp_path, **bare)
    assert answer.returncode == 0, answer.stderr
    found = json.loads((tmp_path / "rows.json").read_text("utf-8"))
    assert [row["rate_hz"] for row in found] == [50, 50]
    assert all(abs(row["steps"] - 40) <= 1 for row in found)


def test_numba_changes_no_row(folder, tmp_path, bare):
    for name, environment in (("fast", {}), ("plain", bare)):
        run("evaluate", "walks", "--jobs", 1, "--json", tmp_path / name, cwd=folder, **environment)
    fast, plain = (json.loads((tmp_path / name).read_text("utf-8")) for name in ("fast", "plain"))
    assert [row | {"elapsed_s": 0} for row in fast] == [row | {"elapsed_s": 0} for row in plain]
    assert len(fast) == 2
