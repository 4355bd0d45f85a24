"""What the figures are drawn from: a piece of a real recording where one was given, else a synthetic walker."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.errors import SteplinkError
from service.evaluation.choices import Found
from service.evaluation.counting import grid_block
from service.evaluation.papers.conditions import Condition, do, walk
from service.evaluation.papers.people import STAND_S, block
from service.recordings import Recording, read
from service.samples import GRID_HZ, Columns, SampleBlock

Floats = NDArray[np.float64]

SHOWN_S: Final = 10.0
"""500 samples, as in the figures of 2018."""
RUN: Final = r"run|jog"
WALK: Final = r"walk(?!_slow|_run|.*(stairs|steps)).*"
REST: Final = r"rest|not_moving"
PEOPLE: Final = 10
SENSED: Final = 6
"""Walks that the fusion counter is watched on, half a second each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A piece of signal and where it is from; `true_steps` are those of the whole of it."""

    name: str
    signal: SampleBlock
    true_steps: int

    @property
    def acc_g(self) -> Floats:
        """Acceleration, n×3 in g."""
        return np.column_stack([np.asarray(column) for column in self.signal.acc_g])

    @property
    def norm_g(self) -> Floats:
        """Norm of the acceleration."""
        norm: Floats = np.sqrt((self.acc_g**2).sum(axis=1))
        return norm

    @property
    def has_all(self) -> bool:
        """Tell whether all three sensors measured it."""
        return self.signal.gyro_rad_s is not None and self.signal.mag_ut is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pool:
    """The largest norm of every step of several walks or runs, in g; `pieces` is how many those are."""

    maxima_g: Floats
    pieces: int
    synthetic: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """A walk, a run and a rest to draw, and what takes more than one recording.

    `pocket` is a walk with the phone in the trouser pocket, which nobody recorded; `sensed` are walks with all three
    sensors, up to SENSED; `walks` and `runs` pool every recorded walk and run.
    """

    walk: Source
    run: Source
    rest: Source
    pocket: Source
    sensed: tuple[Source, ...]
    walks: Pool
    runs: Pool


def sources(found: Sequence[Found], lsb_per_g: float) -> Sources:
    """Take the first recording of each kind, else a walker; pool the step maxima of all walks, and of all runs."""
    recorded = {"walk": WALK, "run": RUN, "rest": REST}
    seen: dict[str, Source] = {}
    sensed: list[Source] = []
    maxima_g: dict[str, list[Floats]] = {"walk": [], "run": []}
    for file in found:
        for kind, source in _kinds(file, lsb_per_g, recorded):
            seen.setdefault(kind, source)
            if kind == "walk" and source.has_all and len(sensed) < SENSED:
                sensed.append(source)
            if kind in maxima_g:
                maxima_g[kind].append(step_maxima_g(source))
    made = _synthetic() | seen
    return Sources(
        walk=made["walk"],
        run=made["run"],
        rest=made["rest"],
        pocket=made["pocket"],
        sensed=tuple(sensed) or (made["sensed"],),
        walks=_pool("walk", maxima_g["walk"]),
        runs=_pool("run", maxima_g["run"]),
    )


def step_maxima_g(source: Source) -> Floats:
    """Return the largest norm of each of as many equal parts as there are true steps, in g."""
    parts = np.array_split(source.norm_g, max(source.true_steps, 1))
    return np.array([part.max() for part in parts if len(part)])


def _pool(kind: str, parts: Sequence[Floats]) -> Pool:
    """Pool what was recorded, else ten people's hundred steps: the 1,000 of 2015."""
    made = parts or list(_people(kind))
    return Pool(maxima_g=np.concatenate(made), pieces=len(made), synthetic=not parts)


def _people(kind: str) -> Iterable[Floats]:
    condition = _CONDITIONS[kind]
    for k in range(PEOPLE):
        signal = _walked(condition, k)
        yield step_maxima_g(Source(name=condition.label, signal=signal, true_steps=condition.steps))


def _kinds(file: Found, lsb_per_g: float, recorded: dict[str, str]) -> list[tuple[str, Source]]:
    try:
        recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping, rate_hz=file.rate_hz)
        kinds = [kind for kind, pattern in recorded.items() if _is(recording, kind, pattern)]
        return [(kind, _source(f"{file.dataset}/{file.path.name}", recording)) for kind in kinds]
    except SteplinkError:
        return []


def _is(recording: Recording, kind: str, pattern: str) -> bool:
    moves = bool(recording.true_steps)
    return moves is (kind != "rest") and re.fullmatch(pattern, recording.activity or "") is not None


def _source(name: str, recording: Recording) -> Source:
    return Source(name=name, signal=grid_block(recording), true_steps=recording.true_steps or 0)


_CONDITIONS: Final = {
    "walk": Condition(label="synthetic walk", parts=(walk("normal", 100),)),
    "run": Condition(label="synthetic run", parts=(walk("run", 100),)),
    "rest": Condition(label="synthetic rest", parts=(do("rest", 30),)),
    "pocket": Condition(label="synthetic walk, phone in the trouser pocket", parts=(walk("slow", 40),), pose="pocket"),
    "sensed": Condition(label="synthetic walk, phone in the hand", parts=(walk("slow", 60),), pose="flat"),
}


def _synthetic() -> dict[str, Source]:
    return {kind: Source(name=of.label, signal=_walked(of), true_steps=of.steps) for kind, of in _CONDITIONS.items()}


def _walked(condition: Condition, k: int = 0) -> SampleBlock:
    """Return person k's walk without the standing before and after it."""
    whole = block(condition, k)
    stand = round(STAND_S * GRID_HZ)
    return cut(whole, stand, len(whole) - stand)


def cut(signal: SampleBlock, first: int, last: int) -> SampleBlock:
    """Return samples `first` up to `last`, at their own times."""

    def part(columns: Columns | None) -> Columns | None:
        if columns is None:
            return None
        x, y, z = (np.asarray(column)[first:last] for column in columns)
        return x, y, z

    acc_g = part(signal.acc_g)
    assert acc_g is not None  # noqa: S101  # every block has it
    return SampleBlock(
        start=signal.start + first, acc_g=acc_g, gyro_rad_s=part(signal.gyro_rad_s), mag_ut=part(signal.mag_ut)
    )


def middle(source: Source, length_s: float = SHOWN_S) -> slice:
    """Return the samples of the middle `length_s` seconds, or all."""
    n, wanted = len(source.signal), round(length_s * GRID_HZ)
    first = max(0, (n - wanted) // 2)
    return slice(first, min(n, first + wanted))


def times_s(part: slice) -> Floats:
    """Return the times of a part's samples, in seconds after the first of their source."""
    at: Floats = np.arange(part.start, part.stop) / GRID_HZ
    return at
