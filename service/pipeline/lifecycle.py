"""A device's connection as a state machine: pure, so that every path can be driven by a test.

SEEN ──wanted──> CONNECTING ──connected──> STREAMING
  ▲                  │ failed                  │ dropped
  │                  ▼                         ▼
(first heard)      LOST <──────────────────────┘ ──attempt──> CONNECTING
any state ──unwanted──> DISCONNECTED ──wanted──> LOST (until it is heard)
"""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """Where a device's connection stands."""

    SEEN = "seen"
    CONNECTING = "connecting"
    STREAMING = "streaming"
    LOST = "lost"
    DISCONNECTED = "disconnected"


class Cause(StrEnum):
    """What moves it on."""

    ATTEMPT = "attempt"
    CONNECTED = "connected"
    FAILED = "failed"
    DROPPED = "dropped"
    UNWANTED = "unwanted"
    WANTED = "wanted"


LINKED = frozenset({State.CONNECTING, State.STREAMING})
"""A link object exists."""
WAITING = frozenset({State.SEEN, State.LOST})
"""An advertisement may start an attempt."""

_MOVES: dict[tuple[State, Cause], State] = {
    (State.SEEN, Cause.ATTEMPT): State.CONNECTING,
    (State.LOST, Cause.ATTEMPT): State.CONNECTING,
    (State.CONNECTING, Cause.CONNECTED): State.STREAMING,
    (State.CONNECTING, Cause.FAILED): State.LOST,
    (State.STREAMING, Cause.DROPPED): State.LOST,
    (State.DISCONNECTED, Cause.WANTED): State.LOST,
    **{(state, Cause.UNWANTED): State.DISCONNECTED for state in State},
}


class IllegalMoveError(RuntimeError):
    """A cause that cannot happen in a state: a fault of the caller's."""

    def __init__(self, state: State, cause: Cause) -> None:
        super().__init__(f"{cause.value} cannot happen to a device that is {state.value}")
        self.state = state
        self.cause = cause


def advance(state: State, cause: Cause) -> State:
    """Return the state that `cause` leads to from `state`."""
    try:
        return _MOVES[state, cause]
    except KeyError:
        raise IllegalMoveError(state, cause) from None


BACKOFF_FIRST_S = 0.5
BACKOFF_CAP_S = 30.0
"""Longest wait between attempts: somebody who comes home should not wait longer."""
HEALTHY_S = 10.0
"""A link that lived so long starts the back-off anew."""


def backoff_s(failures: int, jitter: float) -> float:
    """Return the wait after `failures` failures in a row (≥ 1); `jitter` in [0, 1) spreads it over half to whole."""
    return float(min(BACKOFF_CAP_S, BACKOFF_FIRST_S * 2.0 ** min(failures - 1, 10)) * (0.5 + 0.5 * jitter))
