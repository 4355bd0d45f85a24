"""What the words of `steplink evaluate` mean: counters, parameters, and the files at a path."""

from pathlib import Path

import numpy as np
import pytest
from evaluation.made import save, walk

from service.counters import registry
from service.errors import CounterError, ParameterError
from service.evaluation.choices import choices, counters_and_paths, find


def test_all_means_every_counter_and_twice_means_once():
    assert [choice.counter for choice in choices(["all"], "tuned", [])] == list(registry.COUNTERS)
    assert len(choices(["double_threshold", "double_threshold"], "paper", [])) == 1


def test_parameters_go_to_their_counter():
    (chosen,) = choices(["double_threshold"], "paper", ["double_threshold.bout=3", "double_threshold.axes=norm"])
    assert chosen.preset == "paper"
    assert chosen.overrides == {"bout": "3", "axes": "norm"}


@pytest.mark.parametrize(
    ("names", "preset", "params", "error", "said"),
    [
        (["abacus"], "tuned", [], CounterError, "double_threshold"),
        (["double_threshold"], "best", [], CounterError, "paper, tuned"),
        (["double_threshold"], "tuned", ["double_threshold.colour=3"], ParameterError, "no such parameter"),
        (["double_threshold"], "tuned", ["double_threshold.bout=99"], ParameterError, "from 2 to 12"),
        (["double_threshold"], "tuned", ["autocorrelation.bout=3"], ParameterError, "not evaluated"),
        (["double_threshold"], "tuned", ["bout=3"], ParameterError, "NAME.KEY=V"),
        (["double_threshold"], "tuned", ["double_threshold.bout"], ParameterError, "NAME.KEY=V"),
        (["double_threshold"], "tuned", [".bout=3"], ParameterError, "NAME.KEY=V"),
        (["autocorrelation"], "tuned", ["autocorrelation.period=stride"], ParameterError, "t_min"),
    ],
)
def test_what_is_wrong_is_said(names, preset, params, error, said):
    with pytest.raises(error, match=said):
        choices(names, preset, params)


def test_paths_may_follow_the_names_of_counters(tmp_path):
    folder = str(tmp_path)
    assert counters_and_paths(["all", folder], []) == (["all"], [folder])
    assert counters_and_paths([folder], ["walks"]) == ([registry.DEFAULT], ["walks", folder])
    assert counters_and_paths(["abacus"], []) == (["abacus"], [])


def test_a_counter_is_a_counter_even_where_a_folder_has_its_name(tmp_path, monkeypatch):
    (tmp_path / "double_threshold").mkdir()
    monkeypatch.chdir(tmp_path)
    assert counters_and_paths(["double_threshold"], ["."]) == (["double_threshold"], ["."])


def test_files_are_found_in_order_with_their_folder_as_data_set(tmp_path):
    for name in ("b/2.npz", "b/1.npz", "a/deep/er/3.npz", ".hidden/4.npz", "b/.5.npz"):
        save(walk(1), tmp_path / name)
    found, passed = find([str(tmp_path)])
    assert [(f.shown, f.dataset) for f in found] == [
        (f"{tmp_path}/a/deep/er/3.npz", "er"),
        (f"{tmp_path}/b/1.npz", "b"),
        (f"{tmp_path}/b/2.npz", "b"),
    ]
    assert passed == []


def test_a_path_is_shown_as_it_was_asked_for(tmp_path, monkeypatch):
    save(walk(1), tmp_path / "set" / "1.npz")
    monkeypatch.chdir(tmp_path)
    assert [(f.shown, f.dataset) for f in find(["."])[0]] == [("./set/1.npz", "set")]
    assert [f.shown for f in find(["set/"])[0]] == ["set/1.npz"]
    monkeypatch.chdir(tmp_path / "set")
    assert [(f.shown, f.dataset) for f in find(["1.npz"])[0]] == [("1.npz", "set")]


def test_a_file_is_found_once_however_often_it_is_named(tmp_path, monkeypatch):
    save(walk(1), tmp_path / "set" / "1.npz")
    monkeypatch.chdir(tmp_path)
    found, _ = find(["set/1.npz", "./set/1.npz", "set", "set/../set", str(tmp_path)])
    assert [f.shown for f in found] == ["set/1.npz"]


def test_the_data_set_of_a_link_is_the_folder_it_was_put_in(tmp_path):
    there = save(walk(1), tmp_path / "elsewhere" / "1.npz")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "one.npz").symlink_to(there)
    (tmp_path / "ours").symlink_to(tmp_path / "elsewhere")
    for path in ("mine", "mine/one.npz", "ours", "ours/../mine"):
        assert [f.dataset for f in find([f"{tmp_path}/{path}"])[0]] == [path.split("/")[-1 if ".." in path else 0]]


def test_texts_that_are_no_recordings_are_passed_over_unless_named(tmp_path):
    save(walk(1), tmp_path / "1.npz")
    (tmp_path / "index.csv").write_text("recording,true_steps\n1,2\n")
    (tmp_path / "notes.txt").write_text("walked to the shop\n")
    (tmp_path / "damaged.csv").write_text("time_s,x_g,y_g\n0,0,0\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "garbage.npz").write_bytes(b"no zip")
    (tmp_path / "song.mp3").write_bytes(b"\0")
    found, passed = find([str(tmp_path)])
    assert [f.path.name for f in found] == ["1.npz", "damaged.csv", "empty.csv", "garbage.npz"]
    assert [Path(text).name for text in passed] == ["index.csv", "notes.txt"]
    assert [f.path.name for f in find([str(tmp_path / "index.csv")])[0]] == ["index.csv"]


def test_an_unreadable_file_is_found_so_that_it_can_be_told(tmp_path, monkeypatch):
    save(walk(1), tmp_path / "1.npz")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert len(find([str(tmp_path)])[0]) == 1


def test_no_path_no_file_and_no_recording_are_said(tmp_path):
    with pytest.raises(ParameterError, match="name a recording"):
        find([])
    with pytest.raises(ParameterError, match="no such file"):
        find([str(tmp_path / "absent")])
    with pytest.raises(ParameterError, match=r"no recordings \(.*\.npz.*\) there"):
        find([str(tmp_path)])
    (tmp_path / "index.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ParameterError, match="1 texts are none"):
        find([str(tmp_path)])
    np.savez(tmp_path / "x.npz", t=np.arange(3))
    assert len(find([str(tmp_path)])[0]) == 1
