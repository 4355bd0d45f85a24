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
from typing import Final

import numpy as np
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

_NONE: Final = np.float32(0.0)
_MOST: Final = np.float32(LIMIT)
_POOLED: Final = np.float32(POOLED)


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


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Weights of every layer, (taps × inputs) × outputs, oldest tap first, and its biases.

    Integers, divided by the power of two that makes integers of 1/UNIT of what a layer gives: as exact as they were.
    """

    kernels: Sequence[Values]
    biases: Sequence[Values]


def weights_of(arrays: Mapping[str, NDArray[np.generic]]) -> Weights:
    """Return the weights of an archive with `kernel0` … and `bias0` …; ValueError where a shape is not the layer's."""
    kernels, biases = [], []
    for i, layer in enumerate(LAYERS):
        kernel, bias = np.asarray(arrays[f"kernel{i}"]), np.asarray(arrays[f"bias{i}"])
        wanted = (layer.taps * layer.inputs, layer.outputs)
        if kernel.shape != wanted or bias.shape != wanted[1:]:
            raise ValueError(f"layer {i} is {kernel.shape}, {wanted} is wanted")
        unit = np.float32(scale(i))
        kernels.append(np.ascontiguousarray(kernel, dtype=np.float32) * unit)
        biases.append(np.ascontiguousarray(bias, dtype=np.float32) * unit)
    return Weights(kernels, biases)


def scale(i: int) -> float:
    """Return what makes integers of 1/UNIT of a layer's sums; the last one's stay sums."""
    if i == len(LAYERS) - 1:
        return 1.0
    return UNIT / (front.UNIT * WEIGHT_UNIT) if i == 0 else 1.0 / WEIGHT_UNIT


def fresh_past() -> list[Values]:
    """Return what each layer but the last remembers before the first frame: nothing."""
    return [np.zeros((layer.reach, layer.inputs), np.float32) for layer in LAYERS[:-1]]


def run(weights: Weights, rows: Values, past: list[Values]) -> Values:
    """Return frames × 2 logits of 1/(UNIT × WEIGHT_UNIT) for frames × FRAME_ROWS × SENSED integers; `past` goes on."""
    frames = len(rows)
    x = _layer(weights, 0, rows.reshape(frames * FRAME_ROWS, front.SENSED), past)
    x = np.maximum(x[0::2], x[1::2])
    for i in range(1, 1 + len(FAST)):
        x = _layer(weights, i, x, past)
    x = x.reshape(frames, POOLED, WIDE)
    x = np.concatenate((np.rint(x.sum(axis=1) / _POOLED), x.max(axis=1)), axis=1)
    for i in range(1 + len(FAST), len(LAYERS) - 1):
        x = _layer(weights, i, x, past)
    z: Values = x @ weights.kernels[-1] + weights.biases[-1]
    return z


def _layer(weights: Weights, i: int, x: Values, past: list[Values]) -> Values:
    layer = LAYERS[i]
    whole = np.concatenate((past[i], x))
    n = len(x)
    seen = [whole[tap * layer.every : tap * layer.every + n] for tap in range(layer.taps)]
    past[i] = whole[n:]
    y: Values = np.concatenate(seen, axis=1) @ weights.kernels[i]
    y += weights.biases[i]
    np.rint(y, out=y)
    np.maximum(y, _NONE, out=y)
    if layer.adds:
        y += x
    np.minimum(y, _MOST, out=y)
    return y
