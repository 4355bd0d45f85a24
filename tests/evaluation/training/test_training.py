"""Training itself, on little: the loss falls, and the network that comes out is the counter's, bit for bit."""

import numpy as np
import pytest
from evaluation.training.recorded import material

from service.counters import steplink_network as network
from service.counters import steplink_weights
from service.errors import TrainingError
from service.evaluation import choices
from service.evaluation.training import runs, scratch, sources, tuning, weights_file
from service.evaluation.training.material import OTHERS, SYNTHETIC, WEIGHTS, synthetic

pytestmark = pytest.mark.full

STEPS = 50
SEEN = ("negatives_spar_watch", "pebble_wrist", "dcaiti")
A_SET = 8
"""Recordings of each set."""


@pytest.fixture(scope="session")
def teaching():
    """Synthetic walks and motion without a step; real recordings beside them where there are any."""
    import os

    made = [*synthetic(8, seed=1), *tuning.quiet(6, seed=1)]
    folder = os.environ.get("STEPLINK_DATA")
    for name in SEEN if folder else ():
        found = choices.find([f"{folder}/{name}"])[0]
        made += sources.load(found[:: max(len(found) // A_SET, 1)], 32)[0]
    return made


def run(material, **changes):
    places = tuple(range(len(material)))
    made = {"name": "test", "taught": places, "held": places[:4], "seed": 1, "steps": STEPS, "checkpoints": (STEPS,)}
    return runs.Run(**(made | changes))


@pytest.fixture(scope="session")
def trained(teaching):
    return runs.train(run(teaching), teaching)


def test_the_loss_falls(trained):
    assert trained.last_loss < 0.8 * trained.first_loss


def test_the_file_counts_as_the_training_did(trained, teaching, tmp_path):
    path = tmp_path / "weights.npz"
    weights_file.write(path, trained.kept[-1].arrays, weights_file.about(trained, teaching))
    weights = steplink_weights.read(path).weights
    assert {place: runs.counted(teaching[place], weights) for place in range(4)} == trained.kept[-1].counted


def test_the_network_that_learns_is_the_one_that_counts(trained, teaching):
    from service.evaluation.training import model
    from service.evaluation.training.clips import rows_of

    frames = 200
    rows = np.stack([rows_of(one.acc_g, frames) for one in teaching])
    assert rows.any(axis=(1, 2, 3)).all()
    arrays = trained.kept[-1].arrays
    learnt, cadence_hz = model.answers(model.plain(arrays), rows, exact=True)
    weights = network.weights_of(dict(arrays))
    sensed = rows.reshape(len(rows), -1, rows.shape[-1])
    counts = np.stack([network.Stream(weights).run(one) for one in sensed])[:, network.DELAY :]
    assert np.array_equal(np.asarray(learnt) * (network.UNIT * network.WEIGHT_UNIT), counts[..., 0])
    logit = counts[..., 1] / (network.UNIT * network.WEIGHT_UNIT)
    assert np.asarray(cadence_hz) == pytest.approx(0.6 + 3.2 / (1.0 + np.exp(0.5 - logit)), abs=1e-5)
    assert np.ptp(counts[..., 0]) > 100.0, "it tells nothing apart"


def test_weights_in_plain_units_are_the_same_weights(trained):
    from service.evaluation.training import model

    arrays = trained.kept[-1].arrays
    again = model.integers(model.plain(arrays))
    assert all(np.array_equal(again[name], values) for name, values in arrays.items())


def test_the_same_seed_gives_the_same_weights_however_many_go_on_at_once(teaching):
    few = [one for one in teaching if one.source == SYNTHETIC]
    shipped = steplink_weights.integers(steplink_weights.shipped().weights)
    same = run(few, steps=8, checkpoints=(4, 8), start=shipped)  # one network to compile: this takes long enough
    seen = []
    made = runs.carried_out([same, same], few, jobs=2, progress=lambda done, total: seen.append((done, total)))
    first, again = ([dict(kept.arrays) for kept in one.kept] for one in made)
    assert len(first) == 2
    for ours, theirs in zip(first, again, strict=True):
        assert all(np.array_equal(ours[name], theirs[name]) for name in ours)
    assert any(not np.array_equal(first[0][name], first[1][name]) for name in first[0])
    assert {total for _, total in seen} == {16}


def test_a_seed_gives_the_same_weights_to_begin_with():
    from service.evaluation.training import model

    first, again, other = (model.integers(model.fresh(seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["kernel0"], other["kernel0"])


def test_a_loss_that_is_no_number_ends_it():
    broken = material(acc_g=np.full((1000, 3), 1e30))
    with pytest.raises(TrainingError, match="the loss is nan"):
        runs.train(run([broken], rate=float("inf"), steps=8, checkpoints=(8,)), [broken])


def test_a_fold_counts_what_it_was_not_taught(trained):
    plan = scratch.plan([material(subject="a"), material(subject="b")], [], wanted=["subjects"], steps=8)
    assert [set(one.taught).isdisjoint(one.held) for one in plan.runs] == [True] * 3
    assert set(trained.kept[-1].counted) == set(trained.run.held)


def test_pools_are_drawn_as_the_recipe_says_and_own_ones_with_them():
    of = [
        material("pebble_wrist"),
        material("pebble_wrist", true_steps=0, trusted=False),  # no pool of the recipe
        material("mine", true_steps=0),
    ]
    assert runs.shares(of) == {
        "pebble_wrist/walk": WEIGHTS["pebble_wrist/walk"],
        "pebble_wrist/doubt": 0.0,
        "mine/still": OTHERS,
    }
