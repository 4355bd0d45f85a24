"""How fast the counters are, beside two yardsticks of the same run: machines differ, ratios hardly.

All on one core, the best of RUNS (live, of LIVE_RUNS for each stretch of packets), numba's compilation excluded, 50 Hz
columns of float64 in memory. The signal is a synthetic walk. `offline` counts all of it at once, `fast` with numba and
`plain` without; `live` counts packets of ten samples, plain as a lone session is, and `a hundred sessions` by turns,
with numba where it is there, as a service with many devices does. The yardsticks are `find_peaks`, what a textbook does
with scipy, and `minimal loop`, the same job as one loop of numba that keeps nothing but the number. Chen 2015 prints
what its three counters took for 5,000 samples, in MATLAB at 2.27 GHz. `with reading and resampling` reads a recording
of all sensors at 100 Hz and puts it on the grid first; beside that the counters hardly differ.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from service.counters import registry, steplink, steplink_fast, steplink_weights
from service.counters.contract import RecordingCounter, StepCounter
from service.evaluation import yardsticks
from service.evaluation.counting import grid_block, pieces, streamed
from service.recordings import read
from service.samples import GRID_HZ, Packet, SampleBlock
from service.signals.compiled import available, compiled
from service.tracking.tracker import Tracker
from service.wearables.bracelet import Bracelet

RUNS: Final = 5

SAMPLES: Final = 24 * 3600 * GRID_HZ
"""A day."""

PLAIN_SAMPLES: Final = 50_000
"""Plain Python needs no day to show its speed."""

FILE_SHARE: Final = 6
"""The recording that is read and resampled is a sixth of the signal, at twice its rate."""

PACKET_SAMPLES: Final = 10

LIVE_FROM: Final = 300
LIVE_PACKETS: Final = 800
"""Packets that are timed, after the first minute: a counter has locked by then, and all of them are plain walking."""

LIVE_RUNS: Final = 10
STRETCH: Final = 100
"""Packets timed at once."""

SESSIONS: Final = 100
SESSION_PACKETS: Final = 240
"""Packets of each of the sessions that are counted by turns: a round of them takes more than the caches hold."""
ROUNDS: Final = 12
"""After so many packets of ten samples a counter does the same again: five frames of 24."""

PAPER_SAMPLES: Final = 5000
PAPER_S: Final = {"adaptive_peak": 0.036, "conventional_peak": 0.046, "autocorrelation": 0.131}

WITHOUT_NUMBA: Final = "numba is missing, so there are no `fast` figures: pip install 'steplink[fast]'"

Work = Callable[[], object]
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measured value; units are `samples/s` of the 50 Hz grid, `us/packet` of ten samples, `ms` and `ratio`."""

    name: str
    value: float
    unit: str


def figures(counters: Sequence[str], samples: int = SAMPLES) -> Iterator[Figure]:
    """Measure one figure after the other over a signal of `samples`; without numba, those that need it are left out."""
    block = yardsticks.walk(samples)
    yield from _offline(counters, block)
    for name in counters:
        yield _plain(name, block)
        yield _live(f"{name} live", partial(registry.make, name), block)
        if name in PAPER_S:
            yield _paper(name, block)
        if name == steplink.NAME:
            yield Figure(name="model load", value=1e3 * best_s(steplink_weights.unpacked), unit="ms")
            yield _sessions(name, block)
    yield _live_packets()
    if available():
        yield from _from_file(counters, yardsticks.head(block, samples // FILE_SHARE))


def _offline(counters: Sequence[str], block: SampleBlock) -> Iterator[Figure]:
    """Measure yardsticks and counters by turns, so that a machine that slows down slows all of them."""
    sos = yardsticks.band()
    works: dict[str, Work] = {"find_peaks": partial(yardsticks.textbook, block, sos)}
    if available():
        works["minimal loop"] = partial(compiled(yardsticks.minimal), *block.acc_g, sos)
    peers = list(works)
    if available():
        works |= {name: partial(_count_fast, name, block) for name in counters}
    best = best_of_each_s(works)
    for peer in peers:
        yield _speed(peer, len(block), best[peer])
    for name in counters if available() else ():
        yield _speed(f"{name} offline fast", len(block), best[name])
        for peer in peers:
            yield _ratio(f"{name} offline fast / {peer}", best[peer], best[name])


def best_of_each_s(works: Mapping[str, Work]) -> dict[str, float]:
    """Return the shortest of RUNS of each in seconds, taken by turns, after one that compiles and fills the caches."""
    for work in works.values():
        work()
    runs = [{name: _seconds(work) for name, work in works.items()} for _ in range(RUNS)]
    return {name: min(run[name] for run in runs) for name in works}


def best_s(work: Work) -> float:
    """Return the shortest of RUNS in seconds, after one that compiles and fills the caches."""
    return best_of_each_s({"": work})[""]


def _seconds(work: Work) -> float:
    began_s = time.perf_counter()
    work()
    return time.perf_counter() - began_s


def _speed(name: str, samples: int, took_s: float) -> Figure:
    return Figure(name=name, value=samples / took_s, unit="samples/s")


def _ratio(name: str, theirs_s: float, ours_s: float) -> Figure:
    return Figure(name=name, value=theirs_s / ours_s, unit="ratio")


def _count_fast(name: str, block: SampleBlock) -> object:
    counter = registry.make(name)
    return counter.count(block) if isinstance(counter, RecordingCounter) else streamed(counter, [block])


def _count_plain(name: str, parts: Iterable[SampleBlock]) -> object:
    return streamed(registry.make(name), parts)


def _plain(name: str, block: SampleBlock) -> Figure:
    part = yardsticks.head(block, PLAIN_SAMPLES)
    return _speed(f"{name} offline plain", len(part), best_s(partial(_count_plain, name, pieces(part))))


def _paper(name: str, block: SampleBlock) -> Figure:
    """Compare with the time that Chen 2015 prints."""
    part = yardsticks.head(block, PAPER_SAMPLES)
    work = partial(_count_fast, name, part) if available() else partial(_count_plain, name, pieces(part))
    return _ratio(f"{name} 5,000 samples / Chen 2015", PAPER_S[name], best_s(work) * PAPER_SAMPLES / len(part))


def _live(name: str, make: Callable[[], StepCounter], block: SampleBlock) -> Figure:
    parts = pieces(yardsticks.head(block, (LIVE_FROM + LIVE_PACKETS) * PACKET_SAMPLES), PACKET_SAMPLES)
    return _per_packet(name, parts, lambda: make().update)


def _sessions(name: str, block: SampleBlock) -> Figure:
    """Count SESSIONS by turns, compiled where numba is there, as a service with so many devices does."""
    parts = pieces(yardsticks.head(block, (LIVE_FROM + SESSION_PACKETS) * PACKET_SAMPLES), PACKET_SAMPLES)
    sessions = [registry.make(name) for _ in range(SESSIONS)]

    def all_take(part: SampleBlock) -> None:
        for session in sessions:
            session.update(part)

    with steplink_fast.compiled_live():
        for part in parts[:LIVE_FROM]:
            all_take(part)
        rounds_s = [_seconds_of(all_take, [part]) for part in parts[LIVE_FROM:]]
    best = [min(rounds_s[first::ROUNDS]) for first in range(min(ROUNDS, len(rounds_s)))]
    took_s = sum(best) / len(best) / SESSIONS
    return Figure(name=f"{name} live a hundred sessions", value=took_s * 1e6, unit="us/packet")


def _live_packets() -> Figure:
    """Take a packet's whole way: codec, timebase, default counter."""
    made = list(yardsticks.packets((LIVE_FROM + LIVE_PACKETS) * PACKET_SAMPLES, PACKET_SAMPLES))
    name = registry.DEFAULT

    def make() -> Callable[[Packet], object]:
        return Tracker(Bracelet(), {name: partial(registry.make, name)}, primary=name).apply

    return _per_packet(f"{name} live from bytes", made, make)


def _per_packet(name: str, items: Sequence[Item], make: Callable[[], Callable[[Item], object]]) -> Figure:
    """Time what `make` makes over the items from LIVE_FROM on, the ones before having gone through it.

    A stretch of STRETCH packets takes a millisecond, and counts as its best of LIVE_RUNS: other work on the machine
    hits one of them or another, but hardly the same in every run.
    """
    first = min(LIVE_FROM, len(items) // 2)
    stretches = [items[begin : begin + STRETCH] for begin in range(first, len(items), STRETCH)]

    def run_s() -> list[float]:
        take = make()
        for item in items[:first]:
            take(item)
        return [_seconds_of(take, stretch) for stretch in stretches]

    runs = [run_s() for _ in range(LIVE_RUNS)]
    took_s = sum(min(times) for times in zip(*runs, strict=True))
    return Figure(name=name, value=took_s / (len(items) - first) * 1e6, unit="us/packet")


def _seconds_of(take: Callable[[Item], object], items: Sequence[Item]) -> float:
    began_s = time.perf_counter()
    for item in items:
        take(item)
    return time.perf_counter() - began_s


def _from_file(counters: Sequence[str], block: SampleBlock) -> Iterator[Figure]:
    """Read a recording of all sensors, put it on the grid and count it; how many grid samples a second that makes."""
    rate_hz = 2 * GRID_HZ
    acc_g, gyro, mag = (
        np.repeat(np.column_stack([np.asarray(column) for column in columns or ()]), 2, axis=0)
        for columns in (block.acc_g, block.gyro_rad_s, block.mag_ut)
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.npz"
        np.savez(path, t=np.arange(len(acc_g)) / rate_hz, acc=acc_g, gyro=np.degrees(gyro), mag=mag, rate_hz=rate_hz)
        for name in counters:
            took_s = best_s(partial(_count_file, name, path))
            yield _speed(f"{name} offline fast with reading and resampling", len(block), took_s)


def _count_file(name: str, path: Path) -> object:
    return _count_fast(name, grid_block(read(path)))
