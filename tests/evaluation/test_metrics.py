"""Metrics by hand, and as properties over any counts and times."""

import doctest
import functools
import statistics

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from service.evaluation import metrics
from service.evaluation.metrics import Matches, Score, accuracy_percent, error_percent, match, metronome_s, summarise

times = st.lists(st.integers(0, 2000), max_size=12, unique=True).map(lambda ks: np.array(sorted(ks)) / 100)
"""Rising times in hundredths of a second."""


def test_the_examples_of_the_docstrings_hold():
    failed, tried = doctest.testmod(metrics)
    assert tried > 8
    assert failed == 0


@pytest.mark.parametrize(
    ("counted", "true", "accuracy"),
    [(52, 52, 100), (101, 100, 99), (283, 281, 99.29), (0, 10, 0), (30, 10, -100)],
)
def test_accuracy_is_the_papers(counted, true, accuracy):
    assert accuracy_percent(counted, true) == pytest.approx(accuracy, abs=0.01)
    assert error_percent(counted, true) == pytest.approx(100 - accuracy, abs=0.01)


def test_the_offset_is_removed_before_matching():
    true_s = np.arange(20) * 0.55
    assert match(true_s + 0.2, true_s) == Matches(tp=20, fp=0, fn=0)
    assert match(true_s - 0.24, true_s) == Matches(tp=20, fp=0, fn=0)


def test_half_a_step_off_is_an_offset_too():
    true_s = np.arange(20) * 0.5
    assert match(true_s[:-1] + 0.25, true_s) == Matches(tp=19, fp=0, fn=1)


def test_a_step_counted_twice_is_true_once():
    true_s = np.array([1.0, 2.0, 3.0])
    counted_s = np.array([0.95, 1.0, 2.0, 3.0, 3.05])
    assert match(counted_s, true_s) == Matches(tp=3, fp=2, fn=0)


def test_the_tolerance_is_inclusive_and_no_wider():
    true_s = np.array([1.0, 2.0, 3.0, 4.0])
    assert match(np.array([1.0, 2.0, 3.125, 4.0]), true_s, 0.125).tp == 4
    assert match(np.array([1.0, 2.0, 3.126, 4.0]), true_s, 0.125).tp == 3
    assert match(np.array([1.0, 2.0, 3.149, 4.0]), true_s).tp == 4
    assert match(np.array([1.0, 2.0, 3.151, 4.0]), true_s).tp == 3


def test_nothing_counted_or_nothing_true():
    none, some = np.empty(0), np.array([1.0, 2.0])
    assert match(none, some) == Matches(tp=0, fp=0, fn=2)
    assert match(some, none) == Matches(tp=0, fp=2, fn=0)
    assert match(none, none) == Matches(tp=0, fp=0, fn=0)
    assert match(np.array([5.0]), np.array([1.0])) == Matches(tp=1, fp=0, fn=0)


def most_pairs(counted, true, tolerance):
    """The most pairs, by trying everything."""

    @functools.cache
    def best(i, used):
        if i == len(counted):
            return 0
        free = [j for j in range(len(true)) if not used >> j & 1 and abs(counted[i] - true[j]) <= tolerance]
        return max([best(i + 1, used), *(1 + best(i + 1, used | 1 << j) for j in free)])

    return best(0, 0)


@given(times.map(lambda t: t[:7]), times.map(lambda t: t[:7]), st.sampled_from([0.155, 1.005, 4.005]))
def test_no_matching_finds_more_pairs(counted_s, true_s, tolerance_s):
    shifted_s = counted_s - metrics.median_offset_s(counted_s, true_s)
    found = match(counted_s, true_s, tolerance_s)
    assert found.tp == most_pairs(tuple(shifted_s), tuple(true_s), tolerance_s)
    assert (found.tp + found.fp, found.tp + found.fn) == (len(counted_s), len(true_s))


@given(times.filter(len), times.filter(len))
def test_the_offset_is_the_lower_median_of_the_nearest(counted_s, true_s):
    nearest_s = [min((c - t for t in true_s), key=abs) for c in counted_s]
    pairs = zip(counted_s, nearest_s, strict=True)
    assume(all(sum(abs(abs(c - t) - abs(n)) < 1e-9 for t in true_s) == 1 for c, n in pairs))
    assert metrics.median_offset_s(counted_s, true_s) == statistics.median_low(nearest_s)


@given(times)
def test_the_truth_itself_is_perfect(true_s):
    found = match(true_s, true_s)
    assert (found.fp, found.fn) == (0, 0)
    assert found.f1 == (1.0 if len(true_s) else None)


@given(st.integers(0, 30), times)
def test_a_metronome_keeps_the_number_and_the_span(steps, true_s):
    ticks_s = metronome_s(steps, true_s)
    assert len(ticks_s) == (steps if len(true_s) else 0)
    if len(ticks_s) > 1:
        assert (ticks_s[0], ticks_s[-1]) == (true_s[0], true_s[-1])
        assert np.diff(ticks_s) == pytest.approx((true_s[-1] - true_s[0]) / (steps - 1))


def test_a_metronome_misses_a_walk_with_pauses():
    true_s = np.concatenate([np.arange(20) * 0.5, 60 + np.arange(20) * 0.5])
    assert match(true_s, true_s).f1 == 1
    assert match(metronome_s(40, true_s), true_s).f1 < 0.5


def test_precision_recall_and_f1():
    found = Matches(tp=6, fp=2, fn=4)
    assert (found.precision, found.recall) == (0.75, 0.6)
    assert found.f1 == pytest.approx(2 * 0.75 * 0.6 / 1.35)
    empty = Matches(tp=0, fp=0, fn=0)
    assert (empty.precision, empty.recall, empty.f1) == (None, None, None)


def test_a_summary_by_hand():
    matched, blind = Matches(tp=80, fp=10, fn=20), Matches(tp=45, fp=45, fn=55)
    together = summarise(
        [
            Score(counted=90, true=100, duration_s=60, matches=matched, blind=blind),
            Score(counted=330, true=300, duration_s=240),
            Score(counted=4, true=0, duration_s=900),
            Score(counted=2, true=0, duration_s=900),
            Score(counted=1000, true=None, duration_s=1500),
        ]
    )
    assert (together.recordings, together.hours) == (5, 1.0)
    assert (together.true, together.counted, together.error) == (400, 420, 20)
    assert (together.false, together.untold) == (6, 1000)
    assert (together.accuracy, together.mape) == (90, 10)
    assert together.pooled_accuracy == 90
    assert together.bias == 5
    assert together.false_per_hour == 12
    assert together.precision == pytest.approx(80 / 90)
    assert together.recall == 0.8
    assert together.f1 == pytest.approx(160 / 190)
    assert together.blind_f1 == pytest.approx(90 / 190)


def test_a_summary_of_nothing_has_no_figures():
    empty = summarise([])
    assert (empty.recordings, empty.hours) == (0, 0)
    assert {empty.true, empty.counted, empty.error, empty.false, empty.untold} == {None}
    assert {empty.accuracy, empty.mape, empty.bias, empty.false_per_hour, empty.f1, empty.blind_f1} == {None}


@given(st.lists(st.tuples(st.integers(0, 500), st.integers(1, 500)), min_size=1, max_size=8))
def test_bias_is_within_the_error_and_a_perfect_count_has_none(counts):
    found = summarise(Score(counted=counted, true=true, duration_s=1) for counted, true in counts)
    assert found.bias == pytest.approx(100 * found.error / found.true)
    assert abs(found.bias) <= 100 - found.pooled_accuracy + 1e-9
    assert found.accuracy == pytest.approx(100 - found.mape)
    assert (found.mape == 0) == all(counted == true for counted, true in counts)


@given(st.lists(st.tuples(st.integers(0, 500), st.none() | st.integers(0, 500)), max_size=8))
def test_every_counted_step_is_in_one_column(counts):
    found = summarise(Score(counted=counted, true=true, duration_s=1) for counted, true in counts)
    assert sum(n or 0 for n in (found.counted, found.false, found.untold)) == sum(counted for counted, _ in counts)
