"""Whether a fine-tuning helped: the verdict from counts, each chosen so that one reason alone decides."""

import numpy as np
import pytest
from evaluation.training.recorded import material

from service.counters import steplink_weights
from service.evaluation.training import tuning
from service.evaluation.training.runs import Checkpoint, Trained

TRUE = 40
SECONDS = 20.0


@pytest.fixture(autouse=True)
def known(monkeypatch):
    """What the network of before counts: 30 of 40 steps, and 40 of 40 of each synthetic walk."""
    before = {True: 30, False: TRUE}
    monkeypatch.setattr(tuning, "counted", lambda one, _: before[one.source == "mine"])


@pytest.fixture
def arrays():
    return steplink_weights.integers(steplink_weights.shipped().weights)


def plan(monkeypatch, arrays, recordings=4):
    """Four recordings of four people, and one synthetic walk to mix in and one aside."""
    monkeypatch.setattr(tuning, "synthetic", lambda *_, seed: [material("device_sim", str(seed))])
    monkeypatch.setattr(tuning, "quiet", lambda *_, **__: [])
    own = [material(subject=f"s{number}", seconds=SECONDS) for number in range(recordings)]
    return tuning.plan(own, arrays, steps=8, seed=1)


def trained(plan, arrays, counts, aside=(TRUE, TRUE, TRUE)):
    """What each run would have counted at its three checkpoints; `counts` by place, the same in whichever fold."""

    def made(run, by_checkpoint):
        kept = [
            Checkpoint(steps=steps, arrays=arrays, counted=counted)
            for steps, counted in zip(run.checkpoints, by_checkpoint, strict=True)
        ]
        return Trained(run=run, kept=kept, first_loss=1.0, last_loss=0.5)

    *folds, final = plan.runs
    out = [made(run, [{place: counts[number][place] for place in run.held} for number in range(3)]) for run in folds]
    return [*out, made(final, [dict.fromkeys(final.held, count) for count in aside])]


def verdict(monkeypatch, arrays, counts, aside=(TRUE, TRUE, TRUE)):
    laid = plan(monkeypatch, arrays)
    return tuning.verdict(laid, trained(laid, arrays, counts, aside), steplink_weights.shipped().weights)


def test_the_plan_holds_each_back_and_learns_from_all_at_last(monkeypatch, arrays):
    laid = plan(monkeypatch, arrays)
    *folds, final = laid.runs
    assert [run.held for run in folds] == [(0,), (1,), (2,), (3,)]
    assert all(set(run.taught) == {0, 1, 2, 3, 4} - set(run.held) for run in folds)
    assert final.taught == (0, 1, 2, 3, 4)
    assert final.held == (5,)
    assert {run.checkpoints for run in laid.runs} == {(2, 4, 8)}


def test_it_helped(monkeypatch, arrays):
    found = verdict(monkeypatch, arrays, [[30] * 4, [38, 38, 38, 30], [36] * 4])
    assert found.helped
    assert (found.better, found.worse, found.recordings) == (3, 0, 4)
    assert found.before.walks_percent == pytest.approx(25.0)
    assert found.before.wrong_per_min == pytest.approx(30.0)
    assert found.after.walks_percent < 25.0
    assert tuning.sentence(found).startswith("It helped: of 4")
    assert tuning.table(found)[1] == ("error of walks", "25.0 %", f"{found.after.walks_percent:.1f} %")


def test_how_long_is_chosen_for_a_fold_by_the_others(monkeypatch, arrays):
    # The second checkpoint is best for three; the third is perfect for the fourth, which cannot know.
    found = verdict(monkeypatch, arrays, [[30] * 4, [40, 40, 40, 34], [35, 35, 35, 40]])
    assert found.after.walks_percent == pytest.approx(15.0 / 4)
    assert found.chosen.steps == 4


def test_nothing_changed_did_not_help(monkeypatch, arrays):
    found = verdict(monkeypatch, arrays, [[30] * 4] * 3)
    assert not found.helped
    assert (found.better, found.worse) == (0, 0)
    assert "did not help" in tuning.sentence(found)


def test_a_mean_that_one_recording_makes_did_not_help(monkeypatch, arrays):
    found = verdict(monkeypatch, arrays, [[40, 29, 29, 29]] * 3)
    assert found.after.wrong_per_min < found.before.wrong_per_min
    assert (found.better, found.worse) == (1, 3)
    assert not found.helped


def test_what_forgot_other_walks_did_not_help(monkeypatch, arrays):
    found = verdict(monkeypatch, arrays, [[40] * 4] * 3, aside=(TRUE - 2,) * 3)
    assert found.better == 4
    assert found.forgot
    assert not found.helped
    assert "forgot" in tuning.sentence(found)


def test_false_steps_are_told_apart_from_walks(monkeypatch, arrays):
    monkeypatch.setattr(tuning, "synthetic", lambda *_, seed: [material("device_sim", str(seed))])
    monkeypatch.setattr(tuning, "quiet", lambda *_, **__: [])
    own = [material(subject="a"), material(subject="b", true_steps=0)]
    laid = tuning.plan(own, arrays, steps=8, seed=1)
    found = tuning.verdict(laid, trained(laid, arrays, [[40, 10]] * 3), steplink_weights.shipped().weights)
    assert found.before.false_per_hour == pytest.approx(30 * 180)
    assert found.after.false_per_hour == pytest.approx(10 * 180)
    assert [line[0] for line in tuning.table(found)][1:4] == list(tuning.LINES)


def test_quiet_wearers_make_no_step():
    made = tuning.quiet(3, seed=1)
    assert [one.true_steps for one in made] == [0, 0, 0]
    assert all(np.isfinite(one.acc_g).all() and one.duration_s > 60 for one in made)
    assert not np.array_equal(made[0].acc_g[:100], tuning.quiet(1, seed=2)[0].acc_g[:100])
