"""`steplink evaluate --paper` and `--figures`: wrong words end with one line and code 2 before any work."""

import json

import pytest
from evaluation.made import save, walk

from service import cli
from service.evaluation.figures.draw import RESULTS, SIGNALS
from service.evaluation.papers import PAPERS
from service.evaluation.papers.conditions import Condition, Method, Paper, Table
from service.evaluation.papers.conditions import walk as steps


@pytest.fixture
def short(monkeypatch):
    """A paper of one short walk in place of the four."""
    row = Condition(label="a short walk", parts=(steps("normal", 20),))
    method = Method(label="double threshold", counter="double_threshold")
    paper = Paper(
        name="short", title="A short paper", tables=(Table(title="Table 1", methods=(method,), rows=(row,)),),
        claims=(), real=(),
    )  # fmt: skip
    monkeypatch.setattr("service.evaluation.papers.run.PAPERS", {"short": paper})
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)
    monkeypatch.setattr("service.evaluation.counting.available", lambda: False)
    monkeypatch.delenv("STEPLINK_DATA", raising=False)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--paper", "wang"], "one of wang2018, chen2015, jayalath2013, khedr2017"),
        (["--paper", "wang2018", "--counter", "fusion"], "leave --counter and --param out"),
        (["--paper", "wang2018", "--param", "fusion.bout=3"], "leave --counter and --param out"),
        (["--paper", "wang2018", "no/such/folder"], "no such file or folder"),
        (["--paper", "wang2018", "--json", "no/such/folder/rows.json"], "a file in a folder that exists is wanted"),
    ],
)
def test_wrong_words_are_one_line_and_code_2(words, told, capsys, monkeypatch):
    monkeypatch.delenv("STEPLINK_DATA", raising=False)
    assert cli.main(["evaluate", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert told in said.err


def test_figures_without_matplotlib_are_one_line_and_code_2(tmp_path, capsys, monkeypatch):
    path = save(walk(5.0), tmp_path / "a.npz")
    monkeypatch.setattr("service.evaluation.figures.canvas.importlib.util.find_spec", lambda _: None)
    assert cli.main(["evaluate", str(path), "--figures", str(tmp_path / "drawn")]) == 2
    assert capsys.readouterr().err.endswith("matplotlib is missing: pip install 'steplink[figures]'\n")


@pytest.mark.usefixtures("short")
def test_a_paper_needs_no_recording_and_takes_the_published_parameters(tmp_path, capsys):
    output = tmp_path / "rows.json"
    assert cli.main(["evaluate", "--paper", "short", "--json", str(output)]) == 0
    text = capsys.readouterr().out
    assert "A short paper\npreset paper; double_threshold" in text
    assert "Real recordings: none given" in text
    (row,) = json.loads(output.read_text("utf-8"))
    assert (row["paper"], row["preset"], row["ours"]["true"]) == ("short", "paper", 20.0)


@pytest.mark.usefixtures("short")
@pytest.mark.full
def test_the_preset_can_be_chosen_and_the_figures_drawn(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("service.evaluation.figures.canvas.DPI", 30)
    folder = tmp_path / "drawn"
    assert cli.main(["evaluate", "--paper", "short", "--preset", "tuned", "--figures", str(folder)]) == 0
    said = capsys.readouterr()
    assert "preset tuned" in said.out
    assert {path.stem for path in folder.iterdir()} == {*SIGNALS, *RESULTS}
    assert f"13 figures in {folder}" in said.err


def test_the_help_names_every_paper(capsys):
    with pytest.raises(SystemExit):
        cli.main(["evaluate", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert all(name in text for name in PAPERS)
    assert "--figures DIR" in text
