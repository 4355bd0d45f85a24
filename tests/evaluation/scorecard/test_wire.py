"""Packets re-sent change nothing; packets lost are single and as many as they should be."""

import numpy as np
import pytest
from evaluation.made import walk

from service.evaluation.choices import choices
from service.evaluation.counting import count
from service.evaluation.scorecard import wire
from service.evaluation.scorecard.sampled import sampled

CHOSEN = choices(["double_threshold", "gyro_zero_crossing"], "tuned", [])
LIVE = sampled(walk(30, 50))


def test_packets_sent_once_or_again_give_the_count_of_the_recording():
    counts = wire.counts(LIVE, CHOSEN, 1)
    plain = count(walk(30, 50), "double_threshold").steps
    assert counts[wire.ONCE] == counts[wire.TWICE] == {"double_threshold": plain}
    assert plain == 60
    assert set(counts) == {wire.ONCE, wire.TWICE, *map(wire.loss_name, wire.LOSSES_PERCENT)}


def test_a_counter_that_needs_more_than_acceleration_is_left_out():
    assert wire.counts(LIVE, CHOSEN[1:], 1) == {}


def test_what_is_sent_again_comes_late_and_out_of_order():
    sent = wire.packets(LIVE)
    again = list(wire.again(sent[:8]))
    assert again[:7] == [*sent[:4], *sent[1:4]]
    assert len(again) == 8 + 2 * wire.RESENT


def test_single_packets_are_lost_as_many_as_told():
    sent = range(20_000)
    for percent in wire.LOSSES_PERCENT:
        kept, again, other = (wire.without(sent, percent, seed) for seed in (7, 7, 8))
        lost = np.setdiff1d(sent, kept)
        assert len(lost) / len(sent) == pytest.approx(percent / 100, rel=0.15)
        assert np.diff(lost).min() > 1
        assert kept == again != other
