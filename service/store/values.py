"""What goes into the store and comes out of it.

A session is named by its device and the moment it began; nothing outside needs the database's own numbers. A place in a
device's stream is (run, index): `run` counts the device's boots within the session from 0, as a Tracker's
`tally.reboots` does (a device may start again without a new boot number, and boot numbers wrap); `index` is the
sample's, unwrapped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from service.errors import ParameterError
from service.events import StepCounted
from service.samples import TICK_EVERY

SAMPLE_BYTES = 6
"""One sample of one sensor: three i16."""
CHUNK_SAMPLES = 128
"""Most samples of a chunk: its row stays small enough to lie among others, and readers know how far back one begins."""


def stretches(first: int, end: int) -> int:
    """Return how many stretches of TICK_EVERY samples [first, end) touches."""
    return (end - 1) // TICK_EVERY - first // TICK_EVERY + 1


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class SessionKey:
    """Names a session: its device and the host time (UTC, ns) it began at."""

    device: str
    since_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Cursor:
    """The next sample that a count awaits: every one before it is counted or declared lost."""

    run: int
    boot: int
    index: int

    @property
    def place(self) -> tuple[int, int]:
        """What cursors are ordered by."""
        return self.run, self.index


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How a device samples: its nominal rate, and how many units of each sensor's integers make one of ours."""

    rate_hz: float
    lsb_per_g: float
    lsb_per_rad_s: float | None = None
    lsb_per_ut: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Consecutive samples as the device sent them, usually a second's, CHUNK_SAMPLES at most.

    `acc`, `gyro` and `mag` are x, y, z of each sample as little-endian i16. `ticks` has the tick (16 bits) of every
    stretch of TICK_EVERY samples that the chunk touches, None where it is not known. `at_ns` is when it arrived.
    """

    run: int
    boot: int
    index: int
    at_ns: int
    layout: Layout
    ticks: tuple[int | None, ...]
    acc: bytes
    gyro: bytes | None = None
    mag: bytes | None = None

    def __post_init__(self) -> None:
        """Check that every sensor has as many samples, and every stretch its tick or None."""
        n, rest = divmod(len(self.acc), SAMPLE_BYTES)
        others = [len(column) for column in (self.gyro, self.mag) if column is not None]
        if not 1 <= n <= CHUNK_SAMPLES or rest or any(size != len(self.acc) for size in others):
            why = f"1 to {CHUNK_SAMPLES} samples of {SAMPLE_BYTES} bytes, as many of each sensor"
            raise ParameterError("chunk", len(self.acc), why)
        if len(self.ticks) != stretches(self.index, self.end):
            raise ParameterError("ticks", self.ticks, f"one for each of {stretches(self.index, self.end)} stretches")

    def __len__(self) -> int:
        return len(self.acc) // SAMPLE_BYTES

    @property
    def end(self) -> int:
        """Index after the last sample."""
        return self.index + len(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """A value by which the device described itself, and the place in its stream before which it did."""

    run: int
    boot: int
    index: int
    at_ns: int
    characteristic: str
    value: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A durable event that is no step: its kind, and what it tells as plain data."""

    kind: str
    body: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """A durable event with its number among its device's. `run` is that of the sample it belongs to."""

    ordinal: int
    at_ns: int
    uncertainty_s: float
    run: int
    told: StepCounted | Note


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A Tracker's whole state as plain data, before the sample at `cursor`."""

    cursor: Cursor
    at_ns: int
    state: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """What is stored at once or not at all. Storing it again, alone or among others, changes nothing.

    `about` is plain data that a restart needs to build the session again (counters, kind of wearable). `person` owns
    the session; without one it belongs to whom its device is assigned to. `ended_ns` ends it.
    """

    session: SessionKey
    chunks: Sequence[Chunk] = ()
    descriptions: Sequence[Description] = ()
    entries: Sequence[LogEntry] = ()
    cursor: Cursor | None = None
    snapshot: Snapshot | None = None
    about: Mapping[str, Any] | None = None
    person: str | None = None
    ended_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredDevice:
    """A device: its owner, and the numbers of its first and last event still there (0: none)."""

    device: str
    person: str | None
    first_ordinal: int
    last_ordinal: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredSession:
    """A session: what its Batches said of it, and the steps each counter confirmed in it."""

    key: SessionKey
    person: str | None
    ended_ns: int | None
    about: Mapping[str, Any] | None
    cursor: Cursor | None
    steps: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumable:
    """An open session with all that a restart needs beside the raw samples after `snapshot`.

    `last_ordinal` is its device's: the next event has the one after it.
    """

    key: SessionKey
    person: str | None
    about: Mapping[str, Any] | None
    cursor: Cursor | None
    snapshot: Snapshot | None
    last_ordinal: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayPage:
    """What a device sent, in order; `after` is where the next page begins, None at the end."""

    items: Sequence[Chunk | Description]
    after: Cursor | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LogQuery:
    """Which events of a device: numbered after `after`, of a host time in [from_ns, to_ns), of these kinds.

    `kinds` None means all, "step" steps; `counter` only that counter's steps.
    """

    device: str
    after: int = 0
    from_ns: int | None = None
    to_ns: int | None = None
    kinds: frozenset[str] | None = None
    counter: str | None = None
    limit: int = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class LogPage:
    """Events in order of their numbers; `next_after` is the `after` of the page that follows, None at the end."""

    entries: Sequence[LogEntry]
    next_after: int | None
