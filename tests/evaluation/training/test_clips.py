"""Clips: what is known of a frame is known of the samples that lie in it, and of a number all of its walk is there."""

import numpy as np
import pytest
from evaluation.training.recorded import material
from hypothesis import given, settings
from hypothesis import strategies as st

from service.counters.steplink_network import DELAY
from service.evaluation.training import clips
from service.evaluation.training.clips import FRAME_S, Sampler, framed, pool

SLOWEST, FASTEST = 0.5, 1.7
"""How much slower and faster a piece may be than it was."""

few = settings(max_examples=25)


def sampler(*of, seed=1):
    return Sampler(of, {pool(one): 1.0 for one in of}, seed=seed)


# Step times to frames


@few
@given(
    gaps=st.lists(st.floats(0.3, 1.5), min_size=1, max_size=60),
    first_s=st.floats(0, 20),
)
def test_the_pace_of_the_frames_sums_up_to_the_steps(gaps, first_s):
    times = first_s + np.cumsum([0.0, *gaps])
    frames = int(times[-1] / FRAME_S) + 2
    share, pace = framed(times, frames)
    assert FRAME_S * pace.sum() == pytest.approx(len(gaps), abs=0.5 + 0.1 * len(gaps))
    assert FRAME_S * share.sum() == pytest.approx(times[-1] - times[0], abs=2 * FRAME_S / 8)


@few
@given(pause_s=st.floats(clips.PAUSE_S + 0.01, 30.0))
def test_a_pause_is_no_walk(pause_s):
    walked = 0.5 * np.arange(11)
    times = np.concatenate((walked, walked + walked[-1] + pause_s))
    share, pace = framed(times, int(times[-1] / FRAME_S) + 2)
    assert FRAME_S * share.sum() == pytest.approx(10.0, abs=4 * FRAME_S / 8)
    assert FRAME_S * pace.sum() == pytest.approx(20.0, abs=1.0)


@pytest.mark.parametrize("times", [[], [3.0]])
def test_a_single_step_is_no_walk(times):
    share, pace = framed(np.array(times), 20)
    assert not share.any()
    assert not pace.any()


# Whole clips: the front end is compiled for these


@pytest.mark.full
@pytest.mark.parametrize("seed", range(3))
def test_frames_of_a_walk_move_and_frames_of_rest_do_not(seed):
    drawn = sampler(material(), material("rest", true_steps=0), seed=seed)
    moving, still = [], []
    for _ in range(8):
        clip = drawn.clip()
        size = clip.rows[..., 0].std(axis=1)
        known = clip.walking_weight > 0
        moving += size[known & (clip.walking == 1.0)].tolist()
        inner = np.convolve(clip.walking > 0, np.ones(5), "same") == 0  # filters ring on for a frame or two
        still += size[known & inner].tolist()
    assert min(len(moving), len(still)) > 100
    assert np.mean(np.array(moving) > 50.0) > 0.95  # but where a stretch was lost
    assert np.mean(np.array(still) < 50.0) > 0.95


@pytest.mark.full
@pytest.mark.parametrize("seed", range(3))
def test_a_timed_walk_has_the_pace_it_was_stretched_to(seed):
    clip = sampler(material(seconds=60.0), seed=seed).clip()
    inside = np.convolve((clip.density_weight > 0) & (clip.walking == 1.0), np.ones(3), "same") == 3  # no piece's end
    assert inside.sum() > 50
    assert clip.density[inside].min() > 2.0 * SLOWEST - 0.1
    assert clip.density[inside].max() < 2.0 * FASTEST + 0.1


@pytest.mark.full
@pytest.mark.parametrize("seed", range(5))
def test_a_span_covers_all_of_a_walk_whose_number_is_known(seed):
    one = material(seconds=20.0, timed=False)
    clip = sampler(one, seed=seed).clip()
    spans = clip.span[clip.number_weight > 0]
    assert 1 <= len(spans) <= clips.SPANS
    assert set(clip.number[clip.number_weight > 0]) == {one.true_steps}
    lengths_s = spans.sum(axis=1) * FRAME_S
    assert (lengths_s >= 20.0 / FASTEST - FRAME_S).all()
    assert (lengths_s <= 20.0 / SLOWEST + 2 * FRAME_S).all()
    assert clip.span.sum(axis=0).max() <= 2.0, "neighbours share a frame at most"
    covered = spans.any(axis=0)
    assert (clip.walking_weight[covered] == 0.0).mean() > 0.9, "which of its frames are walked is not known"


@pytest.mark.full
@pytest.mark.parametrize("seed", range(3))
def test_of_a_long_walk_a_part_counts_its_share(seed):
    one = material(seconds=600.0, timed=False)
    clip = sampler(one, seed=seed).clip()
    told = clip.number_weight > 0
    pace = clip.number[told] / (clip.span[told].sum(axis=1) * FRAME_S)
    assert (pace > 2.0 * SLOWEST * 0.9).all()
    assert (pace < 2.0 * FASTEST * 1.1).all()


@pytest.mark.full
def test_a_clip_ends_with_frames_that_are_for_the_answers_alone():
    clip = sampler(material(), material("rest", true_steps=0)).clip(frames=50)
    assert len(clip.rows) == len(clip.walking) == 50 + DELAY
    assert not clip.walking_weight[50:].any()


@pytest.mark.full
def test_a_seed_gives_the_same_clips():
    made = [sampler(material(), material("rest", true_steps=0), seed=seed).clip() for seed in (4, 4, 5)]
    first, again, other = (clip.rows for clip in made)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_motion_in_doubt_is_a_pool_of_its_own():
    assert [pool(one) for one in (material(), material(true_steps=0), material(true_steps=0, trusted=False))] == [
        "mine/walk",
        "mine/still",
        "mine/doubt",
    ]
