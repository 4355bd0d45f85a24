"""The file a training leaves: whole or not there, small, and telling how it was made."""

import pytest
from evaluation.training.recorded import material

from service.counters import steplink_weights
from service.errors import ParameterError
from service.evaluation.training import weights_file
from service.evaluation.training.runs import Run, Trained


@pytest.fixture
def kept():
    return steplink_weights.shipped()


def run(**changes):
    made = {"name": "x", "taught": (0, 1), "held": (), "seed": 4, "steps": 9, "checkpoints": (9,)}
    return Run(**(made | changes))


def test_it_is_read_again_as_it_was_written(tmp_path, kept):
    path = tmp_path / "weights.npz"
    trained = Trained(run=run(), kept=[], first_loss=1.0, last_loss=0.123456)
    said = weights_file.about(trained, [material(), material("dcaiti")], start=kept.weights)
    written = weights_file.write(path, steplink_weights.integers(kept.weights), said)
    again = steplink_weights.read(path)
    assert written == steplink_weights.digest(again.weights) == steplink_weights.digest(kept.weights)
    assert again.about == said
    assert said["sources"] == {"dcaiti": 1, "mine": 1}
    assert (said["steps"], said["seed"], said["loss"], said["from"]) == (9, 4, 0.1235, written)
    assert set(said["versions"]) == set(weights_file.MADE_WITH)
    assert path.stat().st_size < steplink_weights.LARGEST_BYTES
    assert [one.name for one in tmp_path.iterdir()] == ["weights.npz"]


def test_the_old_file_stays_where_the_new_one_cannot_be_written(tmp_path, kept, monkeypatch):
    path = tmp_path / "weights.npz"
    path.write_bytes(b"old")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(ParameterError, match="No space left"):
        weights_file.write(path, steplink_weights.integers(kept.weights), {})
    assert path.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["weights.npz"]


@pytest.mark.parametrize("name", [".", "no/such.npz"])
def test_where_no_file_can_be_is_told_before_any_work(tmp_path, name):
    with pytest.raises(ParameterError, match="a file in a folder that exists"):
        weights_file.checked(str(tmp_path / name), "out")
