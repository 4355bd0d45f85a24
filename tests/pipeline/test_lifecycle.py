"""The connection's state machine: what may happen, and that nothing else can."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.pipeline.lifecycle import (
    BACKOFF_CAP_S,
    BACKOFF_FIRST_S,
    LINKED,
    WAITING,
    Cause,
    IllegalMoveError,
    State,
    advance,
    backoff_s,
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


@given(failures=st.integers(1, 10_000), jitter=st.floats(0, 1, exclude_max=True))
def test_the_back_off_is_bounded(failures, jitter):
    assert BACKOFF_FIRST_S / 2 <= backoff_s(failures, jitter) <= BACKOFF_CAP_S


def test_the_back_off_grows_and_is_spread():
    assert [backoff_s(n, 0.999999) for n in (1, 2, 3)] == pytest.approx([0.5, 1.0, 2.0], rel=1e-3)
    assert backoff_s(3, 0.0) == 1.0
