"""The network of steplink's counter: is somebody walking, and at what cadence; integers all the way, so exact.

It eats frames of 0.48 s, twelve rows of the front end each, and answers DELAY frames later, having seen what comes
after. Everything is causal:

| layer | from → to | taps, every | rate |
| --- | --- | --- | --- |
| 0 | 5 → 12 | 7, 1 | 25 Hz, then the greater of each two |
| 1 | 12 → 16 | 5, 1 | 12.5 Hz |
| 2, 3 | 16 → 16 | 5, 2 and 4 | added to what went in |
| – | 16 → 32 | mean and greatest of each frame's six | a frame |
| 4 | 32 → 24 | 3, 1 | a frame |
| 5, 6, 7 | 24 → 24 | 3, 2, 4 and 8 | added to what went in |
| 8 | 24 → 2 | 1 | logit of walking, and of the cadence |

Weights are integers of 1/WEIGHT_UNIT, what a layer gives is an integer of 1/UNIT from 0 to LIMIT. No sum passes 2²⁴, so
float32 holds each of them exactly, and neither the order of summing nor the number of frames at once changes a bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from service.counters import steplink_front as front

FRAME_ROWS: Final = 12
"""Rows of the front end in a frame."""
POOLED: Final = FRAME_ROWS // 2
DELAY: Final = 4
"""Frames between a frame and the answer to it."""

WEIGHT_UNIT: Final = 128.0
WEIGHT_LIMIT: Final = 255.0
UNIT: Final = 32.0
LIMIT: Final = 511.0
BIAS_LIMIT: Final = 1_000_000.0

Values = NDArray[np.float32]

_NONE: Final = np.array(0.0, np.float32)
_MOST: Final = np.array(LIMIT, np.float32)
_POOLED: Final = np.array(POOLED, np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A causal convolution: `taps` of its input, `every` values apart."""

    inputs: int
    outputs: int
    taps: int
    every: int
    adds: bool = False
    """Whether its input is added to what it gives."""

    @property
    def reach(self) -> int:
        """Values before the newest that it looks at."""
        return (self.taps - 1) * self.every


WIDE: Final = 16
FRAMED: Final = 24
FIRST: Final = Layer(inputs=front.SENSED, outputs=12, taps=7, every=1)
FAST: Final = (
    Layer(inputs=12, outputs=WIDE, taps=5, every=1),
    Layer(inputs=WIDE, outputs=WIDE, taps=5, every=2, adds=True),
    Layer(inputs=WIDE, outputs=WIDE, taps=5, every=4, adds=True),
)
SLOW: Final = (
    Layer(inputs=2 * WIDE, outputs=FRAMED, taps=3, every=1),
    Layer(inputs=FRAMED, outputs=FRAMED, taps=3, every=2, adds=True),
    Layer(inputs=FRAMED, outputs=FRAMED, taps=3, every=4, adds=True),
    Layer(inputs=FRAMED, outputs=FRAMED, taps=3, every=8, adds=True),
)
LAST: Final = Layer(inputs=FRAMED, outputs=2, taps=1, every=1)
LAYERS: Final = (FIRST, *FAST, *SLOW, LAST)


FRAMED_FROM: Final = 1 + len(FAST)
"""The first layer that sees frames."""


PLACES: Final = (0, *accumulate((layer.taps * layer.inputs + 1) * layer.outputs for layer in LAYERS))
"""Where the weights of each layer begin, and where the last one's end."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Weights of every layer, (taps × inputs) × outputs, oldest tap first, then its biases; layer after layer.

    Integers, divided by the power of two that makes integers of 1/UNIT of what a layer gives: as exact as they were.
    """

    flat: Values

    def kernels(self) -> list[Values]:
        """Return the weights of each layer, the biases as a last row."""
        return [
            self.flat[first:last].reshape(-1, layer.outputs)
            for layer, first, last in zip(LAYERS, PLACES, PLACES[1:], strict=False)
        ]


def weights_of(arrays: Mapping[str, NDArray[np.generic]]) -> Weights:
    """Return the weights of an archive with `kernel0` … and `bias0` …; ValueError where a shape is not the layer's."""
    kernels = []
    for i, layer in enumerate(LAYERS):
        kernel, bias = np.asarray(arrays[f"kernel{i}"]), np.asarray(arrays[f"bias{i}"])
        wanted = (layer.taps * layer.inputs, layer.outputs)
        if kernel.shape != wanted or bias.shape != wanted[1:]:
            raise ValueError(f"layer {i} is {kernel.shape}, {wanted} is wanted")
        kernels.append(np.vstack((kernel, bias)).astype(np.float32).ravel() * np.float32(scale(i)))
    return Weights(np.concatenate(kernels))


def scale(i: int) -> float:
    """Return what makes integers of 1/UNIT of a layer's sums; the last one's stay sums."""
    if i == len(LAYERS) - 1:
        return 1.0
    return UNIT / (front.UNIT * WEIGHT_UNIT) if i == 0 else 1.0 / WEIGHT_UNIT


def values_a_frame(i: int) -> int:
    """Return how many values of each of its inputs layer i sees in a frame."""
    if i >= FRAMED_FROM:
        return 1
    return FRAME_ROWS if i == 0 else POOLED


@dataclass(frozen=True, slots=True, eq=False)
class _Stage:
    """Where a layer computes: views of one memory, made once, so that a frame takes few calls and makes nothing."""

    layer: Layer
    kernel: Values
    new: Values
    """What goes in: as many values as the frames have, × inputs; those before lie before it in memory."""
    seen: Values
    """What each value looks at: × taps × inputs."""
    taps: Values
    """The same, side by side in `columns`, which end with a 1 for the bias."""
    columns: Values
    sums: Values


class Stream:
    """The network along one stream, `frames` at a time, and what each layer remembers of those before."""

    def __init__(self, weights: Weights, frames: int = 1) -> None:
        self.weights, self._frames = weights, frames
        places = layout(frames)
        self.memory = np.zeros(places[-1], weights.flat.dtype)
        """What goes into each layer, after what went in before; see `layout`."""
        self._stages = [
            _stage(i, kernel, self.memory[places[i] : places[i + 1]], frames)
            for i, kernel in enumerate(weights.kernels())
        ]
        self._past = _kept(places[:-1])
        self._moved, self.moves = np.empty_like(self.memory), np.arange(places[-1])
        """What each place of memory holds after a frame: itself, or what has become past."""
        self.moves[self._past] = _kept(
            [end - layer.reach * layer.inputs for end, layer in zip(places[1:], LAYERS, strict=True)]
        )

    @property
    def past(self) -> Values:
        """What each layer remembers, one after the other, oldest value first."""
        return self.memory[self._past]

    @past.setter
    def past(self, values: Values) -> None:
        self.memory[self._past] = values

    def run(self, rows: NDArray[np.float64]) -> Values:
        """Return frames × 2 logits of 1/(UNIT × WEIGHT_UNIT) for (frames × FRAME_ROWS) × SENSED integers."""
        if len(rows) == self._frames * FRAME_ROWS:
            return self._run(rows)
        other = Stream(self.weights, len(rows) // FRAME_ROWS)
        other.past = self.past
        logits = other._run(rows)
        self.past = other.past
        return logits

    def _run(self, rows: NDArray[np.float64]) -> Values:
        stages = self._stages
        stages[0].new[...] = rows
        given = _layer(stages[0])
        np.maximum(given[0::2], given[1::2], out=stages[1].new)
        for i in range(1, FRAMED_FROM - 1):
            _layer(stages[i], stages[i + 1].new)
        given = _layer(stages[FRAMED_FROM - 1]).reshape(-1, POOLED, WIDE)
        mean, most = stages[FRAMED_FROM].new[:, :WIDE], stages[FRAMED_FROM].new[:, WIDE:]
        np.divide(np.add.reduce(given, 1), _POOLED, out=mean)
        np.rint(mean, out=mean)
        np.maximum.reduce(given, 1, out=most)
        for i in range(FRAMED_FROM, len(LAYERS) - 1):
            _layer(stages[i], stages[i + 1].new)
        self.memory.take(self.moves, None, self._moved, "clip")
        self.memory[...] = self._moved
        return _sums(stages[-1]).copy()


def layout(frames: int) -> list[int]:
    """Return where each layer's values begin in a Stream's memory, and where the last one's end."""
    sizes = [(layer.reach + frames * values_a_frame(i)) * layer.inputs for i, layer in enumerate(LAYERS)]
    return [0, *accumulate(sizes)]


def _kept(firsts: Sequence[int]) -> NDArray[np.intp]:
    """Return where as many values stand as each layer remembers, `firsts` being the first of each."""
    return np.concatenate(
        [np.arange(first, first + layer.reach * layer.inputs) for first, layer in zip(firsts, LAYERS, strict=True)]
    )


NOTHING: Final = np.zeros(sum(layer.reach * layer.inputs for layer in LAYERS), np.float32)
"""What a stream remembers before its first frame."""


def _stage(i: int, kernel: Values, memory: Values, frames: int) -> _Stage:
    layer, n = LAYERS[i], frames * values_a_frame(i)
    columns, item = np.ones((n, len(kernel)), kernel.dtype), memory.itemsize
    shape, value = (n, layer.taps, layer.inputs), layer.inputs * item
    return _Stage(
        layer=layer,
        kernel=kernel,
        new=memory.reshape(-1, layer.inputs)[layer.reach :],
        seen=as_strided(memory, shape, (value, layer.every * value, item)),
        taps=as_strided(columns, shape, (columns.strides[0], value, item)),
        columns=columns,
        sums=np.empty((n, layer.outputs), kernel.dtype),
    )


def _layer(stage: _Stage, given: Values | None = None) -> Values:
    """Write what a layer gives to `given`."""
    y = _sums(stage)
    np.rint(y, out=y)
    np.maximum(y, _NONE, out=y)
    if stage.layer.adds:
        np.add(y, stage.new, out=y)
    return np.minimum(y, _MOST, out=y if given is None else given)


def _sums(stage: _Stage) -> Values:
    stage.taps[...] = stage.seen
    return stage.columns.dot(stage.kernel, stage.sums)
