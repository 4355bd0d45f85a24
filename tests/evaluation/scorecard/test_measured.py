"""One recording, counted plainly and disturbed; what cannot be counted says why."""

import pytest
from evaluation.made import save, still, walk

from service.evaluation.choices import Found, choices
from service.evaluation.scorecard import wire
from service.evaluation.scorecard.disturbances import DISTURBANCES
from service.evaluation.scorecard.measured import measure

CHOSEN = choices(["double_threshold", "fusion"], "tuned", [])


def measured(path, recording, chosen=CHOSEN, **more):
    file = Found(shown="shown", path=save(recording, path, **more), dataset="d")
    return measure(file, chosen, 32.0)


@pytest.mark.full
def test_a_walk_is_counted_plainly_and_in_every_disturbance(tmp_path):
    first, second = measured(
        tmp_path / "a.npz", walk(30, 100), placement="wrist", subject="s", gt_quality="B", steps_min=50, steps_max=70
    )
    assert (first.steps, first.true_steps, first.within, first.subject) == (60, 60, (50, 70), "s")
    assert (first.matches.f1, first.name) == (1.0, "d/a")
    asked = {each.name for each in DISTURBANCES} | {wire.ONCE, wire.TWICE, *map(wire.loss_name, wire.LOSSES_PERCENT)}
    assert set(first.disturbed) == asked
    assert first.disturbed["25 Hz"] == pytest.approx(60, abs=2)
    assert set(second.disturbed) == {each.name for each in DISTURBANCES}  # packets hold acceleration alone
    outcome = first.outcome(57)
    assert (outcome.counted, outcome.true, outcome.placement, outcome.quality) == (57, 60, "wrist", "B")


def test_a_short_walk_is_not_disturbed(tmp_path):
    assert measured(tmp_path / "a.npz", walk(10), CHOSEN[:1])[0].disturbed == {}
    assert measured(tmp_path / "a.npz", walk(10, true_steps=None, step_t_s=None), CHOSEN[:1])[0].disturbed == {}


@pytest.mark.full
def test_a_rest_is_disturbed(tmp_path):
    rest = measured(tmp_path / "a.npz", still(3))[0]
    assert (rest.steps, rest.disturbed[wire.TWICE]) == (0, 0)


def test_what_cannot_be_counted_is_told_and_ends_nothing(tmp_path):
    walked, lacking = measured(tmp_path / "a.npz", walk(10, gyro_rad_s=None, mag_ut=None))
    assert walked.steps == 20
    assert "gyroscope" in lacking.error
    (tmp_path / "b.npz").write_bytes(b"PK no zip")
    rows = measure(Found(shown="b", path=tmp_path / "b.npz", dataset="d"), CHOSEN, 32.0)
    assert [row.steps for row in rows] == [None, None]
    assert all("no numpy archive" in row.error for row in rows)
