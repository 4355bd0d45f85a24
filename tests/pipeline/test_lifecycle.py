"""The connection's state machine: what may happen, that nothing else can, and how long it waits in between."""

from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.pipeline.lifecycle import (
    LINKED,
    PATIENCE,
    WAITING,
    Cause,
    IllegalMoveError,
    Patience,
    Standing,
    State,
    advance,
)


def path(*causes, start=State.SEEN):
    state = start
    for cause in causes:
        state = advance(state, cause)
    return state


def test_the_usual_paths():
    assert path(Cause.ATTEMPT, Cause.CONNECTED) is State.STREAMING
    assert path(Cause.ATTEMPT, Cause.FAILED) is State.LOST
    assert path(Cause.ATTEMPT, Cause.CONNECTED, Cause.DROPPED, Cause.ATTEMPT) is State.CONNECTING
    assert path(Cause.UNWANTED) is State.DISCONNECTED
    assert path(Cause.ATTEMPT, Cause.CONNECTED, Cause.UNWANTED, Cause.WANTED) is State.LOST


@given(st.lists(st.sampled_from(Cause), max_size=30))
def test_any_causes_lead_to_a_state_or_are_refused_by_name(causes):
    state = State.SEEN
    for cause in causes:
        try:
            state = advance(state, cause)
        except IllegalMoveError as error:
            assert cause.value in str(error)
            assert state.value in str(error)
    assert (state in LINKED) + (state in WAITING) + (state is State.DISCONNECTED) == 1


def test_an_unwanted_device_is_not_attempted():
    with pytest.raises(IllegalMoveError):
        path(Cause.UNWANTED, Cause.ATTEMPT)


LEGAL = {
    (State.SEEN, Cause.ATTEMPT): State.CONNECTING,
    (State.LOST, Cause.ATTEMPT): State.CONNECTING,
    (State.CONNECTING, Cause.CONNECTED): State.STREAMING,
    (State.CONNECTING, Cause.FAILED): State.LOST,
    (State.STREAMING, Cause.DROPPED): State.LOST,
    (State.DISCONNECTED, Cause.WANTED): State.LOST,
}
"""What moves a connection on, beside the wishes that every state takes."""


@pytest.mark.parametrize(("state", "cause"), list(product(State, Cause)))
def test_every_state_and_cause(state, cause):
    if cause is Cause.UNWANTED:
        expected = State.DISCONNECTED
    elif cause is Cause.WANTED and state is not State.DISCONNECTED:
        expected = state
    else:
        expected = LEGAL.get((state, cause))
    if expected is None:
        with pytest.raises(IllegalMoveError):
            advance(state, cause)
    else:
        assert advance(state, cause) is expected


def test_every_state_is_reached_and_left():
    reached = {state for moves in product(Cause, repeat=3) for state in states(moves)}
    assert reached == set(State)
    assert all(any(cause in legal(state) for cause in Cause) for state in State)


def states(causes):
    state = State.SEEN
    for cause in causes:
        if cause in legal(state):
            state = advance(state, cause)
        yield state


def legal(state):
    """The causes that the state takes."""
    taken = [Cause.WANTED, Cause.UNWANTED]
    return taken + [cause for before, cause in LEGAL if before is state and cause not in taken]


@given(failures=st.integers(1, 10_000), jitter=st.floats(0, 1, exclude_max=True))
def test_the_back_off_is_bounded(failures, jitter):
    assert PATIENCE.first_s / 2 <= PATIENCE.wait_s(failures, jitter) <= PATIENCE.cap_s


def test_the_back_off_grows_and_is_spread():
    assert [PATIENCE.wait_s(n, 0.999999) for n in (1, 2, 3)] == pytest.approx([0.5, 1.0, 2.0], rel=1e-3)
    assert PATIENCE.wait_s(3, 0.0) == 1.0
    assert PATIENCE.wait_s(30, 0.999999) == pytest.approx(30, rel=1e-3)


@settings(max_examples=40)
@given(st.data())
def test_any_life_waits_as_it_should(data):
    """Any legal causes at any times: the wait is bounded, grows with failures in a row, and health ends the row."""
    standing, now_s, row, up_s = Standing(), 0.0, 0, None
    for _ in range(data.draw(st.integers(1, 40))):
        now_s += data.draw(st.sampled_from([0.01, 1.0, 9.99, 10.0, 100.0]))
        cause = data.draw(st.sampled_from(legal(standing.state)))
        jitter = data.draw(st.floats(0, 1, exclude_max=True))
        standing = standing.after(cause, now_s=now_s, jitter=jitter)
        if cause in {Cause.FAILED, Cause.DROPPED}:
            row = 1 if up_s is not None and now_s - up_s >= PATIENCE.healthy_s else row + 1
            wait_s = standing.not_before_s - now_s
            whole_s = min(PATIENCE.cap_s, PATIENCE.first_s * 2 ** (row - 1))
            assert whole_s / 2 - 1e-6 <= wait_s <= whole_s
            assert not standing.is_due(now_s)
            assert standing.is_due(standing.not_before_s)
        elif cause in {Cause.WANTED, Cause.UNWANTED}:
            row = 0
            assert standing.is_due(now_s) is (standing.state in WAITING)
        up_s = now_s if cause is Cause.CONNECTED else up_s if standing.state is State.STREAMING else None
        assert standing.failures == row
        assert standing.state in WAITING or not standing.is_due(now_s + 1e9)
        assert (standing.connected_s is not None) is (standing.state is State.STREAMING)


def test_a_fault_that_will_not_pass_soon_waits_longer():
    standing = Standing(state=State.CONNECTING).after(Cause.FAILED, now_s=5.0, least_s=300.0)
    assert standing.not_before_s == 305.0


def test_patience_is_a_parameter():
    quick = Patience(first_s=0.1, cap_s=0.4, healthy_s=1.0)
    standing = Standing(state=State.STREAMING, failures=9, connected_s=0.0)
    assert standing.after(Cause.DROPPED, now_s=0.9, jitter=0.0, patience=quick).not_before_s == pytest.approx(1.1)
    assert standing.after(Cause.DROPPED, now_s=1.0, jitter=0.0, patience=quick).failures == 1
