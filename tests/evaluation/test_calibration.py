"""What counters learn before they count: from each recording's middle, or from a walk, by their own functions."""

import pytest
from evaluation.made import save, still, walk

from service.cli import main
from service.counters import registry
from service.counters.double_threshold import middle_window, sampled_window
from service.counters.gyro_zero_crossing import calibrated
from service.errors import CounterError, ParameterError
from service.evaluation.calibration import from_middle, from_walk, taught
from service.evaluation.choices import Found, choices
from service.evaluation.counting import grid_block
from service.evaluation.run import rows_of

BOTH = ["double_threshold", "gyro_zero_crossing"]


def params(choice):
    return registry.parameters(choice.counter, choice.preset, choice.overrides)


@pytest.mark.parametrize("step_hz", [1.4, 2.3])
def test_the_middle_teaches_what_the_papers_mode_gives(step_hz):
    block = grid_block(walk(30, step_hz=step_hz))
    (asked,) = from_middle(choices(["double_threshold"], "tuned", ["double_threshold.bout=3"]))
    choice = taught(asked, block)
    assert choice.overrides["first_window"] == middle_window(block, params(asked)) == round(50 / step_hz)
    assert choice.overrides["window_mode"] == "fixed"
    assert choice.overrides["bout"] == "3"
    assert choice.calibration.startswith("middle: ")


@pytest.mark.parametrize("made", [still(30), walk(3)], ids=["rest", "short"])
def test_without_a_walk_in_the_middle_parameters_stay(made):
    (asked,) = from_middle(choices(["double_threshold"], "tuned", []))
    assert taught(asked, grid_block(made)) is asked


def test_a_walk_teaches_each_counter_in_its_own_way():
    block = grid_block(walk(30, step_hz=1.2))
    window, swing, other = from_walk(choices([*BOTH, "plus_minus"], "paper", []), block, "walk.csv")
    plain = {name: registry.parameters(name, "paper") for name in BOTH}
    assert params(window).first_window == sampled_window(block, plain["double_threshold"])
    assert params(swing) == calibrated(block, plain["gyro_zero_crossing"])
    assert (other.overrides, other.calibration) == ({}, None)
    assert taught(window, grid_block(still(30))) is window


def test_who_cannot_learn_is_told():
    with pytest.raises(ParameterError, match="plus_minus cannot learn so"):
        from_middle(choices(["plus_minus"], "tuned", []))
    with pytest.raises(ParameterError, match="gyro_zero_crossing cannot learn so"):
        from_middle(choices(["gyro_zero_crossing"], "tuned", []))
    with pytest.raises(ParameterError, match="no walk was found"):
        from_walk(choices(["double_threshold"], "tuned", []), grid_block(still(30)), "still.csv")
    with pytest.raises(CounterError, match="gyro"):
        from_walk(choices(BOTH, "tuned", []), grid_block(walk(30, gyro_rad_s=None)), "walk.csv")


def test_rows_say_what_was_learnt_and_where_nothing_was(tmp_path):
    chosen = from_middle(choices(["double_threshold", "plus_minus"], "tuned", []))
    paths = [save(walk(30, step_hz=1.4), tmp_path / "walk.npz"), save(still(30), tmp_path / "rest.npz")]
    (walked, other), (rested, _) = (rows_of(Found(shown=p.name, path=p, dataset="d"), chosen, 32.0) for p in paths)
    assert walked.as_json()["params"]["first_window"] == 36
    assert "(0.71 s) a step" in walked.as_json()["calibration"]
    assert (rested.as_json()["calibration"], rested.as_json()["params"]["window_mode"]) == (None, "moving")
    assert (walked.uncalibrated, other.uncalibrated, rested.uncalibrated) == (False, False, True)
    assert walked.changed == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--calibrate", "still.npz", "--counter", "double_threshold"], "no walk was found"),
        (["--calibrate", "middle"], "steplink cannot learn"),
        (["--calibrate", "absent.npz"], "absent.npz"),
        (["--calibrate", "middle", "--counter", "plus_minus"], "cannot learn"),
        (["--calibrate", "middle", "--paper", "wang2018"], "say themselves"),
    ],
)
def test_what_cannot_be_learnt_is_one_line_before_any_count(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    save(still(30), tmp_path / "still.npz")
    assert main(["evaluate", "still.npz", *words]) == 2
    told = capsys.readouterr()
    assert said in told.err
    assert told.err.count("\n") == 1
    assert told.out == ""
