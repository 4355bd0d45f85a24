"""Clips to learn from: recordings one after the other, changed by `motion`, with what is known of each frame.

A clip is CLIP_FRAMES long. A recording of which only the number of steps is known goes in whole; of any other a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_front as front
from service.counters.steplink_network import DELAY, FRAME_ROWS
from service.evaluation.training import motion
from service.evaluation.training.material import SYNTHETIC, Material
from service.samples import GRID_HZ
from service.signals.compiled import compiled

Floats = NDArray[np.float64]
Rng = np.random.Generator

FRAME: Final = FRAME_ROWS * front.EVERY
"""Grid samples a frame."""
FRAME_S: Final = FRAME / GRID_HZ
CLIP_FRAMES: Final = 250
"""Two minutes."""
CLIP: Final = CLIP_FRAMES * FRAME
SPANS: Final = 4
"""Recordings of known number in one clip."""
SHORT_SHARE: Final = 0.12
"""Pieces of walks with known step times that are a few steps and then a stand."""
SWUNG_SHARE: Final = 0.5
"""Of the same at the body, those that are hung on an arm."""
DOUBTED: Final = 0.4
"""Weight of a truth that is approximate."""
SMOOTH_SHARE: Final = 0.15
"""Clips whose roughness is made less, or nothing."""
PAUSE_S: Final = 1.6
"""Steps farther apart are of two walks."""
HALF_CLIP: Final = CLIP // 2
WHOLE_S: Final = 115.0
"""A recording of known number is no longer: of longer ones a part goes in."""


@dataclass(slots=True, kw_only=True)
class Clip:
    """What the network sees (`rows`, frames × FRAME_ROWS × SENSED integers) and what is known of each frame.

    `walking`, the share of a frame that lies in a walk, with its weight (0: unknown), `density` in steps a second with
    its weight, and of up to SPANS spans the frames, number of steps and weight. The network's answer to a frame comes
    DELAY frames later.
    """

    rows: NDArray[np.float32]
    walking: NDArray[np.float32]
    walking_weight: NDArray[np.float32]
    density: NDArray[np.float32]
    density_weight: NDArray[np.float32]
    span: NDArray[np.float32]
    number: NDArray[np.float32]
    number_weight: NDArray[np.float32]


def rows_of(acc_g: Floats, frames: int) -> NDArray[np.float32]:
    """Return what the front end makes of acceleration: `frames` frames of it, stillness after its end."""
    n = len(acc_g)
    state, trace, rows = np.array(front.fresh()), np.empty(n), np.empty((n // front.EVERY + 1) * front.ROW)
    x, y, z = (np.ascontiguousarray(acc_g[:, axis]) for axis in range(3))
    compiled(front.begin)(state, x[0], y[0], z[0])
    made = compiled(front.scan)(x, y, z, n, state, trace, rows)
    sensed = rows[: made * front.ROW].reshape(made, front.ROW)[:, : front.SENSED]
    out = np.zeros((frames * FRAME_ROWS, front.SENSED), dtype=np.float32)
    out[: min(made, len(out))] = sensed[: len(out)]
    return out.reshape(frames, FRAME_ROWS, front.SENSED)


@dataclass(slots=True)
class _Label:
    """Truth of the samples of a clip under way."""

    length: int
    acc: list[Floats] = field(default_factory=list)
    samples: int = 0
    step_s: list[Floats] = field(default_factory=list)
    known: list[tuple[int, int, float]] = field(default_factory=list)
    """From, to, weight: where each frame's truth is known."""
    spans: list[tuple[int, int, float, float]] = field(default_factory=list)

    def left(self) -> int:
        return self.length - self.samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Piece:
    """What goes into a clip of a recording; `short`: a few steps, after which one stands."""

    acc_g: Floats
    weight: float
    step_s: Floats = field(default_factory=lambda: np.empty(0))
    number: float = 0.0
    short: bool = False


class Sampler:
    """Draws clips: sources by weight, recordings within a source evenly."""

    def __init__(self, material: Sequence[Material], weights: dict[str, float], *, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.pools: dict[str, list[Material]] = {}
        for one in material:
            self.pools.setdefault(pool(one), []).append(one)
        self.names = [name for name in self.pools if weights.get(name, 0.0) > 0.0]
        shares = np.array([weights[name] for name in self.names])
        self.shares = shares / shares.sum()

    def clip(self, frames: int = CLIP_FRAMES) -> Clip:
        """Return one clip of pieces drawn by weight, until it is full."""
        made = _Label(frames * FRAME)
        while made.left() > 3 * GRID_HZ:
            name = self.names[int(self.rng.choice(len(self.names), p=self.shares))]
            one = self.pools[name][int(self.rng.integers(len(self.pools[name])))]
            self._add(made, one)
        return self._finished(made, frames)

    def _add(self, made: _Label, one: Material) -> None:
        """Add a recording, or a part of it, at another pace and strength, as another sensor has it."""
        factor, strength = motion.pace(self.rng)
        counted = one.step_s is None and one.true_steps > 0
        piece = self._whole(made, one, factor) if counted else self._cut(made, one, factor)
        if piece is None:
            self._stand(made, made.left())
            return
        acc_g, step_s = piece.acc_g, piece.step_s
        if one.step_s is not None and one.source != SYNTHETIC and not one.at_wrist and self.rng.random() < SWUNG_SHARE:
            acc_g = motion.with_arm_swing(acc_g, step_s, self.rng)
        if not one.true_steps and self.rng.random() < 0.5:
            strength *= float(np.exp(self.rng.uniform(np.log(0.5), np.log(1.8))))
        if strength != 1.0:
            acc_g = motion.strengthened(acc_g, strength)
        if factor != 1.0:
            acc_g, step_s = motion.stretched(acc_g, factor), step_s / factor
        first = made.samples
        self._join(made, motion.as_sensed(acc_g[: made.left()], self.rng))
        if counted:
            made.spans.append((first, made.samples, piece.number, piece.weight))
        else:
            made.known.append((first, made.samples, piece.weight))
            made.step_s.append(step_s + first / GRID_HZ)
        if piece.short:
            self._stand(made, round(self.rng.uniform(2.0, 7.0) * GRID_HZ))

    def _whole(self, made: _Label, one: Material, factor: float) -> _Piece | None:
        """Return a walk of which only the number is known, or a part of a long one; None where it has no room."""
        weight = 1.0 if one.trusted else DOUBTED
        if len(one.acc_g) > WHOLE_S * GRID_HZ and made.left() > HALF_CLIP:
            n = min(round(made.left() * factor), len(one.acc_g))
            begin = int(self.rng.integers(len(one.acc_g) - n + 1))
            number = one.true_steps * n / len(one.acc_g)  # the pace is taken to be even
            return _Piece(acc_g=one.acc_g[begin : begin + n], number=number, weight=DOUBTED)
        if len(one.acc_g) / factor > made.left() or len(made.spans) >= SPANS:
            return None
        return _Piece(acc_g=one.acc_g, number=float(one.true_steps), weight=weight)

    def _cut(self, made: _Label, one: Material, factor: float) -> _Piece:
        """Return a part of a recording whose step times are known, or that has no step."""
        rng = self.rng
        weight = 1.0 if one.trusted else DOUBTED
        short = one.step_s is not None and rng.random() < SHORT_SHARE
        wanted_s = rng.uniform(2.5, 8.0) if short else rng.uniform(15.0, 100.0)
        longest = round(min(made.left(), wanted_s * GRID_HZ) * factor)
        acc_g, step_s = one.acc_g, np.empty(0) if one.step_s is None else one.step_s
        if len(acc_g) > longest:
            begin = int(rng.integers(len(acc_g) - longest + 1))
            acc_g = acc_g[begin : begin + longest]
            inside = (step_s >= begin / GRID_HZ) & (step_s < (begin + longest) / GRID_HZ)
            step_s = step_s[inside] - begin / GRID_HZ
        return _Piece(acc_g=acc_g, step_s=step_s, weight=weight, short=short)

    def _stand(self, made: _Label, samples: int) -> None:
        """Stand still for a while, turned as the last samples were."""
        n = min(samples, made.left())
        direction = self.rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        if made.acc:
            direction = made.acc[-1][-25:].mean(axis=0)
            direction = direction / max(float(np.linalg.norm(direction)), 0.3)
        made.known.append((made.samples, made.samples + n, 1.0))
        self._join(made, direction + 0.01 * self.rng.standard_normal((n, 3)), turn=False)

    def _join(self, made: _Label, acc_g: Floats, *, turn: bool = True) -> None:
        """Add samples behind the others, turned at random, or so that gravity goes on as it was."""
        if turn:
            acc_g = acc_g @ motion.rotation(self.rng)
            if made.acc and self.rng.random() < 0.6:
                acc_g = acc_g @ motion.turn_onto(acc_g[:50].mean(axis=0), made.acc[-1][-50:].mean(axis=0))
        made.acc.append(acc_g)
        made.samples += len(acc_g)

    def _finished(self, made: _Label, frames: int) -> Clip:
        acc_g = np.concatenate(made.acc)
        if self.rng.random() < 0.15:
            acc_g = _frozen(acc_g, self.rng)
        total = frames + DELAY
        walking, weight = np.zeros(total, np.float32), np.zeros(total, np.float32)
        density, dense = np.zeros(total, np.float32), np.zeros(total, np.float32)
        steps = np.concatenate(made.step_s) if made.step_s else np.empty(0)
        share, pace = framed(steps, frames)
        for first, last, w in made.known:
            a, b = -(-first // FRAME), last // FRAME
            weight[a:b] = w
            walking[a:b] = share[a:b]
            density[a:b] = pace[a:b]
            dense[a:b] = w * (share[a:b] > 0.0)
        span, number, counted = np.zeros((SPANS, total), np.float32), np.zeros(SPANS, np.float32), np.zeros(SPANS)
        for k, (first, last, true, w) in enumerate(made.spans[:SPANS]):
            span[k, first // FRAME : -(-last // FRAME)] = 1.0
            number[k], counted[k] = true, w
        weight[frames:] = 0.0
        rows = rows_of(acc_g, total)
        if self.rng.random() < SMOOTH_SHARE:
            rows[:, :, front.ROUGHNESS] *= self.rng.random() < 0.5 and self.rng.random()
        return Clip(
            rows=rows,
            walking=walking,
            walking_weight=weight,
            density=density,
            density_weight=dense,
            span=span,
            number=number,
            number_weight=counted.astype(np.float32),
        )


def _frozen(acc_g: Floats, rng: Rng) -> Floats:
    """Return it with stretches of up to 0.6 s bridged by straight lines, as the timebase does for lost packets."""
    out = acc_g.copy()
    for _ in range(int(rng.integers(1, 20))):
        n = int(rng.integers(5, 30))
        a = int(rng.integers(max(len(out) - n, 1)))
        b = min(a + n, len(out) - 1)
        out[a : b + 1] = np.linspace(out[a], out[b], b - a + 1)
    return out


def framed(step_s: Floats, frames: int) -> tuple[Floats, Floats]:
    """Return of each frame how much of it lies in a walk, and its steps a second."""
    t_s = (np.arange(frames * 8) + 0.5) * FRAME_S / 8
    if len(step_s) < 2:
        return np.zeros(frames), np.zeros(frames)
    gaps = np.diff(step_s)
    near = np.clip(np.searchsorted(step_s, t_s) - 1, 0, len(gaps) - 1)
    gap = gaps[near]
    inside = (t_s >= step_s[0]) & (t_s < step_s[-1]) & (gap < PAUSE_S)
    pace = np.where(inside, 1.0 / np.maximum(gap, 0.2), 0.0)
    share = inside.astype(np.float64)
    return share.reshape(frames, 8).mean(axis=1), pace.reshape(frames, 8).mean(axis=1)


def pool(one: Material) -> str:
    """Return the pool a recording is drawn from: its source, walks and their absence apart."""
    return f"{one.source}/{'walk' if one.true_steps else 'still' if one.trusted else 'doubt'}"
