"""steplink's own counter: what it says of synthetic walks and of other motion; its bits depend on nothing else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from device_sim.gait import Walker
from service.counters import registry, steplink, steplink_weights
from service.counters import steplink_bouts as bouts
from service.counters import steplink_front as front
from service.counters import steplink_network as network
from service.counters import steplink_rhythm as rhythm
from service.errors import ParameterError
from service.samples import GRID_HZ, SampleBlock, Verdict

PACKET = 10


def block(values, start=0):
    return SampleBlock(start=start, acc_g=tuple(column.tolist() for column in np.asarray(values).T))


def told(schedule, *, seed=3):
    """Return the updates of a synthetic walk, packet by packet, its true step times and its length in samples."""
    walker = Walker(schedule, seed=seed)
    n = round(walker.duration_s * GRID_HZ)
    values = walker.read(n)
    counter = steplink.build()
    updates = [counter.update(block(values[i : i + PACKET], i)) for i in range(0, n, PACKET)]
    return [*updates, counter.finish()], walker.step_times_until(walker.duration_s), n


@pytest.fixture(scope="module")
def walk():
    return told("rest:6,normal:20,rest:8")


def test_a_walk_is_counted_and_its_start_is_credited_in_retrospect(walk):
    updates, true_s, _ = walk
    steps = [step for update in updates for step in update.steps]
    assert abs(len(steps) - len(true_s)) <= 2
    first = next(i for i, update in enumerate(updates) if update.steps)
    assert len(updates[first].steps) >= 4
    assert abs(steps[0].at_s - true_s[0]) < 1.0


def test_in_a_walk_a_step_is_certain_within_two_and_a_half_seconds(walk):
    updates, _, _ = walk
    now_s, certain_from = 0.0, None
    for update in updates[:-1]:
        now_s += PACKET / GRID_HZ
        if certain_from is not None:
            for step in update.steps:
                assert now_s - step.at_s <= 2.5 + PACKET / GRID_HZ
        if update.steps and certain_from is None:
            certain_from = now_s
    assert certain_from is not None


def test_in_a_walk_the_count_rises_within_half_a_second_of_a_step(walk):
    updates, _, _ = walk
    first = next(i for i, update in enumerate(updates) if update.steps)
    seen_s = {}
    for i, update in enumerate(updates[:-1]):
        assert update.pending == len(update.likely)
        for at_s, *_ in update.likely:
            seen_s.setdefault(at_s, (i + 1) * PACKET / GRID_HZ)
    later = [step for update in updates[first + 13 :] for step in update.steps]
    assert len(later) >= 20
    late = [seen_s[step.at_s] - step.at_s for step in later if step.at_s in seen_s]
    assert len(late) >= 0.9 * len(later)
    assert np.quantile(late, 0.9) <= 0.5


def test_verdicts_go_from_rest_to_walking_and_back(walk):
    updates, true_s, _ = walk
    verdicts = [update.gait.verdict for update in updates[:-1]]
    changes = [verdicts[0], *(after for before, after in pairwise(verdicts) if after is not before)]
    assert changes[0] is Verdict.REST
    assert changes[-1] is Verdict.REST
    assert changes.count(Verdict.WALKING) == 1
    assert changes[changes.index(Verdict.WALKING) - 1] is Verdict.PERHAPS
    walking = [update.gait for update in updates[:-1] if update.gait.verdict is Verdict.WALKING]
    cadence = 1.0 / np.median(np.diff(true_s))
    assert np.median([gait.cadence_hz for gait in walking]) == pytest.approx(cadence, rel=0.05)
    assert np.median([gait.confidence for gait in walking]) > 0.9
    resting = [update.gait for update in updates[:-1] if update.gait.verdict is Verdict.REST]
    assert all(gait.cadence_hz is None for gait in resting)
    assert np.median([gait.confidence for gait in resting]) < 0.1


@pytest.mark.parametrize("motion", ["type", "sit", "stand", "brush", "gesture", "rest"])
def test_other_motion_is_no_walk(motion):
    updates, _, _ = told(f"rest:3,{motion}:30,rest:3")
    assert sum(len(update.steps) for update in updates) == 0


@pytest.fixture(scope="module")
def rows():
    walker = Walker("rest:3,fast:12,brush:5", seed=8)
    return rows_of(walker.read(round(walker.duration_s * GRID_HZ)))


def rows_of(values):
    n = len(values)
    state, trace, made = front.fresh(), [0.0] * n, [0.0] * ((n // front.EVERY + 1) * front.ROW)
    x, y, z = (column.tolist() for column in np.asarray(values).T)
    front.begin(state, x[0], y[0], z[0])
    count = front.scan(x, y, z, n, state, trace, made)
    return np.array(made[: count * front.ROW]).reshape(count, front.ROW)


def test_frames_alone_and_together_give_the_same_bits(rows):
    sensed = rows[: len(rows) // 12 * 12, : front.SENSED]
    frames = len(sensed) // 12
    together, alone, begun = (network.Stream(steplink_weights.shipped().weights, n) for n in (frames, 1, 1))
    logits = together.run(sensed)
    assert np.array_equal(logits, np.concatenate([alone.run(sensed[12 * i : 12 * i + 12]) for i in range(frames)]))
    assert np.array_equal(logits, np.concatenate([begun.run(sensed[:60]), begun.run(sensed[60:])]))
    assert np.array_equal(together.past, alone.past)
    assert np.array_equal(together.past, begun.past)
    assert np.array_equal(logits, np.rint(logits))


@settings(max_examples=20, deadline=None)
@given(sensed=hnp.arrays(np.float64, (36, front.SENSED), elements=st.sampled_from([-1023.0, 0.0, 1.0, 1023.0])))
def test_no_sum_of_the_network_is_too_large_to_be_exact(sensed):
    weights = steplink_weights.shipped().weights
    exact = network.Weights(weights.flat.astype(np.float64))
    assert np.array_equal(network.Stream(weights, 3).run(sensed), network.Stream(exact, 3).run(sensed))


def test_every_layer_s_largest_sum_fits_float32():
    for layer, kernel, bias in zip(network.LAYERS, *stored(), strict=True):
        largest = front.SENSED_LIMIT if layer is network.FIRST else network.LIMIT
        assert (np.abs(kernel).sum(axis=0) * largest + np.abs(bias)).max() < 2**24


def stored():
    from importlib import resources

    with resources.files("service.counters").joinpath("steplink_weights.npz").open("rb") as file, np.load(file) as kept:
        numbers = range(len(network.LAYERS))
        return [kept[f"kernel{i}"].astype(float) for i in numbers], [kept[f"bias{i}"].astype(float) for i in numbers]


def test_weights_of_another_shape_are_refused():
    kernels, biases = stored()
    arrays = {f"kernel{i}": kernel for i, kernel in enumerate(kernels)}
    arrays |= {f"bias{i}": bias for i, bias in enumerate(biases)}
    arrays["kernel3"] = arrays["kernel3"][:, :-1]
    with pytest.raises(ValueError, match="layer 3"):
        network.weights_of(arrays)


def test_autocorrelation_finds_the_cadence_near_a_rough_one():
    t_s = np.arange(rhythm.WINDOW) / rhythm.ROWS_HZ
    columns = np.rint(100.0 * np.stack([np.sin(2 * np.pi * 1.83 * t_s + phase) for phase in (0.0, 1.0, 2.0, 3.0)]))
    for rough in (1.5, 1.7, 2.1):
        assert rhythm.refined_hz([rough], rhythm.correlations(columns[None]))[0] == pytest.approx(1.83, rel=0.025)
    noise = np.rint(100.0 * np.random.default_rng(1).standard_normal((4, rhythm.WINDOW)))
    assert rhythm.refined_hz([1.7], rhythm.correlations(noise[None]))[0] == 1.7


def test_windows_hold_the_last_rows_however_they_come(rows):
    columns = rows[: len(rows) // 12 * 12, front.SENSED :]
    by_one, together = rhythm.Windows(), rhythm.Windows()
    alone = [by_one.take(columns[i : i + 12])[0].copy() for i in range(0, len(columns), 12)]
    assert np.array_equal(together.take(columns), alone)
    assert np.array_equal(together.past, by_one.past)
    assert np.array_equal(alone[-1], columns[-rhythm.WINDOW :].T)
    assert not alone[0][:, :-12].any()


def test_a_window_of_stillness_has_no_rhythm():
    r = rhythm.correlations(np.full((1, rhythm.COLUMNS, rhythm.WINDOW), 256.0))
    assert not r.any()


def test_more_frames_in_doubt_than_a_pause_allows_end_a_walk():
    s = steplink._fresh_bouts(steplink.TUNED)
    bouts.begin(s, 0.0)
    out = [0.0] * 4000
    at = 0

    def take(z, frames):
        nonlocal at
        rows = 0
        for _ in range(frames):
            s[bouts.NEXT] = float(at + 5 * bouts.FRAME)
            rows = bouts.frame(s, at, bouts.FRAME, z, 2.0, out, rows)
            at += bouts.FRAME
        return rows // bouts.ROW

    assert take(5.0, 10) == 10
    assert take(-5.0, int(s[bouts.POOL])) == 0
    assert s[bouts.WALKING] == 1.0
    assert take(5.0, 5) in {4, 5}
    assert take(-5.0, int(s[bouts.POOL]) + 1) == 0
    assert s[bouts.WALKING] == 0.0


def test_parameters_that_contradict_each_other_are_refused():
    with pytest.raises(ParameterError, match="possible"):
        registry.make("steplink", overrides={"possible": 0.9, "certain": 0.6})


def test_latency_is_what_may_wait():
    assert steplink.build().latency_s <= 14.0
    hasty = registry.make("steplink", overrides={"patience": 4})
    assert hasty.latency_s < steplink.build().latency_s


def test_a_frame_that_waited_too_long_proves_nothing_any_more():
    p = steplink.TUNED
    s = steplink._fresh_bouts(p)
    bouts.begin(s, 0.0)
    out = [0.0] * 4000
    doubtful = 0.5 * (s[bouts.LOW] + s[bouts.HIGH])
    for number in range(200):
        at = number * bouts.FRAME
        s[bouts.NEXT] = float(at + 5 * bouts.FRAME)
        strong = number == 0
        assert bouts.frame(s, at, bouts.FRAME, s[bouts.HIGH] + 0.1 if strong else 0.01 * doubtful, 0.7, out, 0) == 0
        assert s[bouts.WAIT] <= p.patience + 1
    assert s[bouts.TOP] < s[bouts.HIGH]
    assert s[bouts.PROOF] < p.evidence
    assert s[bouts.WALKING] == 0.0


def test_a_step_is_off_by_no_more_than_it_says_at_any_cadence():
    b0, a1, a2 = front.fresh()[front.LOW : front.LOW + 3]
    hz = np.linspace(rhythm.SLOWEST_HZ, rhythm.FASTEST_HZ, 50)
    turn = np.exp(-2j * np.pi * hz / GRID_HZ)
    response = b0 * (1 + 2 * turn + turn**2) / (1 + a1 * turn + a2 * turn**2)
    lag_s = -np.angle(response) / (2 * np.pi * hz)
    off_s = np.abs(lag_s - steplink.FILTER_DELAY / GRID_HZ)
    assert 0.5 * steplink.TIME_ERROR_S < off_s[hz < 3.8].max() <= steplink.TIME_ERROR_S
