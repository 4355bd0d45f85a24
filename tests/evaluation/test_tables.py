"""Tables by hand: groups, counters side by side, notes and errors; and the bar above them."""

import io

import pytest

from service.evaluation.metrics import Matches
from service.evaluation.progress import ProgressBar
from service.evaluation.rows import Row
from service.evaluation.tables import EACH_RECORDING_UP_TO, LEGEND, aligned, report, table


def row(path="d/a.npz", steps=95, true=100, **changes):
    made = {
        "path": path, "dataset": "d", "counter": "one", "preset": "tuned", "params": {"bout": 3}, "placement": "wrist",
        "activity": "walk", "true_steps": true, "steps": steps, "duration_s": 360.0,
    }  # fmt: skip
    return Row(**(made | changes))


def cells(text):
    return [line.split() for line in text.splitlines() if line and not line.startswith("─")]


def test_a_table_by_hand():
    rows = [
        row(),
        row("d/b.npz", 330, 300, matches=Matches(tp=270, fp=60, fn=30), blind=Matches(tp=165, fp=165, fn=135)),
        row("d/a.npz", 100, counter="two"),
        row("e/c.npz", 3, 0, dataset="e"),
    ]
    assert table(rows, "dataset", lambda of: of.dataset) == (
        "dataset  counter  rec.  hours  true  steps  error  accuracy %  pooled %  MAPE %  bias %  false  false/h"
        "  precision  recall     F1  blind\n" + "─" * 136 + "\n"
        "d        one         2   0.20   400    425    +25       92.50     91.25     7.5    +6.2"
        + " "
        * 16
        + "      0.818   0.900  0.857  0.524\n"
        "         two         1   0.10   100    100     +0      100.00    100.00     0.0    +0.0\n"
        "e        one         1   0.10" + " " * 64 + "3       30"
    )


def test_steps_and_error_leave_out_recordings_that_hold_none():
    header, line = cells(table([row(), row("d/b.npz", 30, 0)], "dataset", lambda of: of.dataset))
    found = dict(zip(" ".join(header).replace(" %", "%").split(), line, strict=True))
    assert (found["true"], found["steps"], found["error"], found["bias%"]) == ("100", "95", "-5", "-5.0")
    assert (found["false"], found["false/h"]) == ("30", "300")


def test_figures_that_no_line_has_are_left_out():
    header = table([row()], "dataset", lambda of: of.dataset).splitlines()[0]
    assert "bias %" in header
    assert "false/h" not in header
    assert "F1" not in header


def test_unknown_truth_leaves_true_and_error_empty_and_the_steps_there():
    header, line = cells(table([row(true=None, steps=77)], "dataset", lambda of: of.dataset))
    assert header == ["dataset", "counter", "rec.", "hours", "true", "steps", "error"]
    assert line == ["d", "one", "1", "0.10", "–", "77", "–"]


def test_unknown_truth_beside_known_ones_has_its_own_column():
    header, line = cells(table([row(), row("d/b.npz", 77, None)], "dataset", lambda of: of.dataset))
    found = dict(zip(" ".join(header).replace(" %", "%").split(), line, strict=True))
    assert (found["true"], found["steps"], found["error"], found["untold"]) == ("100", "95", "-5", "77")


def test_many_of_unknown_truth_are_in_the_json():
    rows = [row(f"d/{k}.npz", true=None) for k in range(EACH_RECORDING_UP_TO + 1)]
    assert f"unknown for {EACH_RECORDING_UP_TO + 1} recordings; --json" in report(rows)
    assert "--json" not in report(rows[:-1])


def test_a_report_groups_by_what_there_is():
    text = report([row(), row("e/b.npz", dataset="e", placement=None, activity="run")])
    firsts = [line[0] for line in cells(text)]
    assert [name for name in firsts if name in {"recording", "dataset", "placement", "activity", "all"}] == [
        "recording", "dataset", "placement", "activity", "all", "all",
    ]  # fmt: skip
    assert LEGEND in text
    assert text.startswith("preset tuned\n")
    plain = report([row(placement=None, activity=None)])
    assert "placement" not in plain
    assert "activity" not in plain
    assert "\nall" not in plain


def test_what_was_changed_of_the_preset_stands_first():
    assert report([row(changed=("bout",))]).startswith("preset tuned one.bout=3\n")


def test_many_recordings_are_not_listed_one_by_one():
    rows = [row(f"d/{k}.npz") for k in range(EACH_RECORDING_UP_TO + 1)]
    assert "d/7.npz" in report(rows[:-1])
    assert "d/7.npz" not in report(rows)


def test_errors_are_told_equal_ones_together():
    rows = [row(), *(row(f"d/{k}.npz", steps=None, error="no gyroscope") for k in range(3))]
    rows.append(row("d/x.npz", steps=None, error="d/x.npz: empty"))
    text = report(rows)
    assert "not counted: 4 of 5 recordings\n  3 × no gyroscope\n  d/x.npz: empty" in text
    many = report([row(f"d/{k}.npz", steps=None, error=f"why {k}") for k in range(13)])
    assert many.splitlines()[-1] == "  … 3 more reasons"
    assert "accuracy" not in many


def test_what_some_counters_only_did_not_count_is_told_apart():
    rows = [row("d/a.npz"), row("d/a.npz", counter="fusion", steps=None, error="no gyroscope")]
    rows += [row("d/b.npz", counter=name, steps=None, error="empty") for name in ("double_threshold", "fusion")]
    assert "not counted: 3 of 4 rows (recording × counter): 1 recording by no counter, 1 by some only\n" in report(rows)
    assert "not counted: 1 of 1 recording\n" in report(rows[1:2])


def test_who_learnt_nothing_is_said_once():
    taught = row("d/a.npz", calibration="middle: 25 samples")
    others = [row(f"d/{name}.npz", counter="fusion") for name in "ab"]
    said = "learnt nothing (no method to learn so, counted as they are): fusion"
    assert report([taught, *others]).count(said) == 1
    assert report([row("d/a.npz", uncalibrated=True), *others]).count(said) == 1
    assert "learnt nothing" not in report(others) + report([taught])


def test_saturated_recordings_are_named():
    text = report([row(f"d/{k}.npz", saturated=k < 5) for k in range(6)])
    assert "saturated" in text
    assert "d/0.npz, d/1.npz, d/2.npz and 2 more" in text
    assert "saturated" not in report([row()])


@pytest.mark.parametrize("left", [0, 1])
def test_columns_are_aligned(left):
    lines = aligned([["name", "x"], ["a", "1000"]], left=left).splitlines()
    assert lines[0].index("x") == len(lines[0]) - 1
    assert len({len(line) for line in lines}) == 1
    assert lines[2].startswith("a") == bool(left)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_the_bar_is_for_terminals_and_leaves_nothing():
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        with ProgressBar(stream) as bar:
            bar(1, 2)
    assert "1/2 recordings" in terminal.getvalue()
    assert terminal.getvalue().count("█") == 15
    assert terminal.getvalue().endswith("\r\033[K")
    assert file.getvalue() == ""
