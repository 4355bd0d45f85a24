"""Doubt: what is held is borne out by what lies near it, and neither reordering nor history is taken for a fault."""

from service.samples import RawBlock
from service.tracking.doubt import Doubt


def block(index, n=84, *, boot=1, history=False):
    return RawBlock(boot=boot, index=index, tick=None, history=history, acc_g=([0.0] * n,) * 3)


def judged(*blocks):
    """Indices believed, in order, and the sums of what the verdicts count; `awaited` follows what is believed."""
    doubt, awaited, believed, verdicts = Doubt(), 0, [], []
    for one in blocks:
        verdict = doubt.judge(one, boots=[1], awaited=awaited, rate_hz=50.0)
        believed += [block.index for block in verdict.blocks]
        awaited = max([awaited, *(block.index + len(block) for block in verdict.blocks)])
        verdicts.append(verdict)
    counts = {
        name: sum(getattr(verdict, name) for verdict in verdicts)
        for name in ("refused", "repeated", "overtaken", "restarted")
    }
    return believed, {name: count for name, count in counts.items() if count}


def test_large_packets_that_change_places_are_all_believed():
    assert judged(block(0), block(168), block(84), block(252)) == ([0, 84, 168, 252], {"overtaken": 1})


def test_two_far_ahead_bear_each_other_out_in_either_order():
    assert judged(block(0), block(420), block(336)) == ([0, 336, 420], {"overtaken": 1})
    assert judged(block(0), block(336), block(420)) == ([0, 336, 420], {})


def test_the_same_packet_again_bears_nothing_out():
    assert judged(block(0), block(420), block(420)) == ([0], {"repeated": 1})


def test_one_is_refused_when_five_others_have_come():
    others = [block(index, 10) for index in range(10, 60, 10)]
    assert judged(block(0, 10), block(5000), *others[:4]) == ([0, 10, 20, 30, 40], {})
    assert judged(block(0, 10), block(5000), *others) == ([0, 10, 20, 30, 40, 50], {"refused": 1})


def test_history_is_neither_ahead_nor_of_another_boot_and_leaves_what_is_held():
    far, foreign = block(5000, history=True), block(10, boot=9, history=True)
    assert judged(block(0), far, foreign) == ([0], {"refused": 2})
    assert judged(block(0), block(420), block(0, 10, history=True), block(504)) == ([0, 0, 420, 504], {})


def test_a_restart_takes_longer_than_a_reordering():
    old = [block(index) for index in range(0, 504, 84)]
    assert judged(block(0), *[block(index) for index in range(84, 1008, 84)], *old)[1] == {"restarted": 1}
    assert judged(block(0), *[block(index) for index in range(84, 1008, 84)], *old[:5])[1] == {}
