"""The papers' tables: their own figures are told right, the conditions are what they say, ours come out the same."""

import asyncio
import dataclasses
import json

import numpy as np
import pytest
from evaluation.made import save, still, walk
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters import registry
from service.errors import ParameterError
from service.evaluation.choices import Found
from service.evaluation.papers import PAPERS
from service.evaluation.papers.conditions import Condition, Method, Paper, Table
from service.evaluation.papers.people import MAGNET_UT, block, person
from service.evaluation.papers.real import fits, measured, methods
from service.evaluation.papers.report import Report
from service.evaluation.papers.results import Result, claimed, figures, pairs, results, timings, walkers
from service.evaluation.papers.run import asked, recordings, report
from service.evaluation.rows import Row
from service.evaluation.run import rows_of
from service.samples import GRID_HZ

NAMES = sorted(PAPERS)
ROWS = [(paper.name, table, row) for paper in PAPERS.values() for table in paper.tables for row in table.rows]


@pytest.fixture(autouse=True, scope="module")
def _in_plain_python():
    """Count without numba, which takes seconds to compile and changes no step."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)
        patch.setattr("service.evaluation.counting.available", lambda: False)
        patch.setattr("service.signals.compiled.available", lambda: False)
        yield


def table_of(name, number):
    return PAPERS[name].tables[number - 1]


def small(paper, *, rows=1, walkers=2):
    """The paper with the first rows of each table only, and few walkers."""
    tables = tuple(
        dataclasses.replace(
            table,
            rows=tuple(dataclasses.replace(row, walkers=min(walkers, row.walkers)) for row in table.rows[:rows]),
        )
        for table in paper.tables
    )
    return dataclasses.replace(paper, tables=tables)


def counted(paper, preset="paper"):
    return [result for result in results(paper, preset) if result is not None]


# What the papers print


@pytest.mark.parametrize(
    ("name", "number", "method", "mean"),
    [
        ("wang2018", 1, "three axes", 89.25),
        ("wang2018", 2, "two axes", 91.33),
        ("wang2018", 3, "two axes", 82.75),
        ("wang2018", 3, "other wrist", 77.72),
    ],
)
def test_published_accuracies_have_the_papers_means(name, number, method, mean):
    accuracies = [row.published[method].accuracy for row in table_of(name, number).rows]
    assert np.mean(accuracies) == pytest.approx(mean, abs=0.005)


def test_the_pockets_reading_fits_the_text():
    """Two axes cost accuracy with the band in the pocket, and gain it in all other walks."""
    three, two = table_of("wang2018", 1).rows, table_of("wang2018", 2).rows
    gains = {}
    for before, after in zip(three, two, strict=True):
        gain = after.published["two axes"].accuracy - before.published["three axes"].accuracy
        gains.setdefault("run" if "run" in before.label else before.pose, []).append(gain)
    assert np.mean(gains["pocket"]) < 0 < np.mean(gains["wrist"])


def test_the_gyroscopes_columns_agree_with_each_other():
    for number in (2, 3):
        for row in table_of("jayalath2013", number).rows:
            printed = row.published["zero crossing"]
            assert printed.counted / printed.true == pytest.approx(printed.accuracy / 100, abs=0.005)
            assert printed.low <= printed.accuracy <= printed.high


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("wang2018", (12, 12, 12, 4, 4)),
        ("chen2015", (11, 11, 3)),
        ("jayalath2013", (6, 6, 5, 10, 3)),
        ("khedr2017", (24, 5, 4, 3)),
    ],
)
def test_tables_have_the_papers_rows(name, rows):
    assert tuple(len(table.rows) for table in PAPERS[name].tables) == rows


def test_every_claim_of_the_texts_is_there():
    percents = {name: {claim.percent for claim in PAPERS[name].claims} for name in NAMES}
    assert percents["wang2018"] == {91.88}
    assert percents["chen2015"] == {99, 97, 70, 50}
    assert percents["jayalath2013"] == {96, 94.59, 95, 90, 96.36, 95.45}
    assert percents["khedr2017"] == {99.6, 99.1, 99.47}


@pytest.mark.parametrize("name", NAMES)
def test_every_claim_is_about_rows_of_its_tables(name):
    for claim in PAPERS[name].claims:
        found = [
            row
            for number in claim.tables
            for row in table_of(name, number).rows
            if claim.rows in row.label and claim.method in {m.label for m in table_of(name, number).methods}
        ]
        assert found, claim


def test_published_rows_on_stairs_claim_the_least_mean_of_their_direction():
    for direction, percent in (("up stairs", 96.36), ("down stairs", 95.45)):
        (claim,) = (c for c in PAPERS["jayalath2013"].claims if c.rows == direction)
        printed = [row.published for row in table_of("jayalath2013", 4).rows if direction in row.label]
        assert {of["zero crossing"].accuracy for of in printed if of} == {percent} == {claim.percent}
        assert (claim.of, claim.tables) == ("least mean", (4,))


def test_the_worst_case_stands_in_the_column_it_is_compared_with():
    row = next(row for row in table_of("khedr2017", 1).rows if row.label.startswith("typing, slow"))
    (claim,) = (claim for claim in PAPERS["khedr2017"].claims if claim.rows == "typing, slow")
    assert row.published["fusion"].accuracy == claim.percent == 99.1
    assert (claim.of, row.published["fusion"].low) == ("mean", None)


@pytest.mark.parametrize("name", NAMES)
def test_labels_tell_rows_apart(name):
    for table in PAPERS[name].tables:
        labels = [row.label for row in table.rows]
        assert len(set(labels)) == len(labels)
        assert {label for row in table.rows for label in row.published} <= {m.label for m in table.methods}


# Who walks


@pytest.mark.parametrize("name", NAMES)
def test_the_first_rows_walkers_have_every_sensor(name):
    for table in PAPERS[name].tables:
        walked = block(table.rows[0], 0, noise_g=table.noise_g)
        assert walked.gyro_rad_s is not None
        assert walked.mag_ut is not None
        assert all(len(column) == len(walked) for column in (*walked.acc_g, *walked.gyro_rad_s, *walked.mag_ut))


@settings(max_examples=20)
@given(st.sampled_from([row for _, _, row in ROWS if row.steps]), st.integers(0, 9))
def test_people_take_the_rows_steps_at_their_own_pace(row, k):
    """The length of a walk is its steps at the person's pace, or the paper's, plus standing."""
    from device_sim.gait_poses import POSES

    who, gaits = person(k), POSES[row.pose].gaits
    walking_s = sum(
        60 * part.steps / (part.cadence_spm or gaits[part.activity].cadence_spm * who.pace)
        if part.steps
        else part.duration_s
        for part in row.parts
    )
    assert len(block(row, k)) / GRID_HZ == pytest.approx(walking_s + 6, abs=0.05)


def test_walkers_are_the_same_each_time_and_not_each_other():
    row = table_of("jayalath2013", 2).rows[2]
    once, again, other = block(row, 1), block(row, 1), block(row, 2)
    assert np.array_equal(once.acc_g, again.acc_g)
    assert np.array_equal(once.gyro_rad_s, again.gyro_rad_s)
    assert not np.array_equal(once.acc_g[0][:200], other.acc_g[0][:200])


@given(st.integers(0, 1000))
def test_people_differ_within_bounds(k):
    assert all(0.7 < factor < 1.3 for factor in dataclasses.astuple(person(k)))


def test_the_other_wrist_swings_against_this_one():
    row = Condition(label="x", parts=table_of("wang2018", 2).rows[0].parts)
    one, other = (np.asarray(block(row, 0, mirrored=side).gyro_rad_s[1])[500:2000] for side in (False, True))
    assert np.corrcoef(one, other)[0, 1] < -0.9


def test_a_magnet_moves_the_field_and_nothing_else():
    calm = table_of("khedr2017", 4).rows[2]
    disturbed, quiet = block(calm, 0), block(dataclasses.replace(calm, disturbed=False), 0)
    assert np.array_equal(disturbed.acc_g, quiet.acc_g)
    moved = np.abs(np.asarray(disturbed.mag_ut) - np.asarray(quiet.mag_ut)).max(axis=1)
    assert moved == pytest.approx(np.abs(MAGNET_UT), rel=0.01)


# What is counted


@given(st.lists(st.tuples(st.integers(1, 500), st.integers(0, 1000)), min_size=1))
def test_figures_are_numpys_over_the_walkers(steps):
    accuracy = np.array([100 - 100 * abs(c - t) / t for t, c in steps])
    found = figures(steps)
    assert found.accuracy == pytest.approx(accuracy.mean())
    assert found.accuracy_var == pytest.approx(accuracy.var())
    assert (found.low, found.high) == (pytest.approx(accuracy.min()), pytest.approx(accuracy.max()))


def test_without_steps_there_is_no_accuracy():
    found = figures([(0, 3), (0, 5)])
    assert (found.counted, found.accuracy, found.low) == (4.0, None, None)


def test_every_method_counts_every_row_once_and_the_same_again():
    paper = small(PAPERS["wang2018"])
    first, second = counted(paper), counted(paper)
    wanted = [(n, row.label, m.label) for n, t in enumerate(paper.tables, 1) for row in t.rows for m in t.methods]
    assert [(r.table, r.condition.label, r.method.label) for r in first] == wanted
    assert [pairs(r.rows) for r in first] == [pairs(r.rows) for r in second]
    assert sum(1 for r in results(paper) if r is None) == walkers(paper)


def test_single_walks_are_by_as_many_people():
    paper = small(PAPERS["wang2018"], rows=3)
    assert [r.rows[0].path.rsplit("/", 1)[1] for r in counted(paper) if r.table == 1] == ["0", "1", "2"]


def test_an_absent_counter_is_said_to_be(monkeypatch):
    monkeypatch.setattr(registry, "COUNTERS", {})
    paper = small(PAPERS["chen2015"])
    found = counted(paper)
    assert all(result.rows is None for result in found)
    text = Report(paper=paper, preset="paper", results=found, timings=timings(paper)).text()
    assert "adaptive_peak (not available)" in text
    assert "not available" in text.split("Claims")[1]


def result(accuracies, *, table=1, label="row"):
    steps = [(100, round(a)) for a in accuracies]
    rows = tuple(
        Row(path="p", dataset="d", counter="c", preset="paper", params={}, true_steps=t, steps=c) for t, c in steps
    )
    return Result(
        table=table, condition=Condition(label=label, parts=()), method=Method(label="m", counter="c"), rows=rows
    )


@pytest.mark.parametrize(("of", "expected"), [("mean", 85.0), ("least mean", 75.0), ("least", 60.0)])
def test_claims_are_of_the_mean_the_least_mean_or_the_least(of, expected):
    claim = dataclasses.replace(PAPERS["wang2018"].claims[0], method="m", of=of, tables=(1,), rows="row")
    found = [result([90, 100]), result([60, 90]), result([0], table=2), result([0], label="other")]
    assert claimed(claim, found) == pytest.approx(expected)


def test_the_calibration_learns_on_each_walkers_slowest_walk():
    paper = small(PAPERS["jayalath2013"])
    paper = dataclasses.replace(paper, tables=paper.tables[1:2])
    rows = [row for found in counted(paper) for row in found.rows]
    learnt = [row.params["peak_rad_s"] for row in rows]
    assert len(set(learnt)) == len(rows)
    assert registry.parameters("gyro_zero_crossing", "paper").peak_rad_s not in learnt


# What is printed


@pytest.fixture(scope="module")
def gyroscope():
    paper = small(PAPERS["jayalath2013"], rows=2)
    return Report(paper=paper, preset="paper", results=counted(paper))


def test_the_text_has_the_papers_columns_and_both_figures(gyroscope):
    text = gyroscope.text()
    assert all(table.title in text for table in gyroscope.paper.tables)
    head = next(line for line in text.splitlines() if line.startswith("condition") and "min" in line)
    assert head.split() == [
        "condition", "method", "true", "var", "counted", "var", "accuracy", "var", "min", "max",
    ]  # fmt: skip
    published = next(line for line in text.splitlines() if line.startswith("Walking slowly on flat lands"))
    assert published.split()[-8:] == ["28.50", "2.45", "27.60", "2.64", "96.82", "1.16", "96.00", "100.00"]
    assert "Real recordings: none given" in text


def test_single_walks_stand_in_one_line_with_both_counts(gyroscope):
    line = next(text for text in gyroscope.text().splitlines() if text.startswith("Walking slowly on flat land "))
    cells = line.replace("zero crossing", "").split()
    assert cells[-7:-3] == ["27", "26", "-1", "96.30"]
    assert int(cells[-3]) == gyroscope.results[0].rows[0].steps


def test_plain_data_says_what_the_text_says(gyroscope):
    made = json.loads(json.dumps(gyroscope.as_json()))
    assert len(made) == len(gyroscope.results)
    slow = next(row for row in made if row["table"].startswith("Table II.") and "slowly" in row["condition"])
    assert slow["published"]["accuracy_var"] == 1.16
    assert slow["ours"]["true"] == 28.0
    assert slow["walkers"] == 2


def test_times_are_taken_of_the_papers_counters():
    taken = timings(PAPERS["chen2015"])
    assert [(t.counter, t.published_s) for t in taken] == list(PAPERS["chen2015"].elapsed_s.items())
    assert all(0 < t.plain_s < 10 for t in taken)
    assert "Calculation time" in Report(paper=PAPERS["chen2015"], preset="paper", results=[], timings=taken).text()


# On real recordings


@pytest.mark.parametrize(
    ("name", "placement", "activity", "labels"),
    [
        ("wang2018", "wrist", "walk", ["walk, band on the wrist"]),
        ("wang2018", "wrist", "walk_slow", ["slow walk"]),
        ("wang2018", "wrist", "walk_upstairs_hands-in-pockets", ["stairs"]),
        ("wang2018", "wrist", "standup_chair", ["getting up and sitting down"]),
        ("wang2018", "backpack", "walk", []),
        ("chen2015", "hand_using", "walk three speeds", ["A, B in the hand"]),
        ("chen2015", "hand_swinging", "walk_hard_floor", ["C swinging in the hand"]),
        ("chen2015", "back_pocket", "standing and handling", ["phone handled, standing"]),
        ("jayalath2013", "hand_or_pocket_unknown", "mixed", ["walk, stairs, circles; phone in the hand"]),
        ("khedr2017", None, None, []),
    ],
)
def test_recordings_find_their_condition(name, placement, activity, labels):
    assert [real.label for real in PAPERS[name].real if fits(real, placement, activity)] == labels


def test_real_recordings_are_grouped_by_condition_data_set_and_method():
    paper = PAPERS["chen2015"]
    adaptive, conventional, _ = methods(paper)
    base = Row(
        path="a", dataset="one", counter="x", preset="paper", params={}, placement="backpack", activity="walk",
        true_steps=100, steps=90, duration_s=60.0,
    )  # fmt: skip
    rows = [
        (conventional, base),
        (adaptive, dataclasses.replace(base, steps=100)),
        (adaptive, base),
        (adaptive, dataclasses.replace(base, dataset="two")),
        (adaptive, dataclasses.replace(base, steps=None, error="broken")),
        (adaptive, dataclasses.replace(base, activity="handling", true_steps=0, steps=6)),
    ]
    found = measured(paper, rows)
    assert [(f.dataset, f.method.label, f.recordings) for f in found] == [
        ("one", "adaptive", 2),
        ("one", "conventional", 1),
        ("two", "adaptive", 1),
        ("one", "adaptive", 1),
    ]
    assert found[0].figures.accuracy == pytest.approx(95.0)
    assert (found[0].claim, found[1].claim, found[3].claim) == (99.0, 97.0, None)
    assert found[3].false_per_hour == pytest.approx(360.0)


def made_paper():
    """A paper of one short walk, for the wrist."""
    full = PAPERS["wang2018"]
    return dataclasses.replace(small(full), tables=small(full).tables[3:4], claims=())


@pytest.fixture
def _in_one_process(monkeypatch):
    async def evaluate(found, chosen, *, lsb_per_g, **_):
        return [row for file in found for row in rows_of(file, chosen, lsb_per_g)]

    monkeypatch.setattr("service.evaluation.papers.run.evaluate", evaluate)


@pytest.mark.usefixtures("_in_one_process")
def test_a_report_counts_the_recordings_it_is_given(tmp_path):
    paths = [
        save(walk(30.0), tmp_path / "mine" / "a.npz", placement="wrist", activity="walk"),
        save(still(30.0), tmp_path / "mine" / "b.npz", placement="wrist", activity="desk_work"),
        save(walk(30.0), tmp_path / "mine" / "c.npz", placement="ankle", activity="walk"),
    ]
    broken = tmp_path / "mine" / "broken.npz"
    broken.write_bytes(b"PK\x03\x04 no archive")
    found = [Found(shown=str(path), path=path, dataset="mine") for path in (*paths, broken)]
    told = []
    made = asyncio.run(
        report(made_paper(), found, jobs=1, lsb_per_g=32.0, progress=lambda done, total: told.append((done, total)))
    )
    assert {(f.condition.label, f.recordings) for f in made.measured} == {
        ("walk, band on the wrist", 1),
        ("desk work", 1),
    }
    assert "Real recordings of the conditions" in made.text()
    assert told[-1] == (walkers(made_paper()),) * 2
    assert [row["dataset"] for row in made.as_json() if row["table"] == "real recordings"] == ["mine"] * 4


@pytest.mark.usefixtures("_in_one_process")
def test_two_axes_say_nothing_of_a_recording_of_the_magnitude(tmp_path):
    made = walk(30.0)
    turned = dataclasses.replace(made, acc_g=made.acc_g[:, [2, 0, 1]])
    both = dataclasses.replace(made, acc_g=np.add(made.acc_g, (0.1, 0.2, 0.0)))
    for name, recording in (("magnitude", turned), ("axes", both)):
        save(recording, tmp_path / name / "a.npz", placement="wrist", activity="walk")
    found = recordings([str(tmp_path)])
    report_of = asyncio.run(report(made_paper(), found, jobs=1, lsb_per_g=32.0, progress=lambda *_: None))
    methods_of = {(m.dataset, m.method.label) for m in report_of.measured}
    assert methods_of == {("magnitude", "three axes"), ("axes", "three axes"), ("axes", "two axes")}


def test_bars_are_what_has_a_published_figure(gyroscope):
    bars = gyroscope.bars
    assert [(bar.group, bar.published) for bar in bars[:2]] == [("flat land", 96), ("flat land, least walker", 94.59)]
    assert [bar.ours for bar in bars] == [
        ours for claim in gyroscope.paper.claims if (ours := claimed(claim, gyroscope.results)) is not None
    ]
    assert not any(bar.real for bar in bars)


def test_a_report_says_where_nothing_fits(tmp_path):
    path = save(walk(5.0), tmp_path / "a.npz", placement="ankle")
    found = [Found(shown="a.npz", path=path, dataset="x")]
    made = asyncio.run(report(made_paper(), found, jobs=1, lsb_per_g=32.0, progress=lambda *_: None))
    assert "none there has one of this paper's conditions" in made.text()


def test_recordings_are_those_named_or_those_of_the_environment(tmp_path, monkeypatch):
    save(walk(5.0), tmp_path / "named" / "a.npz")
    save(walk(5.0), tmp_path / "data" / "b.npz")
    monkeypatch.delenv("STEPLINK_DATA", raising=False)
    assert recordings([]) == []
    monkeypatch.setenv("STEPLINK_DATA", str(tmp_path / "data"))
    assert [found.path.name for found in recordings([])] == ["b.npz"]
    assert [found.path.name for found in recordings([str(tmp_path / "named")])] == ["a.npz"]


def test_a_paper_is_asked_for_by_its_name_alone():
    assert isinstance(asked("wang2018", [], []), Paper)
    with pytest.raises(ParameterError, match="wang2018, chen2015, jayalath2013, khedr2017"):
        asked("wang", [], [])
    for counters, params in ((["fusion"], []), ([], ["fusion.bout=3"])):
        with pytest.raises(ParameterError, match="leave --counter and --param out"):
            asked("wang2018", counters, params)


def test_a_table_with_noise_of_its_own_uses_it():
    table = next(table for table in PAPERS["chen2015"].tables if table.noise_g is not None)
    assert isinstance(table, Table)
    quiet, usual = (
        np.asarray(block(table.rows[0], 0, noise_g=noise).acc_g)[:, :100] for noise in (table.noise_g, None)
    )
    assert quiet.std(axis=1).max() < 0.5 * usual.std(axis=1).min()
