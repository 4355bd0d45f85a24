"""What an index sets apart is not looked at."""

from pathlib import Path

from service.evaluation.choices import Found
from service.evaluation.scorecard.splits import of_split


def found(folder: Path, dataset: str, name: str) -> Found:
    return Found(shown=name, path=folder / dataset / f"{name}.npz", dataset=dataset)


def test_recordings_of_another_split_are_left_out_and_unlisted_ones_are_not(tmp_path):
    (tmp_path / "index.csv").write_text("split,dataset,recording\ndev,a,one\naux,a,two\naux,b,three\n")
    files = [found(tmp_path, "a", name) for name in ("one", "two", "mine")] + [found(tmp_path, "b", "three")]
    taken, apart = of_split(files, "dev")
    assert [file.shown for file in taken] == ["one", "mine"]
    assert [file.shown for file in apart] == ["two", "three"]
    assert [file.shown for file in of_split(files, "aux")[0]] == ["two", "mine", "three"]


def test_without_an_index_of_splits_all_are_taken(tmp_path):
    (tmp_path / "index.csv").write_text("recording,true_steps\none,40\n")
    assert of_split([found(tmp_path, "a", "one")], "dev")[1] == []
    assert of_split([found(tmp_path / "none", "a", "one")], "dev")[1] == []
