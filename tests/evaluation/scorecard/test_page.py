"""Tables, drawings and the page: what a terminal, a phone and the guide show."""

import json
import xml.etree.ElementTree as ET

import pytest
from evaluation.made import save, still, walk
from markdown_it import MarkdownIt

from service import cli
from service.errors import ParameterError
from service.evaluation.scorecard import page, report, run
from service.evaluation.scorecard.card import Scorecard
from service.evaluation.scorecard.chart import LETTER, WIDTH, Bars, Chart
from service.evaluation.scorecard.charts import charts
from service.evaluation.scorecard.situations import SITUATIONS

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def cards(row):
    """Two counters, a walk and a rest."""

    def one(counter, steps):
        rows = [
            row(counter=counter, steps=steps, within=(95, 105), disturbed={"25 Hz": 90, "8 bits": steps}),
            row("q", counter=counter, true_steps=0, steps=5, activity="desk_work", duration_s=360.0),
        ]
        return Scorecard(counter, "tuned", rows, (), ())

    return [one("double_threshold", 90), one("plus_minus", 99)]


def test_the_families_stand_beside_their_limits(cards):
    walks, desk = report.families(cards).lines
    assert walks == ["wrist walks", "%", "10.00 !", "1.00", "5.5", "3", "10.00", "1.00", "1", "0.02"]
    assert desk[2:6] == ["50 !", "50 !", "8", "2"]


def test_the_text_has_every_table_that_has_lines_and_no_other(cards):
    text = report.text(cards)
    assert "scorecard of double_threshold (preset tuned); plus_minus (preset tuned)" in text
    titles = [table.title for table in (*report.tables(cards), *report.shares(cards))]
    assert "Recordings that dominate the error: plus_minus" in titles
    assert "Families" in titles
    assert "Step times" not in titles
    assert all(f"\n{title}\n" in text for title in titles)


def test_what_was_not_counted_is_told(row):
    card = Scorecard("fusion", "tuned", [row(), row(steps=None, error="it lacks a gyroscope")], (), ())
    assert report.text([card]).endswith("not counted by fusion: 1 recordings (it lacks a gyroscope)")


def test_what_is_lost_is_told_once(cards, monkeypatch):
    monkeypatch.setattr("service.evaluation.scorecard.run.synthetic", lambda *_: 1 / 0)
    (lost,) = run.counted(SITUATIONS[0], (), 32.0)
    made = [Scorecard(card.counter, "tuned", card.rows, (), (), lost=[lost]) for card in cards]
    assert report.text(made).endswith("lost: 1 (walkers: slow, 0.8 steps/s: ZeroDivisionError: division by zero)")


def test_a_table_is_markdown_that_a_page_can_show(cards):
    shown = MarkdownIt("commonmark", {"html": False}).enable("table").render(report.families(cards).markdown())
    assert shown.count("<tr>") == 3
    assert "<th>plus_minus</th>" in shown
    assert "style" not in shown


def test_what_a_line_begins_with_is_told_once():
    table = report.Table(title="T", columns=("a", "b"), lines=[["x", "1"], ["x", "2"], ["y", "2"]])
    assert table.markdown().splitlines()[2:] == ["| a | b |", "| --- | --- |", "| x | 1 |", "|  | 2 |", "| y | 2 |"]
    assert [line.split() for line in table.text().splitlines()[3:]] == [["x", "1"], ["2"], ["y", "2"]]


def test_a_disturbed_family_is_marked_where_it_is_over_its_limit(row):
    quiet = {"true_steps": 0, "steps": 0, "activity": "desk", "duration_s": 3600.0}
    card = Scorecard("fusion", "tuned", [row(**quiet, disturbed={"8 bits": 9, "25 Hz": 8})], (), ())
    (table,) = [table for table in report.tables([card]) if table.title == "Disturbed, without steps"]
    told = dict(zip(table.columns, table.lines[0], strict=True))
    assert (told["as recorded"], told["8 bits"], told["25 Hz"], told["must"]) == ("0.0", "9.0 !", "8.0", "8")


def boxes(svg):
    return list(ET.fromstring(svg).iter(f"{SVG}rect"))[1:]


def test_bars_are_as_long_as_their_values_and_lie_within_a_phones_width():
    groups = [Bars(name="a < b", values=[50.0, None], limit=25.0), Bars(name="long " * 30, values=[100.0, 0.0])]
    svg = Chart(title="T", unit="u", series=["one", "two"], groups=groups).svg()
    _, _, half, whole, none = (float(box.get("width")) for box in boxes(svg))
    assert half == pytest.approx(whole / 2)
    assert none == 1.0
    drawing = ET.fromstring(svg)
    assert drawing.get("viewBox").startswith(f"0 0 {WIDTH} ")
    (mark,) = drawing.iter(f"{SVG}line")
    assert float(mark.get("x1")) == pytest.approx(12 + whole / 4)
    texts = ["".join(text.itertext()) for text in drawing.iter(f"{SVG}text")]
    assert {"T", "u", "one", "two", "a < b", "50.0", "100", "0.0"} < set(texts)
    assert all(float(box.get("x")) + float(box.get("width")) < WIDTH for box in boxes(svg))
    assert max(map(len, texts)) * LETTER < WIDTH


def test_a_drawing_holds_nothing_that_the_guides_policy_refuses(cards):
    for chart in charts(cards).values():
        assert "style" not in chart.svg()
        assert "script" not in chart.svg()
        assert chart.svg() == chart.svg()


def test_the_page_shows_each_of_its_figures_and_they_lie_beside_it(cards, tmp_path):
    page.write(page.checked(None, str(tmp_path / "accuracy.md")), cards)
    text = (tmp_path / "accuracy.md").read_text("utf-8")
    assert text.startswith("# ")
    drawn = {path.name for path in tmp_path.glob("*.svg")}
    assert drawn == {f"accuracy_{name}.svg" for name in charts(cards)}
    assert all(f"]({name})" in text for name in drawn)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--guide", "a.md"], "--scorecard is wanted too"),
        (["--scorecard", "--guide", "a.txt"], "a file .md in a folder that exists"),
        (["--scorecard", "--guide", "no/such/a.md"], "a file .md in a folder that exists"),
        (["--scorecard", "--paper", "wang2018"], "leave it out"),
        (["--scorecard", "--calibrate", "middle"], "leave it out"),
        (["--scorecard", "--split", "aux"], "none of the 1 recordings there is of it"),
    ],
)
def test_wrong_words_are_one_line_and_code_2(words, told, tmp_path, capsys):
    save(walk(2.0), tmp_path / "d" / "a.npz")
    (tmp_path / "index.csv").write_text("split,dataset,recording\ndev,d,a\n")
    assert cli.main(["evaluate", str(tmp_path / "d"), *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert told in said.err


def test_figures_where_no_folder_can_be_are_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match="no folder can be made"):
        page.checked(str(tmp_path / "file" / "figures"), None)


@pytest.mark.full
def test_a_scorecard_of_recordings_as_a_user_asks_for_it(tmp_path, capsys, bare, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", bare["PYTHONPATH"])
    monkeypatch.setattr("service.evaluation.scorecard.run.SITUATIONS", ())
    save(walk(60, 100), tmp_path / "walks" / "w.npz", placement="wrist", activity="walk", subject="s")
    save(still(60), tmp_path / "rests" / "q.npz", placement="wrist", activity="desk_work", subject="s")
    save(still(60), tmp_path / "apart" / "x.npz", placement="wrist", activity="desk_work", subject="s")
    (tmp_path / "index.csv").write_text("split,dataset,recording\naux,apart,x\n")
    out, guide = tmp_path / "rows.json", tmp_path / "guide.md"
    words = ["--scorecard", "--json", str(out), "--guide", str(guide), "--figures", str(tmp_path / "f"), "--jobs", "1"]
    assert cli.main(["evaluate", str(tmp_path), *words, "--counter", "double_threshold"]) == 0
    said = capsys.readouterr()
    assert "1 recordings of another split left out: apart" in said.err
    rows = json.loads(out.read_text("utf-8"))
    by_part = {part: [each for each in rows if each["part"] == part] for part in {each["part"] for each in rows}}
    assert [each["recording"] for each in by_part["recording"]] == ["rests/q", "walks/w"]
    (splice,) = by_part["splice"]
    assert (splice["family"], splice["false_per_hour"]) == ("driving and desk", 0.0)
    (resent,) = [each for each in by_part["disturbance"] if each["disturbance"] == "packets re-sent"]
    assert (resent["recordings"], resent["changed"]) == (2, 0)
    assert "Step-free clips between two walks" in said.out
    assert guide.exists()
    assert (tmp_path / "f" / "walks.svg").exists()
