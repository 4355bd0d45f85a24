"""The network of `service.counters.steplink_network` in JAX, to be fitted: the same layers, rounded the same way.

Rounding passes gradients through as if it were not there. With `exact` the weights and everything between layers are
the integers that the counter will compute with; without, the same network in plain floats, which is easier to begin
with.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_front as front
from service.counters.steplink_network import (
    BIAS_LIMIT,
    DELAY,
    FAST,
    LAYERS,
    LIMIT,
    POOLED,
    SLOW,
    UNIT,
    WEIGHT_LIMIT,
    WEIGHT_UNIT,
    WIDE,
    Layer,
)
from service.counters.steplink_rhythm import SLOWEST_HZ, SPAN_HZ
from service.evaluation.training.clips import FRAME_S

Array = Any
Params = dict[str, Array]

DROPPED: Final = 0.1
"""Share of what a frame's layers see that is left out while learning."""


def fresh(seed: int) -> Params:
    """Return random weights (He), in plain units."""
    rng = np.random.default_rng(seed)
    params = {}
    for i, layer in enumerate(LAYERS):
        fan = layer.taps * layer.inputs
        size = np.sqrt((1.0 if i == len(LAYERS) - 1 else 2.0) / fan) * (0.5 if layer.adds else 1.0)
        params[f"kernel{i}"] = jnp.asarray(size * rng.standard_normal((fan, layer.outputs)), jnp.float32)
        params[f"bias{i}"] = jnp.zeros(layer.outputs, jnp.float32)
    return params


def answers(params: Params, rows: Array, *, exact: bool, key: Array | None = None) -> tuple[Array, Array]:
    """Return logit of walking and cadence in Hz, batch × frames, for batch × frames × rows × sensed integers.

    The answer to a frame stands where the frame does: what came DELAY frames later; the last DELAY frames are cut off.
    """
    batch, frames = rows.shape[:2]
    x = rows.reshape(batch, -1, front.SENSED) / front.UNIT
    x = _layer(params, 0, x, exact=exact)
    x = jnp.maximum(x[:, 0::2], x[:, 1::2])
    for i in range(1, 1 + len(FAST)):
        x = _layer(params, i, x, exact=exact)
    x = x.reshape(batch, frames, POOLED, WIDE)
    x = jnp.concatenate((_rounded(x.mean(axis=2), UNIT, exact=exact), x.max(axis=2)), axis=2)
    for i in range(1 + len(FAST), 1 + len(FAST) + len(SLOW)):
        if key is not None:
            key, now = jax.random.split(key)
            kept = jax.random.bernoulli(now, 1.0 - DROPPED, x.shape)
            x = jnp.where(kept, x / (1.0 - DROPPED), 0.0)
        x = _layer(params, i, x, exact=exact)
    last = len(LAYERS) - 1
    kernel, bias = _weights(params, last, UNIT, exact=exact)
    z = (x @ kernel + bias)[:, DELAY:]
    return z[..., 0], SLOWEST_HZ + SPAN_HZ * jax.nn.sigmoid(z[..., 1] - 0.5)


def _layer(params: Params, i: int, x: Array, *, exact: bool) -> Array:
    layer = LAYERS[i]
    kernel, bias = _weights(params, i, front.UNIT if i == 0 else UNIT, exact=exact)
    y = _seen(layer, x) @ kernel + bias
    y = jnp.maximum(_rounded(y, UNIT, exact=exact), 0.0)
    if layer.adds:
        y = y + x
    return jnp.minimum(y, LIMIT / UNIT)


def _seen(layer: Layer, x: Array) -> Array:
    n = x.shape[1]
    whole = jnp.pad(x, ((0, 0), (layer.reach, 0), (0, 0)))
    return jnp.concatenate([whole[:, tap * layer.every : tap * layer.every + n] for tap in range(layer.taps)], axis=2)


def _weights(params: Params, i: int, unit: float, *, exact: bool) -> tuple[Array, Array]:
    kernel = jnp.clip(params[f"kernel{i}"], -WEIGHT_LIMIT / WEIGHT_UNIT, WEIGHT_LIMIT / WEIGHT_UNIT)
    return _rounded(kernel, WEIGHT_UNIT, exact=exact), _rounded(params[f"bias{i}"], WEIGHT_UNIT * unit, exact=exact)


def _rounded(x: Array, unit: float, *, exact: bool) -> Array:
    if not exact:
        return x
    return x + jax.lax.stop_gradient(jnp.round(x * unit) / unit - x)


def integers(params: Params) -> dict[str, NDArray[np.int32]]:
    """Return the weights as the counter has them."""
    out: dict[str, NDArray[np.int32]] = {}
    for i in range(len(LAYERS)):
        unit = front.UNIT if i == 0 else UNIT
        kernel = np.clip(np.rint(np.asarray(params[f"kernel{i}"]) * WEIGHT_UNIT), -WEIGHT_LIMIT, WEIGHT_LIMIT)
        bias = np.clip(np.rint(np.asarray(params[f"bias{i}"]) * (WEIGHT_UNIT * unit)), -BIAS_LIMIT, BIAS_LIMIT)
        out[f"kernel{i}"], out[f"bias{i}"] = kernel.astype(np.int32), bias.astype(np.int32)
    return out


def plain(arrays: Mapping[str, NDArray[Any]]) -> Params:
    """Return weights in plain units, to be fitted further, of those that the counter has."""
    out: Params = {}
    for i in range(len(LAYERS)):
        unit = front.UNIT if i == 0 else UNIT
        out[f"kernel{i}"] = jnp.asarray(np.asarray(arrays[f"kernel{i}"]) / WEIGHT_UNIT, jnp.float32)
        out[f"bias{i}"] = jnp.asarray(np.asarray(arrays[f"bias{i}"]) / (WEIGHT_UNIT * unit), jnp.float32)
    return out


def loss(params: Params, clips: dict[str, Array], key: Array | None, *, exact: bool) -> Array:
    """Return what is to become small.

    Cross-entropy of walking where it is known, distance of steps a second where their times are, relative error of the
    number where only that is known, and there doubt (p between 0 and 1) as well.
    """
    z, cadence = answers(params, clips["rows"], exact=exact, key=key)
    n = z.shape[1]
    p = jax.nn.sigmoid(z)
    walking, weight = clips["walking"][:, :n], clips["walking_weight"][:, :n]
    entropy = jnp.maximum(z, 0.0) - z * walking + jnp.log1p(jnp.exp(-jnp.abs(z)))
    known = jnp.sum(weight * entropy) / (jnp.sum(weight) + 1.0)
    dense = clips["density_weight"][:, :n]
    off = jnp.sum(dense * jnp.abs(p * cadence - clips["density"][:, :n])) / (jnp.sum(dense) + 1.0)
    span = clips["span"][:, :, :n]
    counted = FRAME_S * jnp.einsum("bkf,bf->bk", span, p * cadence)
    number, told = clips["number"], clips["number_weight"]
    error = (counted - number) / (number + 3.0)
    size = jnp.abs(error)
    smooth = jnp.where(size < 0.1, 5.0 * error * error, size - 0.05)
    numbers = jnp.sum(told * smooth) / (jnp.sum(told) + 1.0)
    inside = jnp.clip(span.sum(axis=1), 0.0, 1.0)
    doubt = jnp.sum(inside * p * (1.0 - p)) / (jnp.sum(inside) + 1.0)
    return known + 0.5 * off + 6.0 * numbers + 0.2 * doubt
