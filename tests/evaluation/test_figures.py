"""The figures: one file a name, drawn, the same again; their numbers where a picture cannot be read."""

import dataclasses
import itertools
import sys
from importlib import resources

import matplotlib.image
import numpy as np
import pytest
from evaluation.made import save, still, walk

from service.counters import registry
from service.errors import ParameterError
from service.evaluation.choices import find
from service.evaluation.figures import agreement, bracelet, canvas, draw, phones
from service.evaluation.figures.events import Kind, busiest, events
from service.evaluation.figures.sources import PEOPLE, cut, middle, sources, step_maxima_g, times_s
from service.evaluation.papers import PAPERS
from service.evaluation.papers.report import Bar
from service.evaluation.rows import Choice, Row
from service.samples import GRID_HZ

PNG = b"\x89PNG\r\n\x1a\n"


def row(**changes):
    base = Row(
        path="a", dataset="set", counter="double_threshold", preset="paper", params={}, true_steps=100, steps=95,
        duration_s=60.0, samples=3000, elapsed_s=0.001,
    )  # fmt: skip
    return dataclasses.replace(base, **changes)


ROWS = [
    row(),
    row(path="b", steps=110, dataset="other"),
    row(path="b", counter="adaptive_peak", steps=80),
    row(path="c", true_steps=0, steps=4),
    row(path="d", steps=None, error="broken"),
]


@pytest.fixture(autouse=True)
def _in_plain_python(monkeypatch):
    """Count without numba, which takes seconds to compile and changes no step."""
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)


@pytest.fixture(scope="module")
def of():
    return sources([], 32.0)


@pytest.fixture
def seen(monkeypatch):
    """Axes as they were drawn, by path."""
    kept = {}
    drawn = canvas.picture

    def keep(path, paint, **options):
        def paint_and_keep(axes):
            paint(axes)
            kept[path.stem] = axes

        return drawn(path, paint_and_keep, **options)

    for module in (agreement, bracelet, phones):
        monkeypatch.setattr(module, "picture", keep)
    return kept


@pytest.mark.full
def test_every_figure_is_written_once_and_is_no_blank(tmp_path, seen, monkeypatch):
    monkeypatch.setattr(canvas, "DPI", 50)
    written = draw.write(canvas.checked_folder(str(tmp_path / "new")), ROWS, [], lsb_per_g=32.0)
    assert [path.stem for path in written] == [*draw.SIGNALS, *draw.RESULTS]
    assert {path.name for path in (tmp_path / "new").iterdir()} == {path.name for path in written}
    for path in written:
        assert path.read_bytes().startswith(PNG)
        image = matplotlib.image.imread(path)[..., :3]
        assert 0.003 < (image < 0.9).any(axis=2).mean() < 0.9, path
    for name, axes in seen.items():
        assert axes[-1].get_xlabel() or name in {"accuracy", "timing"}, name
        assert all(each.get_ylabel() for each in axes), name
        assert all("/" in each.get_ylabel() for each in axes), name


def test_the_same_numbers_give_the_same_bytes(tmp_path, of):
    once, again = (bracelet.thresholds(tmp_path / f"{name}.png", of.walk).read_bytes() for name in "ab")
    assert once == again


def test_without_walks_only_the_time_is_drawn(tmp_path, of, monkeypatch):
    monkeypatch.setattr(draw, "sources", lambda *_: of)
    monkeypatch.setattr(draw, "SIGNALS", {})
    assert [path.stem for path in draw.write(tmp_path, [row(true_steps=0)], [], lsb_per_g=32.0)] == ["timing"]
    assert draw.write(tmp_path, [row(steps=None, error="broken")], [], lsb_per_g=32.0) == []


def test_a_missing_matplotlib_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ParameterError, match=r"pip install 'steplink\[figures\]'"):
        canvas.checked_folder(str(tmp_path))


def test_a_folder_that_cannot_be_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match="no folder can be made there"):
        canvas.checked_folder(str(tmp_path / "file"))


# From what they are drawn


def test_recordings_come_before_walkers(tmp_path):
    save(walk(30.0), tmp_path / "mine" / "a.npz", activity="walk")
    save(still(30.0), tmp_path / "mine" / "b.npz", activity="rest")
    (tmp_path / "mine" / "c.npz").write_bytes(b"PK\x03\x04 no archive")
    chosen = sources(find([str(tmp_path)])[0], 32.0)
    assert (chosen.walk.name, chosen.walk.true_steps) == ("mine/a.npz", 60)
    assert chosen.rest.name == "mine/b.npz"
    assert chosen.run.name == "synthetic run"
    assert chosen.pocket.signal.gyro_rad_s is not None


def test_the_middle_of_a_source_is_cut_at_its_own_times(of):
    part = middle(of.walk, 4.0)
    piece = cut(of.walk.signal, part.start, part.stop)
    assert (len(piece), piece.start - of.walk.signal.start) == (200, part.start)
    assert times_s(part)[0] == part.start / GRID_HZ
    assert np.array_equal(np.column_stack(piece.acc_g), of.walk.acc_g[part])
    assert middle(of.walk, 1e6) == slice(0, len(of.walk.signal))


# What they show


def test_thresholds_lie_over_each_other_and_steps_above(of):
    view = bracelet.counted(of.walk)
    assert len(view.steps) == pytest.approx(of.walk.true_steps, rel=0.2)
    assert all(band.lower < band.upper for band in view.bands)
    assert all(step.peak > step.upper for step in view.steps)
    at_peak = np.interp([step.at_s for step in view.steps], view.t_s + of.walk.signal.start / GRID_HZ, view.filtered_g)
    assert np.allclose(at_peak, [step.peak for step in view.steps])


def test_step_maxima_tell_a_walk_from_a_run_and_are_pooled(of):
    walking, running = of.walks.maxima_g, of.runs.maxima_g
    assert len(step_maxima_g(of.walk)) == of.walk.true_steps
    assert len(walking) == len(running) == PEOPLE * 100
    assert ((walking >= phones.WALK_G) & (walking <= phones.RUN_G)).mean() > 0.9
    assert (running > phones.RUN_G).mean() > 0.9


def test_every_recorded_walk_adds_its_step_maxima(tmp_path):
    for number, seconds in enumerate((10.0, 20.0)):
        save(walk(seconds), tmp_path / "mine" / f"{number}.npz", activity="walk")
    pool = sources(find([str(tmp_path)])[0], 32.0).walks
    assert (len(pool.maxima_g), pool.pieces, pool.synthetic) == (20 + 40, 2, False)


def test_what_was_evaluated_is_drawn_and_said(tmp_path, of, seen):
    rows = [row(counter="fusion"), row(preset="tuned", params={"axes": "xz", "bout": 5}, changed=("axes",))]
    chosen = bracelet.evaluated(rows)
    assert (chosen.preset, chosen.overrides) == ("tuned", {"axes": "xz"})
    assert bracelet.evaluated([row(counter="fusion")]) == bracelet.PUBLISHED
    bracelet.thresholds(tmp_path / "t.png", of.walk, chosen)
    assert "preset tuned axes=xz" in seen["t"][0].get_figure().get_suptitle()
    axes = {preset: bracelet.counted(of.walk, Choice(counter=bracelet.NAME, preset=preset, overrides={})).axes
            for preset in ("paper", "tuned")}  # fmt: skip
    assert axes == {"paper": "√(X² + Z²)", "tuned": "norm"}


def test_rest_is_that_of_the_preset_and_names_it(tmp_path, of, seen):
    for preset, said in (("paper", "rest: 0.031 g"), ("tuned", "rest: 0.180 g")):
        chosen = Choice(counter=bracelet.NAME, preset=preset, overrides={})
        bracelet.rest(tmp_path / "rest.png", of.rest, chosen)
        (axes,) = seen["rest"]
        assert said in [text.get_text() for text in axes.get_legend().get_texts()]
        assert f"preset {preset}" in axes.get_figure().get_suptitle()
        bracelet.filtered(tmp_path / "filtered.png", of.walk, chosen)
        assert f"preset {preset}" in seen["filtered"][0].get_figure().get_suptitle()


@pytest.fixture(scope="module")
def watched(of):
    return events(of.sensed[0])


def test_taken_extrema_are_the_counters_own(of, watched):
    """Every step of the counter is a peak that stood; taken ones come by turns, and those replaced did not stand."""
    counter = registry.make("fusion", "paper")
    steps = [*counter.update(of.sensed[0].signal).steps, *counter.finish().steps]
    taken = [event for event in watched.events if event.kind is Kind.TAKEN]
    start = of.sensed[0].signal.start
    assert steps
    assert {round(step.at_s * GRID_HZ) - start for step in steps} <= {event.at for event in taken}
    heights = dict(zip(((round(s.at_s * GRID_HZ) - start) for s in steps), (s.peak for s in steps), strict=True))
    assert all(heights.get(event.at, event.norm_g) == event.norm_g for event in taken)
    assert all(watched.norm_g[event.at] == event.norm_g for event in watched.events if event.at >= 0)
    rises = [b.norm_g > a.norm_g for a, b in itertools.pairwise(taken)]
    assert all(a != b for a, b in itertools.pairwise(rises))


def test_rejected_extrema_lie_in_a_reject_region_and_replacing_ones_in_an_update_region(watched):
    rejected = [event for event in watched.events if event.kind is Kind.REJECTED]
    replaced = [event for event in watched.events if event.kind is Kind.REPLACED]
    assert rejected
    assert replaced
    regions = [event.reject for event in watched.events if event.reject]
    assert all(any(first < event.at <= to for first, to in regions) for event in rejected)
    stood = [event for event in watched.events if event.kind in {Kind.TAKEN, Kind.REPLACED}]
    later = dict(itertools.pairwise(stood))
    assert all(event.update == (event.at, later[event].at) for event in replaced)
    assert all(abs(later[event].norm_g - 1) > abs(event.norm_g - 1) for event in replaced)


def test_the_stretch_with_most_decisions_is_shown(tmp_path, of, watched, seen, monkeypatch):
    monkeypatch.setattr(phones, "events", lambda _: watched)
    part, worth = busiest(watched, 300)
    assert part.stop - part.start == 300
    assert worth > 0
    phones.regions(tmp_path / "regions.png", of.sensed)
    told = [text.get_text() for text in seen["regions"][0].get_legend().get_texts()]
    inside = [event for event in watched.events if part.start <= event.at < part.stop]
    for kind, (_, _, text) in phones._MARKS.items():
        assert f"{text} ({sum(event.kind is kind for event in inside)})" in told


def test_a_gait_cycle_is_two_steps(tmp_path, of, seen):
    phones.gait_cycle(tmp_path / "cycle.png", of.pocket)
    dashed = [line.get_xdata()[0] for line in seen["cycle"][0].lines if line.get_linestyle() == "--"]
    cycle_s = np.diff(dashed).mean()
    assert cycle_s == pytest.approx(2 * len(of.pocket.signal) / GRID_HZ / of.pocket.true_steps, rel=0.15)


def test_bias_and_limits_are_bland_and_altmans(tmp_path, seen):
    rows = [row(path=str(k), steps=100 + error) for k, error in enumerate((-4, 0, 4, 8))]
    agreement.bland_altman(tmp_path / "ba.png", rows)
    levels = sorted(line.get_ydata()[0] for line in seen["ba"][0].lines if len(line.get_xdata()) == 2)
    sd = np.std([-4, 0, 4, 8], ddof=1)
    assert levels == pytest.approx([2 - 1.96 * sd, 2, 2 + 1.96 * sd])


def test_bars_stand_at_the_mean_accuracy_of_each_set(tmp_path, seen):
    agreement.accuracy(tmp_path / "bars.png", ROWS)
    heights = [[bar.get_height() for bar in bars] for bars in seen["bars"][0].containers]
    assert heights[0] == pytest.approx([95.0, 90.0])
    assert heights[1] == pytest.approx([80.0])


def test_bars_stand_in_the_middle_of_their_group_without_gaps(tmp_path, seen):
    sets = {"all": ("a", "b", "c"), "some": ("a", "c"), "one": ("c",)}
    rows = [row(path=name, dataset=name, counter=counter) for name, counters in sets.items() for counter in counters]
    agreement.accuracy(tmp_path / "bars.png", rows)
    middles = [[bar.get_x() + bar.get_width() / 2 for bar in bars] for bars in seen["bars"][0].containers]
    third = 0.8 / 3
    assert middles[0] == pytest.approx([-third, 1 - third / 2])
    assert middles[1] == pytest.approx([0.0])
    assert middles[2] == pytest.approx([third, 1 + third / 2, 2.0])


@pytest.mark.parametrize("count", [2, 6, 7, 12])
def test_names_of_groups_do_not_run_into_each_other(tmp_path, seen, count):
    agreement.accuracy(tmp_path / "bars.png", [row(path=f"{k}", dataset=f"F shoulder bag ({k})") for k in range(count)])
    names = seen["bars"][0].get_xticklabels()
    boxes = [name.get_window_extent() for name in names]
    if names[0].get_rotation():
        pitch_px = boxes[1].x1 - boxes[0].x1
        assert pitch_px * np.sin(np.radians(names[0].get_rotation())) > names[0].get_fontsize() * canvas.DPI / 72
    else:
        assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


def test_an_accuracy_below_0_is_written_where_its_bar_would_be(tmp_path, seen):
    agreement.accuracy(tmp_path / "bars.png", [row(), row(path="b", dataset="other", steps=250)])
    assert [text.get_text() for text in seen["bars"][0].texts] == ["−50 %"]


def test_published_bars_stand_around_ours(tmp_path, seen):
    bars = [
        Bar(group=group, method=method, ours=ours, published=99.0, real=real)
        for group, method, ours, real in (
            ("walking", "one", 90.0, False), ("walking", "two", -5.0, False), ("running", "two", 80.0, False),
            ("pocket (set)", "one", 70.0, True),
        )
    ]  # fmt: skip
    agreement.against_published(tmp_path / "bars.png", bars)
    walkers, recordings = seen["bars"]
    drawn = [[(bar.get_x(), bar.get_height()) for bar in bars] for bars in walkers.containers]
    ours, published = (drawn[0] + drawn[2]), (drawn[1] + drawn[3])
    assert [at for at, _ in ours] == [at for at, _ in published]
    assert [height for _, height in ours] == [90.0, 0.0, 80.0]
    assert {height for _, height in published} == {99.0}
    assert [text.get_text() for text in walkers.texts] == ["−5 %"]
    assert [text.get_text() for text in recordings.get_xticklabels()] == ["pocket (set)"]


def test_the_legend_has_the_colours_of_the_bars_of_every_panel(tmp_path, seen):
    bars = [
        Bar(group=f"{real}", method=method, ours=90.0, published=99.0, real=real)
        for method, real in (("one", False), ("one", True), ("two", True))
    ]
    agreement.against_published(tmp_path / "bars.png", bars)
    walkers, recordings = seen["bars"]
    legend = walkers.get_legend()
    one, two, published = legend.get_patches()
    assert [text.get_text() for text in legend.get_texts()] == ["one, ours", "two, ours", "published"]
    ours = [bars[0].get_facecolor() for bars in recordings.containers[::2]]
    assert [one.get_facecolor(), two.get_facecolor()] == ours
    assert ours[0] != ours[1]
    assert published.get_edgecolor() == recordings.containers[1][0].get_edgecolor()
    assert not published.get_fill()


def test_a_papers_figure_has_its_claims(tmp_path, seen, of, monkeypatch):
    monkeypatch.setattr(draw, "sources", lambda *_: of)
    monkeypatch.setattr(draw, "SIGNALS", {})
    bar = Bar(group="walking", method="one", ours=90.0, published=99.0, real=False)
    draw.write(tmp_path, [row()], [], lsb_per_g=32.0, bars=[bar])
    assert [text.get_text() for text in seen["accuracy"][0].get_xticklabels()] == ["walking"]


def test_cadence_is_true_steps_a_minute_and_every_counter_has_a_panel(tmp_path, seen):
    agreement.error_by_cadence(tmp_path / "cadence.png", ROWS)
    first, second = seen["cadence"]
    assert (first.get_title(loc="right"), second.get_title(loc="right")) == ("double_threshold", "adaptive_peak")
    assert (first.lines[0].get_xdata()[0], first.lines[0].get_ydata()[0]) == (100.0, -5.0)
    assert (first.lines[1].get_xdata(), first.lines[1].get_ydata()) == ([105.0], [2.5])
    assert first.get_ylim() == second.get_ylim()


def test_panels_of_agreement_share_their_scale_and_say_the_unit(tmp_path, seen):
    agreement.bland_altman(tmp_path / "ba.png", ROWS)
    first, second = seen["ba"]
    assert first.get_ylim() == second.get_ylim()
    assert first.get_ylabel() == second.get_ylabel() == "counted − true / steps"


@pytest.mark.parametrize(("there", "how"), [(True, "compiled by numba"), (False, "plain Python, numba is missing")])
def test_times_are_of_5000_samples_and_stand_beside_the_published(tmp_path, seen, monkeypatch, there, how):
    monkeypatch.setattr(agreement, "available", lambda: there)
    agreement.timing(tmp_path / "time.png", [row(), row(counter="adaptive_peak", elapsed_s=0.003)])
    here, published = seen["time"][0].containers
    assert [bar.get_height() for bar in here] == pytest.approx([0.001 * 5 / 3, 0.005])
    assert [bar.get_height() for bar in published] == [0.036]
    assert how in here.get_label()


def test_the_guide_lists_every_figure_and_paper():
    guide = resources.files("service").joinpath("guide/papers.md").read_text("utf-8")
    assert [name for name in (*draw.SIGNALS, *draw.RESULTS) if f"`{name}.png`" not in guide] == []
    assert [name for name in PAPERS if name not in guide] == []
