"""Which recordings teach: licences stated, splits kept apart, numbers known."""

import csv

import numpy as np
import pytest
from evaluation.made import save, still, walk

from service.errors import ParameterError, RecordingError
from service.evaluation import choices
from service.evaluation.training import folds, sources
from service.evaluation.training.material import UNSTATED


@pytest.fixture
def folder(tmp_path):
    """A set that may teach, one that may not, auxiliary ones that cannot even be read, and an index."""
    save(walk(10), tmp_path / "dcaiti" / "a.npz")
    save(walk(10), tmp_path / "mine" / "b.npz")
    save(walk(10), tmp_path / "brajdic_walk" / "c.npz")
    for dataset in ("oxford_opt_B", "later"):
        (tmp_path / dataset).mkdir()
        (tmp_path / dataset / "d.npz").write_bytes(b"nobody may look at this")
    (tmp_path / "index.csv").write_text("split,dataset,recording\naux,later,d\ndev,dcaiti,a\n")
    return tmp_path


def found(*paths):
    return choices.find([str(path) for path in paths])[0]


def names(files):
    return sorted(file.dataset for file in files)


def test_sets_are_told_apart(folder):
    apart = sources.told_apart(found(folder))
    assert names(apart.teaching) == ["dcaiti", "mine"]
    assert names(apart.unseen) == ["brajdic_walk"]
    assert names(apart.apart) == ["later", "oxford_opt_B"]
    assert len(sources.load([*apart.teaching, *apart.unseen], 32)[0]) == 3
    refused, left = apart.notes()
    assert refused.startswith("brajdic_walk: the licence is not stated")
    assert left.startswith("later, oxford_opt_B: kept for the end")


def test_who_does_not_say_who_they_are_is_one_subject(tmp_path):
    for name in ("a", "b"):
        save(walk(10), tmp_path / "mine" / f"{name}.npz")
    made, _ = sources.load(found(tmp_path), 32)
    assert [one.recording for one in made] == ["a", "b"]
    assert len({folds.person(one) for one in made}) == 1
    assert [fold.held for fold in folds.of_own(made)] == [(0,), (1,)], "apart by recording, not by person"


def test_where_nothing_may_teach_it_is_said_why(folder):
    with pytest.raises(ParameterError, match=r"nothing there may teach\. brajdic_walk: the licence is not stated"):
        sources.told_apart(found(folder / "brajdic_walk"))


def test_recordings_that_cannot_teach_are_passed_over(tmp_path):
    save(walk(10), tmp_path / "mine" / "a.npz")
    save(still(10), tmp_path / "mine" / "rest.npz")
    save(walk(10, step_t_s=None, true_steps=None), tmp_path / "mine" / "untold.npz")
    save(walk(2), tmp_path / "mine" / "short.npz")
    seen = []
    made, passed = sources.load(found(tmp_path), 32, lambda done, total: seen.append((done, total)))
    assert [(one.recording, one.true_steps) for one in made] == [("a", 20), ("rest", 0)]
    assert sorted(name.rpartition("/")[2] for name in passed) == ["short.npz", "untold.npz"]
    assert seen == [(number, 4) for number in (1, 2, 3, 4)]


def test_a_damaged_recording_is_named(tmp_path):
    (tmp_path / "mine").mkdir()
    np.savez(tmp_path / "mine" / "bad.npz", t=np.arange(100) / 50, acc=np.full((100, 3), np.nan))
    with pytest.raises(RecordingError, match=r"bad\.npz"):
        sources.load(found(tmp_path), 32)


def test_what_teaches_nothing_is_known_with_the_reason():
    assert set(sources.KNOWN) > UNSTATED
    assert all("stated" in sources.KNOWN[name].licence or "suit" in sources.KNOWN[name].licence for name in UNSTATED)
    assert sources.source("mine") is sources.OWN


@pytest.mark.full
def test_every_development_set_is_known(recordings):
    with (recordings / "index.csv").open(encoding="utf-8") as file:
        listed = {(line["dataset"], line["split"]) for line in csv.DictReader(file)}
    assert {name for name, split in listed if split == "dev"} <= set(sources.KNOWN)
    assert {name for name, split in listed if split != "dev"} == sources.AUXILIARY
