"""Each paper as a whole, by its command: all walkers, all recordings that have its conditions, all its figures."""

import json
import subprocess
import sys

import pytest

from service.evaluation.figures.draw import RESULTS, SIGNALS
from service.evaluation.papers import PAPERS

pytestmark = pytest.mark.full
TOO_FAR = {
    "wang2018": {"two axes": 80.0},
    "chen2015": {"adaptive": 85.0},
    "jayalath2013": {"zero crossing": 93.0},
    "khedr2017": {"fusion": 60.0},
}
"""Mean accuracy over synthetic walks that no change of a counter may fall below, in percent."""


@pytest.mark.parametrize("name", sorted(PAPERS))
def test_a_paper_comes_out_whole(name, recordings, tmp_path):
    command = [sys.executable, "-m", "service.cli", "evaluate", "--paper", name, str(recordings)]
    options = ["--json", str(tmp_path / "rows.json"), "--figures", str(tmp_path / "figures")]
    done = subprocess.run(command + options, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert all(table.title in done.stdout for table in PAPERS[name].tables)
    assert "Real recordings of the conditions" in done.stdout
    rows = json.loads((tmp_path / "rows.json").read_text("utf-8"))
    real = [row for row in rows if row["table"] == "real recordings"]
    assert {row["condition"] for row in real} == {wanted.label for wanted in PAPERS[name].real}
    for method, least in TOO_FAR[name].items():
        found = [row["ours"]["accuracy"] for row in rows if row not in real and row["method"] == method]
        accuracies = [accuracy for accuracy in found if accuracy is not None]
        assert sum(accuracies) / len(accuracies) > least
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == {*SIGNALS, *RESULTS}
