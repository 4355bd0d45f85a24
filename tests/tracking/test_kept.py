"""What is kept behind a hole comes out as it went in: the same samples, and every tick that a fold would heed."""

from hypothesis import given, settings
from hypothesis import strategies as st

from service.samples import TICK_EVERY, DeviceInfo, RawBlock
from service.tracking.holes import Span
from service.tracking.kept import Kept


def block(index, n, *, saturated=(), tick=True):
    column = [float(i) for i in range(index, index + n)]
    told = index // TICK_EVERY if tick else None
    return RawBlock(boot=1, index=index, tick=told, saturated=saturated, acc_g=(column, column, column))


def kept(*blocks, first=0):
    made = Kept(run=0, boot=1, first=first)
    for one in blocks:
        made.add(one)
    return made


def drained(made):
    while (ready := made.ready()) is not None:
        made.counted(ready)
        yield ready


@settings(max_examples=50)
@given(sizes=st.lists(st.integers(1, 84), min_size=1, max_size=30), order=st.randoms())
def test_samples_and_ticks_come_out_in_order(sizes, order):
    pieces, index = [], 0
    for n in sizes:
        pieces.append(block(index, n, saturated=[n - 1]))
        index += n
    order.shuffle(pieces)
    made = kept(*pieces)
    assert (made.samples, made.saturated, made.next_index) == (index, len(sizes), index)
    out = list(drained(made))
    assert [value for one in out for value in one.acc_g[0]] == [float(i) for i in range(index)]
    ends = sorted(piece.index + len(piece) - 1 for piece in pieces)
    assert [one.index + at for one in out for at in one.saturated] == ends
    inside = {piece.tick for piece in pieces if piece.index % TICK_EVERY}
    assert {one.tick for one in out if one.index % TICK_EVERY} == inside
    assert (made.samples, made.saturated) == (0, 0)
    assert max(len(one) for one in out) <= TICK_EVERY + 84


def test_nothing_is_ready_behind_a_hole():
    made = Kept(run=0, boot=1, first=0)
    made.holes.add(Span(first=0, end=10, since=0, from_s=0.0, to_s=0.2))
    made.add(block(10, 10))
    assert made.ready() is None
    made.add(block(0, 5))
    made.holes.fill(0, 5)
    assert [one.index for one in drained(made)] == [0]
    made.lose_all()
    assert [one.index for one in drained(made)] == [10]


def test_what_was_said_stays_between_the_samples_it_came_between():
    made, said = kept(block(0, 10)), DeviceInfo(battery_percent=50)
    made.say(said)
    made.add(block(10, 10))
    assert [one.index for one in drained(made)] == [0, 10]
    assert made.said(9, 0) == []
    assert made.said(10, 0) == [(1, said)]
    assert made.said(10, 1) == []
