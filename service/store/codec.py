"""Values as the database holds them: ticks, sensor columns and plain data as bytes, rows as log entries.

Raw samples are kept as they are, six bytes each: 7.5 with all that the file needs beside them, and a day is read in a
fraction of the time that unpacking takes.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, Final

from service.events import Heading, StepCounted
from service.samples import TICK_EVERY, Step
from service.store.values import SAMPLE_BYTES, Chunk, LogEntry, Note, stretches

STEP: Final = "step"
"""Kind of a log entry that is a step."""
LOG_COLUMNS: Final = (
    "ordinal, at_ns, uncertainty_s, run, kind, body, "
    "boot, steps, at_s, strength, interval_s, peak, valley, upper, lower, "
    "step_uncertainty_s, heading_deg, heading_uncertainty_deg, heading_is_line, counters.name"
)
"""What `entry` takes, of the log joined with the counters."""
_ZLIB_LEVEL = 1
"""A snapshot of 5 kB shrinks to a third at any level; this one takes 0.1 ms."""


def pack_ticks(ticks: Sequence[int | None]) -> bytes:
    """Return ticks as two bytes each; none at all as nothing; four each where only some are known."""
    known = [tick for tick in ticks if tick is not None]
    if not known:
        return b""
    if len(known) == len(ticks):
        return struct.pack(f"<{len(known)}H", *known)
    return struct.pack(f"<{len(ticks)}i", *(-1 if tick is None else tick for tick in ticks))


def unpack_ticks(data: bytes, n: int) -> tuple[int | None, ...]:
    """Return the n ticks that `pack_ticks` packed."""
    if not data:
        return (None,) * n
    if len(data) == 2 * n:
        return struct.unpack(f"<{n}H", data)
    return tuple(None if tick < 0 else tick for tick in struct.unpack(f"<{n}i", data))


def pack_state(state: Mapping[str, Any]) -> bytes:
    """Return plain data as compressed JSON; floats come back bit for bit."""
    return zlib.compress(to_json(state).encode(), _ZLIB_LEVEL)


def unpack_state(data: bytes) -> dict[str, Any]:
    """Return what `pack_state` packed."""
    state: dict[str, Any] = json.loads(zlib.decompress(data))
    return state


def to_json(value: Mapping[str, Any]) -> str:
    """Return plain data as JSON, short."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


def entry(row: Sequence[Any]) -> LogEntry:
    """Return a row of LOG_COLUMNS as a log entry."""
    ordinal, at_ns, uncertainty_s, run, kind, body, *step_row = row
    told = _step(*step_row) if kind == STEP else Note(kind=kind, body=json.loads(body))
    return LogEntry(ordinal=ordinal, at_ns=at_ns, uncertainty_s=uncertainty_s, run=run, told=told)


def _step(boot: int, steps: int, at_s: float, strength: float | None, *rest: Any) -> StepCounted:  # noqa: ANN401
    interval_s, peak, valley, upper, lower, uncertainty_s, deg, uncertainty_deg, is_line, counter = rest
    step = Step(
        at_s=at_s,
        strength=math.nan if strength is None else strength,  # SQLite has no NaN
        interval_s=interval_s,
        peak=peak,
        valley=valley,
        upper=upper,
        lower=lower,
    )
    heading = None
    if deg is not None:
        heading = Heading(deg=deg, uncertainty_deg=uncertainty_deg, is_line=bool(is_line))
    return StepCounted(counter=counter, boot=boot, steps=steps, step=step, uncertainty_s=uncertainty_s, heading=heading)


def cut(chunk: Chunk, first: int, end: int) -> Chunk:
    """Return the samples [first, end) of a chunk that holds them."""
    skipped = first // TICK_EVERY - chunk.index // TICK_EVERY
    span = slice(SAMPLE_BYTES * (first - chunk.index), SAMPLE_BYTES * (end - chunk.index))
    return Chunk(
        run=chunk.run,
        boot=chunk.boot,
        index=first,
        at_ns=chunk.at_ns,
        layout=chunk.layout,
        ticks=chunk.ticks[skipped : skipped + stretches(first, end)],
        acc=chunk.acc[span],
        gyro=chunk.gyro and chunk.gyro[span],
        mag=chunk.mag and chunk.mag[span],
    )


def parted(chunk: Chunk, place: int) -> Sequence[Chunk]:
    """Return a chunk in two where it holds samples before and after `place`."""
    if not chunk.index < place < chunk.end:
        return (chunk,)
    return cut(chunk, chunk.index, place), cut(chunk, place, chunk.end)


def columns(chunk: Chunk) -> tuple[bytes | None, bytes | None, bytes | None]:
    """Return a chunk's sensors in the order of their numbers in the database."""
    return chunk.acc, chunk.gyro, chunk.mag
