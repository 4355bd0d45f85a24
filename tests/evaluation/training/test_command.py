"""`steplink train` as a user types it: a few steps on a few recordings, and what is said where something is wrong."""

import os
import subprocess
import sys

import numpy as np
import pytest
from evaluation.made import save, still, walk

from device_sim.gait import Walker
from service.counters import steplink_weights
from service.evaluation.training import card, recipe
from service.evaluation.training.material import SYNTHETIC

pytestmark = pytest.mark.full

TIMEOUT_S = 400


def run(*words, cwd=None, **environment):
    return subprocess.run(
        [sys.executable, "-m", "service.cli", *map(str, words)],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        cwd=cwd,
        env=os.environ | environment,
        check=False,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings of two people that may teach, one that may not, one that nobody may look at, and a damaged one."""
    made = tmp_path_factory.mktemp("data")
    for number, subject in enumerate("aabb"):
        walked = walk(30, swing_g=0.3 + 0.1 * number, step_hz=1.5 + 0.2 * number)
        save(walked, made / "mine" / f"walk{number}.npz", placement="wrist", activity="walk", subject=subject)
        save(still(30), made / "mine" / f"rest{number}.npz", placement="wrist", activity="desk", subject=subject)
    save(walk(20), made / "eth2022_wrist" / "walk.npz", placement="wrist", activity="walk", subject="x")
    (made / "oxford_opt_B").mkdir()
    (made / "oxford_opt_B" / "a.npz").write_bytes(b"nobody may look at this")
    (made / "bad").mkdir()
    np.savez(made / "bad" / "nan.npz", t=np.arange(100) / 50, acc=np.full((100, 3), np.nan), true_steps=3)
    save(walk(20, step_t_s=None, true_steps=None), made / "untold" / "walk.npz")
    return made


@pytest.fixture(scope="module")
def weights(folder, tmp_path_factory):
    """What a training of eight steps leaves: weights and card, and what was printed."""
    made = tmp_path_factory.mktemp("out")
    data = [folder / name for name in ("mine", "eth2022_wrist", "oxford_opt_B")]
    answer = run(
        "train", "--data", *data, "--steps", 8, "--folds", "subjects", "--seed", 3, "--card", "card.md", cwd=made
    )
    return made, answer


def test_weights_and_card_are_made_by_one_command(weights):
    made, answer = weights
    assert answer.returncode == 0, answer.stderr
    assert sorted(one.name for one in made.iterdir()) == ["card.md", "steplink_weights.npz"]
    kept = steplink_weights.read(made / "steplink_weights.npz")
    assert kept.about["sources"]["mine"] == 8
    assert kept.about["sources"][SYNTHETIC] == recipe.WEARERS
    assert (kept.about["steps"], kept.about["seed"], kept.about["from"]) == (8, 3, None)
    text = (made / "card.md").read_text("utf-8")
    digest = steplink_weights.digest(kept.weights)
    assert card.said_digest(text) == digest
    assert digest in answer.stdout
    for title in ("Subjects held back", "Sources that never taught"):
        assert title in answer.stdout
        assert title in text
    assert "eth2022_wrist: the licence is not stated" in answer.stderr
    assert "oxford_opt_B: kept for the end" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_what_was_made_counts(weights, folder):
    made, _ = weights
    words = ("evaluate", folder / "mine" / "walk0.npz", "--counter", "steplink", "--weights")
    assert run(*words, made / "steplink_weights.npz").returncode == 0
    answer = run(*words, folder / "mine" / "walk0.npz")
    assert answer.returncode == 2
    assert "no weights of `steplink train`" in answer.stderr


def test_a_counter_that_knows_it_all_is_not_replaced(folder, tmp_path):
    answer = run("train", "--from", "shipped", "--data", folder / "mine", "--steps", 8, cwd=tmp_path)
    assert answer.returncode == 1, answer.stderr
    assert "It did not help" in answer.stdout
    assert "nothing was written" in answer.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_it_does_not_count_is_learnt(tmp_path):
    shut = steplink_weights.integers(steplink_weights.shipped().weights)
    shut["bias8"][0] -= 4 * 4096  # four logits less likely a walk: half of these walks is lost
    (tmp_path / "shut.npz").write_bytes(steplink_weights.packed(shut, {}))
    (tmp_path / "mine").mkdir()
    for number in range(6):
        walker = Walker("rest:5,slow:30,normal:30,rest:5", seed=100 + number, strength=0.7)
        samples = round(walker.duration_s * 50)
        acc_g, step_s = np.asarray(walker.read(samples)), np.asarray(walker.step_times_until(walker.duration_s))
        held = {"t": np.arange(samples) / 50, "acc": acc_g, "step_t": step_s, "subject": f"s{number % 2}"}
        np.savez(tmp_path / "mine" / f"{number}.npz", **held)
    answer = run("train", "--from", "shut.npz", "--data", "mine", "--steps", 60, "--out", "own.npz", cwd=tmp_path)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert "It helped: of 6" in answer.stdout
    about = steplink_weights.read(tmp_path / "own.npz").about
    assert about["from"] == steplink_weights.digest(steplink_weights.read(tmp_path / "shut.npz").weights)
    assert about["steps"] in {15, 30, 60}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["train"], "--data"),
        (["train", "--data", "nowhere"], "no such file"),
        (["train", "--data", "bad"], "nan.npz"),
        (["train", "--data", "untold"], "no recording there says how many steps"),
        (["train", "--data", "eth2022_wrist"], "nothing there may teach"),
        (["train", "--data", "oxford_opt_B"], "kept for the end"),
        (["train", "--data", "mine", "--folds", "sources"], "two sources are needed"),
        (["train", "--data", "mine", "--folds", "none", "sources"], "none beside others"),
        (["train", "--data", "mine", "--out", "no/such.npz"], "a folder that exists"),
        (["train", "--data", "mine", "--card", "."], "a folder that exists"),
        (["train", "--data", "mine/walk0.npz", "--from", "shipped"], "a single recording"),
        (["train", "--data", "mine", "--from", "mine/walk0.npz"], "no weights of `steplink train`"),
        (["train", "--data", "mine", "--from", "shipped", "--card", "c.md"], "--from tells by itself"),
        (["train", "--data", "mine", "--steps", "2"], "not in 8"),
    ],
)
def test_what_is_wrong_is_told_before_any_training(folder, words, said):
    answer = run(*words, cwd=folder)
    assert answer.returncode == 2
    assert said in answer.stderr
    assert "Traceback" not in answer.stderr


def test_a_missing_extra_is_named(folder, tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['jax'] = None\n")
    answer = run("train", "--data", folder / "mine", PYTHONPATH=str(tmp_path))
    assert answer.returncode == 2
    assert answer.stderr == "steplink: jax is missing: pip install 'steplink[train]'\n"
