"""A trial: several devices carried on one walk, each one's count beside the true one, as Table 4 of Wang 2018.

A device's count is that of its primary's confirmed steps whose host time lies in the trial. A step is confirmed some
seconds after it happened: so a finished trial settles until every device's stream has passed its end by the counter's
latency. Fed by the devices' sessions, it needs no clock. A count is never wrong in silence: whatever may have cost
steps, or have put them on the wrong side of the end, is noted beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from service.errors import NotNowError
from service.events import Counting, Gap, Rebooted, Segmented, StepCounted
from service.pipeline.lifecycle import State as LinkState
from service.pipeline.notices import Notice, StateChanged

TRUE_STEPS_MAX: Final = 100_000
"""A day's walk and more."""

UNSURE_S: Final = 0.25
"""Half a step: where arrivals scatter by more, a step may be on the wrong side of an end."""


class State(StrEnum):
    """Where a trial stands."""

    WALKING = "walking"
    SETTLING = "settling"
    DONE = "done"


class Cause(StrEnum):
    """What moves it on."""

    FINISHED = "finish"
    SETTLED = "settle"


_MOVES: Final = {
    (State.WALKING, Cause.FINISHED): State.SETTLING,
    (State.SETTLING, Cause.SETTLED): State.DONE,
}


def advance(state: State, cause: Cause) -> State:
    """Return the state that `cause` leads to from `state`; NotNowError where it leads nowhere."""
    if (state, cause) not in _MOVES:
        raise NotNowError(f"a trial that is {state.value} cannot {cause.value}")
    return _MOVES[state, cause]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A device as it enters a trial: its counter, and where it is worn, if that was told."""

    device: str
    counter: str
    wrist: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """What a device's count needs to know at the end: its counter's latency, and what else is doubtful."""

    latency_s: float
    remarks: tuple[str, ...] = ()


@dataclass(slots=True)
class _Harm:
    """What may have made a count wrong."""

    gaps: int = 0
    gaps_s: float = 0.0
    filled_s: float = 0.0
    reboots: int = 0
    lost_since_ns: int | None = None
    lost: int = 0
    lost_ns: int = 0
    unsure_s: float = 0.0

    def sentences(self, now_ns: int) -> list[str]:
        lost_ns = self.lost_ns + (now_ns - self.lost_since_ns if self.lost_since_ns is not None else 0)
        said = {
            f"not connected for {lost_ns / 1e9:.1f} s": self.lost,
            f"samples missing for {self.gaps_s:.1f} s, no steps counted there": self.gaps,
            f"{self.filled_s:.2f} s of samples bridged by straight lines": self.filled_s,
            "started again, what was being decided then may be lost": self.reboots,
            f"times known to {self.unsure_s:.1f} s only, steps near either end are uncertain": self.unsure_s > UNSURE_S,
        }
        return [sentence for sentence, happened in said.items() if happened]


class Count:
    """One device's side of a trial, from `began_ns` on."""

    def __init__(self, entry: Entry, began_ns: int) -> None:
        self.entry = entry
        self.steps = 0
        """Confirmed steps in the trial."""
        self.settled = False
        self._began_ns = began_ns
        self._ended_ns: int | None = None
        self._settles_ns = 0
        self._counter = entry.counter
        self._now = 0
        """`steps` and what was pending with them, as last told within the trial."""
        self._harm = _Harm()
        self._remarks: list[str] = []

    @property
    def steps_now(self) -> int:
        """`steps` plus what is likely in the trial; may fall."""
        return self.steps if self.settled else max(self.steps, self._now)

    def note(self, now_ns: int) -> str | None:
        """Return what makes the count doubtful as it stands now; None where nothing does."""
        until_ns = now_ns if self._ended_ns is None else self._ended_ns
        return "; ".join([*self._harm.sentences(until_ns), *self._remarks]) or None

    def take(self, notice: Notice) -> None:
        """Take the next notice of the device's session."""
        if self.settled:
            return
        match notice.event:
            case StepCounted(counter=counter) if counter == self._counter:
                self.steps += self._holds(notice.at_ns)
            case Counting() as counting:
                self._harm.unsure_s = max(self._harm.unsure_s, notice.uncertainty_s)
                self._hear(notice.at_ns, counting.steps_now - counting.steps)
            case Gap() as gap:
                self._note_gap(gap, notice.at_ns)
            case Rebooted():
                self._harm.reboots += 1
            case Segmented(primary=primary):
                self._change_counter(primary)
            case StateChanged(state=state):
                self._follow_link(state, notice.at_ns)
            case _:
                pass

    def finish(self, at_ns: int, end: Finish) -> None:
        """End the trial for this device; its steps are certain by its counter's latency later."""
        self._ended_ns, self._settles_ns = at_ns, at_ns + round(end.latency_s * 1e9)
        self._remarks += end.remarks
        if self._harm.lost_since_ns is not None:
            self._settle_unheard("not connected at the end")

    def _holds(self, at_ns: int) -> bool:
        return self._began_ns <= at_ns and (self._ended_ns is None or at_ns <= self._ended_ns)

    def _hear(self, at_ns: int, pending: int) -> None:
        if self._holds(at_ns):
            self._now = self.steps + pending
        self.settled = self._ended_ns is not None and at_ns >= self._settles_ns

    def _note_gap(self, gap: Gap, at_ns: int) -> None:
        """Note missing samples; after the end too, for they may have decided steps before it."""
        if at_ns <= self._began_ns:
            return
        if gap.filled:
            self._harm.filled_s += gap.to_s - gap.from_s
        else:
            self._harm.gaps += 1
            self._harm.gaps_s += gap.to_s - gap.from_s

    def _change_counter(self, primary: str) -> None:
        what = "its counter's parameters were changed" if primary == self._counter else f"counter changed to {primary}"
        self._remarks.append(f"{what} after {self.steps} steps")
        self._counter = primary
        self.settled = self._ended_ns is not None

    def _follow_link(self, state: LinkState, at_ns: int) -> None:
        harm = self._harm
        if state is LinkState.STREAMING:
            harm.lost_ns += at_ns - harm.lost_since_ns if harm.lost_since_ns is not None else 0
            harm.lost_since_ns = None
        elif self._ended_ns is not None:
            self._settle_unheard(f"{state.value} before the last steps were decided")
        elif harm.lost_since_ns is None:
            harm.lost_since_ns, harm.lost = at_ns, harm.lost + 1

    def _settle_unheard(self, why: str) -> None:
        undecided = max(0, self._now - self.steps)
        self._remarks.append(f"{why}; likely steps left out: {undecided}" if undecided else why)
        self.settled = True


class Trial:
    """The devices' counts, and the true one."""

    def __init__(self, entries: Sequence[Entry], *, number: int, name: str, began_ns: int) -> None:
        self.number = number
        self.name = name
        self.began_ns = began_ns
        self.ended_ns: int | None = None
        self.true_steps: int | None = None
        self.counts = {entry.device: Count(entry, began_ns) for entry in entries}
        self.state = State.WALKING

    def take(self, device: str, notice: Notice) -> None:
        """Take the next notice of a device's session."""
        self.counts[device].take(notice)
        self._settle()

    def finish(self, at_ns: int, devices: Mapping[str, Finish]) -> None:
        """End the walk; NotNowError where it has ended."""
        self.state = advance(self.state, Cause.FINISHED)
        self.ended_ns = at_ns
        for device, count in self.counts.items():
            count.finish(at_ns, devices[device])
        self._settle()

    def error(self, count: Count) -> int | None:
        """Return counted less true steps; None until both are known."""
        if self.true_steps is None or self.state is not State.DONE:
            return None
        return count.steps - self.true_steps

    def accuracy_percent(self, count: Count) -> float | None:
        """Return 100·(1 − |error|/true); None where there is no error, or where no step was true."""
        error = self.error(count)
        return 100 * (1 - abs(error) / self.true_steps) if error is not None and self.true_steps else None

    def _settle(self) -> None:
        if self.state is State.SETTLING and all(count.settled for count in self.counts.values()):
            self.state = advance(self.state, Cause.SETTLED)


def mean(values: Sequence[float | None]) -> float | None:
    """Return the mean; None where there is nothing, or something unknown."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
