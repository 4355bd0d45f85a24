"""A row for every recording and counter: true ones, and ones that say why there is no count."""

import asyncio
import dataclasses
import gc
import json
import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from evaluation.made import save, still, walk

from service.errors import ParameterError
from service.evaluation.choices import Found, choices, find
from service.evaluation.json_file import checked_path, write_json
from service.evaluation.rows import Row
from service.evaluation.run import evaluate, failed_rows, rows_of

KEYS = [
    "path", "dataset", "placement", "activity", "rate_hz", "counter", "preset", "params", "true_steps", "steps",
    "error", "duration_s", "samples", "elapsed_s", "saturated",
    "calibration", "tp", "fp", "fn",
]  # fmt: skip
"""The contract with tools."""

CHOSEN = choices(["double_threshold"], "tuned", ["double_threshold.bout=4"])


def one(path, chosen=CHOSEN):
    (row,) = rows_of(Found(shown=str(path), path=path, dataset=path.parent.name), chosen, 32.0)
    return row


def test_a_walk_gives_a_full_row(tmp_path):
    row = one(save(walk(20, 100), tmp_path / "set" / "a.npz", placement="wrist", activity="walk"))
    told = row.as_json()
    assert list(told) == KEYS
    assert told["params"]["bout"] == 4
    assert told["params"]["axes"] == "norm"
    wanted = {
        "path": str(tmp_path / "set" / "a.npz"), "dataset": "set", "placement": "wrist", "activity": "walk",
        "rate_hz": 100.0, "counter": "double_threshold", "preset": "tuned", "true_steps": 40, "steps": 40,
        "error": None, "samples": 1000, "tp": 40, "fp": 0, "fn": 0,
    }  # fmt: skip
    assert {key: told[key] for key in wanted} == wanted
    assert told["duration_s"] == pytest.approx(19.99)
    assert 0 < told["elapsed_s"] < 1
    assert row.blind.tp == 40
    assert row.changed == ("bout",)


def test_times_are_those_after_the_first_sample(tmp_path):
    late = one(save(walk(20, start_s=1000.0), tmp_path / "late.npz"))
    assert (late.matches.tp, late.matches.fp) == (40, 0)


def test_unknown_truth_is_null(tmp_path):
    told = one(save(walk(20, step_t_s=None, true_steps=None), tmp_path / "a.npz")).as_json()
    assert (told["true_steps"], told["steps"], told["tp"], told["fp"], told["fn"]) == (None, 40, None, None, None)


def test_step_times_alone_give_the_number(tmp_path):
    assert one(save(walk(20, true_steps=None), tmp_path / "a.npz")).true_steps == 40


def test_rest_has_no_times_to_match(tmp_path):
    row = one(save(still(10), tmp_path / "a.npz"))
    assert (row.steps, row.true_steps, row.matches, row.blind) == (0, 0, None, None)


def spoilt(**changes):
    def write(path):
        arrays = {"t": np.arange(200) / 50, "acc": np.tile([0.0, 0.0, 1.0], (200, 1)), "rate_hz": 50.0}
        np.savez(path, **(arrays | changes))

    return write


BAD = {
    "nan": (spoilt(acc=np.full((200, 3), np.nan)), "nan"),
    "slow": (spoilt(t=np.arange(200) / 5, rate_hz=5.0), "at least 10"),
    "raw": (spoilt(acc=np.full((200, 3), 4096.0)), "counts per g"),
    "one": (spoilt(t=np.zeros(1), acc=np.ones((1, 3))), "at least 2 are needed"),
    "shape": (spoilt(acc=np.ones((200, 2))), "must be"),
    "age": (spoilt(t=np.append(np.arange(199) / 50, 1e9)), "is a stamp wrong"),
    "garbage": (lambda path: path.write_bytes(b"no zip"), "content is not"),
    "empty": (lambda path: path.write_bytes(b""), "empty"),
    "absent": (lambda _: None, "No such file"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_recording_is_a_row_that_says_so(tmp_path, name):
    write, said = BAD[name]
    path = tmp_path / f"{name}.npz"
    write(path)
    told = one(path).as_json()
    assert list(told) == KEYS
    assert said in told["error"]
    assert "\n" not in told["error"]
    assert (told["steps"], told["samples"], told["tp"]) == (None, None, None)
    assert told["params"]["bout"] == 4


def test_a_fault_of_a_reader_or_a_counter_is_a_row_too(tmp_path, monkeypatch):
    path = save(walk(5), tmp_path / "a.npz")
    monkeypatch.setattr("service.evaluation.run.count", lambda *_: 1 / 0)
    assert one(path).error == "ZeroDivisionError: division by zero"
    assert one(path).samples == 250
    monkeypatch.setattr("service.evaluation.run.read", lambda *_, **__: 1 / 0)
    assert one(path).error == "ZeroDivisionError: division by zero"


def test_a_missing_sensor_is_told_and_the_other_counters_count(tmp_path):
    path = save(still(5), tmp_path / "a.npz")
    chosen = choices(["double_threshold", "gyro_zero_crossing"], "tuned", [])
    first, second = rows_of(Found(shown="a", path=path, dataset="a"), chosen, 32.0)
    assert (first.steps, first.error) == (0, None)
    assert second.steps is None
    assert "needs gyroscope" in second.error


def test_a_saturated_recording_is_marked(tmp_path):
    made = walk(10, swing_g=1.5)
    clipped = dataclasses.replace(made, acc_g=np.clip(made.acc_g, -2, 2))
    assert one(save(made, tmp_path / "a.npz")).as_json()["saturated"] is False
    assert one(save(clipped, tmp_path / "b.npz")).as_json()["saturated"] is True
    assert one(tmp_path / "absent.npz").as_json()["saturated"] is None


async def test_rows_come_in_order_from_several_processes_and_progress_is_told(tmp_path, bare, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", bare["PYTHONPATH"])
    for k, seconds in enumerate([30, 5, 10]):
        save(walk(seconds, step_t_s=None), tmp_path / f"{k}.npz")
    (tmp_path / "3.npz").write_bytes(b"no zip")
    found, _ = find([str(tmp_path)])
    told = []
    chosen = choices(["double_threshold"], "tuned", [])
    rows = await evaluate(
        found, chosen, jobs=2, lsb_per_g=32.0, progress=lambda done, total: told.append((done, total))
    )
    assert [row.path for row in rows] == [f.shown for f in found]
    assert [row.steps for row in rows] == [60, 10, 20, None]
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


async def test_a_process_that_dies_leaves_rows_that_say_so(tmp_path, monkeypatch):
    found, _ = find([str(save(walk(5), tmp_path / "a.npz"))])
    monkeypatch.setattr("service.evaluation.run.rows_of", _die)
    rows = await evaluate(found, CHOSEN, jobs=1, lsb_per_g=32.0, progress=lambda *_: None)
    assert "memory enough" in rows[0].error


def _die(*_, **__):
    os._exit(9)


@pytest.mark.full
async def test_a_pool_that_ends_late_says_nothing_when_cancelled(tmp_path, monkeypatch):
    class Late(ProcessPoolExecutor):
        """Its thread sees the ended processes before it is told to stop: what a Ctrl-C meets now and then."""

        def shutdown(self, wait=True, *, cancel_futures=False):
            time.sleep(0.5)
            super().shutdown(wait, cancel_futures=cancel_futures)

    monkeypatch.setattr("service.evaluation.pool.ProcessPoolExecutor", Late)
    failed = []
    monkeypatch.setattr(threading, "excepthook", lambda told: failed.append(told.exc_value))
    asyncio.get_running_loop().set_exception_handler(lambda _, told: failed.append(told))
    for k in range(12):
        save(walk(10), tmp_path / f"{k}.npz")
    files, _ = find([str(tmp_path)])
    counting = asyncio.create_task(evaluate(files, CHOSEN, jobs=2, lsb_per_g=32.0, progress=lambda *_: None))
    await asyncio.sleep(0.1)
    counting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await counting
    await asyncio.sleep(0.1)
    gc.collect()
    assert failed == []


def test_json_holds_a_row_a_line_and_no_nan(tmp_path):
    path = tmp_path / "rows.json"
    rows = failed_rows(Found(shown="ä.npz", path=path, dataset="d"), CHOSEN, "why")
    write_json(checked_path(str(path)), (row.as_json() for row in rows))
    (read_back,) = json.loads(path.read_text("utf-8"))
    assert read_back == rows[0].as_json()
    assert "ä.npz" in path.read_text("utf-8")
    with pytest.raises(ValueError, match="JSON"):
        write_json(path, [{"value": float("nan")}])
    write_json(path, [])
    assert json.loads(path.read_text("utf-8")) == []


def test_a_json_file_that_cannot_be_is_refused_at_once(tmp_path):
    assert checked_path(None) is None
    for wrong in (tmp_path, tmp_path / "absent" / "rows.json"):
        with pytest.raises(ParameterError, match="folder that exists"):
            checked_path(str(wrong))
    with pytest.raises(ParameterError, match="json"):
        write_json(tmp_path / "absent" / "rows.json", [])


def test_a_row_without_a_count_has_no_score():
    row = Row(path="a", dataset="d", counter="c", preset="tuned", params={}, error="why")
    assert row.score() is None
