"""A device's connection as a state machine: pure, so that every path can be driven by a test.

SEEN ──attempt──> CONNECTING ──connected──> STREAMING
  ▲                  │ failed                  │ dropped
  │                  ▼                         ▼
(first heard)      LOST <──────────────────────┘ ──attempt──> CONNECTING
any state ──unwanted──> DISCONNECTED ──wanted──> LOST (until it is heard)

A device that is known from an earlier run begins as LOST. `Standing` adds what a state alone does not know: how often
it failed in a row, and how long to wait for the next attempt. There is no last attempt.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    **{(state, Cause.WANTED): state for state in State if state is not State.DISCONNECTED},
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long to wait between attempts."""

    first_s: float = 0.5
    cap_s: float = 30.0
    """Longest wait: somebody who comes home should not wait longer."""
    healthy_s: float = 10.0
    """A link that lived so long starts the back-off anew."""

    def wait_s(self, failures: int, jitter: float) -> float:
        """Return the wait after `failures` (≥ 1) in a row; `jitter` in [0, 1) spreads it over half to whole."""
        return min(self.cap_s, self.first_s * 2.0 ** min(failures - 1, 30)) * (0.5 + 0.5 * jitter)


PATIENCE = Patience()


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Where a connection stands. Times are of any clock that only goes forward, in seconds."""

    state: State = State.SEEN
    failures: int = 0
    """In a row; a link that lived long enough ends the row."""
    connected_s: float | None = None
    """When the present link came up; None where there is none."""
    not_before_s: float = 0.0
    """No attempt is made before that."""

    def is_due(self, now_s: float) -> bool:
        """Whether an advertisement should start an attempt."""
        return self.state in WAITING and now_s >= self.not_before_s

    def after(
        self, cause: Cause, *, now_s: float, jitter: float = 0.0, least_s: float = 0.0, patience: Patience = PATIENCE
    ) -> Standing:
        """Return what follows from `cause`; after a failure or a drop no attempt is made for `least_s` at least.

        A wish of a person's, `WANTED` or `UNWANTED`, begins the back-off anew.
        """
        state = advance(self.state, cause)
        match cause:
            case Cause.ATTEMPT:
                return replace(self, state=state, connected_s=None)
            case Cause.CONNECTED:
                return replace(self, state=state, connected_s=now_s)
            case Cause.FAILED | Cause.DROPPED:
                healthy = self.connected_s is not None and now_s - self.connected_s >= patience.healthy_s
                failures = 1 if healthy else self.failures + 1
                wait_s = max(least_s, patience.wait_s(failures, jitter))
                return Standing(state=state, failures=failures, not_before_s=now_s + wait_s)
            case Cause.UNWANTED:
                return Standing(state=state)
            case Cause.WANTED:
                return replace(self, state=state, failures=0, not_before_s=0.0)
