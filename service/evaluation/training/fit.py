"""Fitting the network: AdamW with one cycle of the learning rate, plain floats first, then as the integers it ships as.

Everything follows from the seed: material, clips and weights, on the same machine and versions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import jax
import numpy as np
import optax
from numpy.typing import NDArray

from service.evaluation.training import model
from service.evaluation.training.clips import Clip, Sampler
from service.evaluation.training.recipe import AVERAGED, BATCH, DECAY, EXACT_FROM, HIGHEST_RATE

FIELDS: Final = tuple(Clip.__dataclass_fields__)


def course(
    sampler: Sampler,
    *,
    steps: int,
    seed: int,
    start: model.Params | None = None,
    rate: float = HIGHEST_RATE,
    exact_from: float = EXACT_FROM,
) -> Iterator[tuple[int, float, model.Params]]:
    """Yield each step's number from 1 on, the loss before it and the running mean of the weights, in plain units.

    Rounding begins after the share `exact_from` of the steps.
    """
    params = model.fresh(seed) if start is None else start
    schedule = optax.cosine_onecycle_schedule(steps, rate, pct_start=0.2)
    optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.adamw(schedule, weight_decay=DECAY))
    state = optimiser.init(params)
    average = params
    advance = {exact: jax.jit(partial(_advance, optimiser, exact)) for exact in (False, True)}
    key = jax.random.PRNGKey(seed)
    for number, clips in enumerate(batches(sampler, steps)):
        key, now = jax.random.split(key)
        params, state, value = advance[number >= exact_from * steps](params, state, clips, now)
        average = mean(average, params, min(AVERAGED, number / (number + 10.0)))
        yield number + 1, float(value), average


@jax.jit
def mean(average: Any, params: Any, share: float) -> Any:  # noqa: ANN401
    """Return the running mean of the weights."""
    return jax.tree.map(lambda old, new: share * old + (1.0 - share) * new, average, params)


def _advance(optimiser: Any, exact: bool, params: Any, state: Any, clips: Any, key: Any) -> Any:  # noqa: ANN401
    value, slope = jax.value_and_grad(partial(model.loss, exact=exact))(params, clips, key)
    change, state = optimiser.update(slope, state, params)
    return optax.apply_updates(params, change), state, value


def batches(sampler: Sampler, steps: int, batch: int = BATCH) -> Iterator[dict[str, NDArray[np.float32]]]:
    """Yield batches of clips."""
    for _ in range(steps):
        yield stacked([sampler.clip() for _ in range(batch)])


def stacked(clips: Sequence[Clip]) -> dict[str, NDArray[np.float32]]:
    """Return clips as one batch."""
    return {name: np.stack([getattr(clip, name) for clip in clips]) for name in FIELDS}
