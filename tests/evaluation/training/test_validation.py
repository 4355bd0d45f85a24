"""Figures of a cross-validation: what was held back, each seed apart, mean and range."""

import pytest
from evaluation.training.recorded import material

from service.counters import steplink_weights
from service.evaluation.training import scratch
from service.evaluation.training.runs import Checkpoint, Trained
from service.evaluation.training.validation import HEAD, validation


@pytest.fixture
def arrays():
    return steplink_weights.integers(steplink_weights.shipped().weights)


def trained(run, arrays, share):
    """What a run would have left that counts so much of each walk it held back."""
    counted = {place: round(share * 40) for place in run.held}
    return Trained(
        run=run,
        kept=[Checkpoint(steps=run.steps, arrays=arrays, counted=counted)],
        first_loss=1.0,
        last_loss=0.5,
    )


@pytest.fixture
def laid(monkeypatch):
    """Two sources of two people each and an unseen one, both cross-validations with two seeds."""
    monkeypatch.setattr(scratch, "synthetic", lambda *_, seed: [material("device_sim", str(seed))])
    monkeypatch.setattr(scratch, "exercises", lambda *_, seed: [material("exercises", str(seed))])
    teaching = [material(source, subject) for source in ("dcaiti", "pebble_wrist") for subject in "ab"]
    unseen = [material("eth2022_wrist", "x", steps_range=(20, 41))]
    return scratch.plan(teaching, unseen, wanted=["sources", "subjects"], steps=9, seed=3, seeds=2)


def test_every_run_is_planned(laid):
    first, *others = laid.runs
    assert first.taught == (0, 1, 2, 3, 4, 5)
    assert first.held == (6,)
    assert laid.kinds == ["sources"] * 4 + ["subjects"] * 8
    assert {run.seed for run in others} == {3, 4}
    assert first.seed == 3
    assert all({4, 5} <= set(run.taught) and set(run.taught).isdisjoint(run.held) for run in laid.runs)


def test_figures_are_means_over_seeds_with_their_range(laid, arrays):
    made = [trained(run, arrays, 0.9 if run.seed == 3 else 0.8) for run in laid.runs]
    by_source, by_subject, unseen = scratch.validations(laid, made)
    assert [one.title for one in (by_source, by_subject)] == list(scratch.TITLES.values())
    (line,) = by_source.lines()
    told = dict(zip(HEAD, line, strict=True))
    assert told["family"] == "wrist walks"
    assert told["rec."] == "4"
    assert told["value"] == "15.0 (10.0–20.0) %"
    assert told["must"] == "5.5 %"
    assert told["of each source"] == "dcaiti 15.0; pebble_wrist 15.0"
    assert unseen.title == scratch.UNSEEN
    assert dict(zip(HEAD, unseen.lines()[0], strict=True))["value"] == "10.0 %"
    assert unseen.within()["eth2022_wrist"].within == 1


def test_one_seed_has_no_range(laid, arrays):
    run = laid.runs[1]
    (line,) = validation("title", [trained(run, arrays, 0.5)], laid.material).lines()
    assert line[3] == "50.0 %"
