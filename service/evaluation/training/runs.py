"""Trainings side by side: each run fits one network in a process of its own pool, then counts what it was not taught.

A run computes on one thread, so what comes out does not depend on how many go on at once, and XLA takes no more cores
than `--jobs` allows. jax is imported in those processes alone, on the CPU.
"""

from __future__ import annotations

import contextlib
import importlib.util
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters.steplink import SteplinkCounter
from service.counters.steplink_network import Weights, weights_of
from service.errors import TrainingError
from service.evaluation.training.material import OTHERS, WEIGHTS, Material
from service.evaluation.training.recipe import EXACT_FROM, HIGHEST_RATE
from service.samples import SampleBlock

NEEDED: Final = ("jax", "optax")
ONE_THREAD: Final = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "JAX_PLATFORMS": "cpu",
    "NPROC": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment of the processes; NPROC is what XLA takes its own threads from."""

POLL_S: Final = 0.3
"""How often the bar is drawn."""

LAST: Final = 50
"""Steps whose mean loss is told as that at the beginning and at the end; a fifth of a short training's."""

Arrays = Mapping[str, NDArray[np.int32]]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """One training: of the material at the places `taught`; what is `held` is then counted.

    It goes on from `start`, weights as the counter has them, at the highest rate `rate`; None: from nothing, at the
    usual one, and rounding begins later. Weights are kept after each number of steps in `checkpoints`, of `steps`.
    """

    name: str
    taught: tuple[int, ...]
    held: tuple[int, ...]
    seed: int
    steps: int
    checkpoints: tuple[int, ...]
    start: Arrays | None = None
    rate: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """Weights after so many steps, and the steps that they count in each recording that was held."""

    steps: int
    arrays: Arrays
    counted: Mapping[int, int]

    @property
    def weights(self) -> Weights:
        """The weights, for a counter."""
        return weights_of(dict(self.arrays))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trained:
    """What came of a run; `first_loss` and `last_loss` are means over a few steps."""

    run: Run
    kept: Sequence[Checkpoint]
    first_loss: float
    last_loss: float


def require_framework() -> None:
    """Raise TrainingError where the extra `train` is not installed."""
    if missing := [name for name in NEEDED if not _installed(name)]:
        raise TrainingError(
            f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing: pip install 'steplink[train]'"
        )


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ValueError:  # it is there, but hidden
        return False


def carried_out(runs: Sequence[Run], material: Sequence[Material], *, jobs: int, progress: Progress) -> list[Trained]:
    """Carry out the runs, `jobs` at a time; `progress` hears of all their steps. TrainingError where one fails."""
    context = multiprocessing.get_context("spawn")  # not forked: threads of numba do not outlive that
    done: Synchronized[int] = context.Value("q", 0)
    total = sum(run.steps for run in runs)
    with _environment(ONE_THREAD):
        pool = ProcessPoolExecutor(
            min(jobs, len(runs)), mp_context=context, initializer=_begin, initargs=(list(material), done)
        )
        try:
            futures: list[Future[Trained]] = [pool.submit(_carried_out, run) for run in runs]
            while wait(futures, timeout=POLL_S).not_done:
                progress(done.value, total)
                _raise_first(futures)
            return [future.result() for future in futures]
        except BrokenExecutor as error:
            raise TrainingError("the process of a training ended: is there memory enough for --jobs?") from error
        except BaseException:
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _raise_first(futures: Sequence[Future[Trained]]) -> None:
    """Raise what a run failed with, without waiting for the others."""
    for future in futures:
        if future.done():
            future.result()


@contextlib.contextmanager
def _environment(wanted: Mapping[str, str]) -> Iterator[None]:
    """Set variables for the processes that are started meanwhile; XLA keeps the flags it is given by others."""
    before = {name: os.environ.get(name) for name in wanted}
    flags = f"{before['XLA_FLAGS'] or ''} {wanted['XLA_FLAGS']}".strip()
    os.environ.update({**wanted, "XLA_FLAGS": flags})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


_material: list[Material] = []
"""Of this process."""
_done: list[Synchronized[int]] = []


def _begin(material: list[Material], done: Synchronized[int]) -> None:
    """Take over what all runs of this process share; Ctrl-C is its parent's matter."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _material[:] = material
    _done[:] = [done]


def _carried_out(run: Run) -> Trained:
    def tick() -> None:
        with _done[0].get_lock():
            _done[0].value += 1

    return train(run, _material, tick)


def train(run: Run, material: Sequence[Material], tick: Callable[[], None] = lambda: None) -> Trained:
    """Carry out one run here; `tick` hears of each step. TrainingError where the loss is no number any more."""
    from service.evaluation.training import fit, model  # noqa: PLC0415  # jax: heavy, and an extra
    from service.evaluation.training.clips import Sampler  # noqa: PLC0415

    taught = [material[place] for place in run.taught]
    sampler = Sampler(taught, shares(taught), seed=run.seed)
    start = None if run.start is None else model.plain(run.start)
    rate = HIGHEST_RATE if run.rate is None else run.rate
    exact_from = EXACT_FROM if start is None else 0.0
    losses: list[float] = []
    kept: list[Checkpoint] = []
    course = fit.course(sampler, steps=run.steps, seed=run.seed, start=start, rate=rate, exact_from=exact_from)
    for number, loss, params in course:
        if not np.isfinite(loss):
            raise TrainingError(f"{run.name}: the loss is {loss} after {number} steps; another seed may do")
        losses.append(loss)
        if number in run.checkpoints:
            kept.append(_checkpoint(number, model.integers(params), material, run.held))
        tick()
    told = min(LAST, max(run.steps // 5, 1))
    first, last = (float(np.mean(part)) for part in (losses[:told], losses[-told:]))
    return Trained(run=run, kept=kept, first_loss=first, last_loss=last)


def _checkpoint(steps: int, arrays: Arrays, material: Sequence[Material], held: Sequence[int]) -> Checkpoint:
    weights = weights_of(dict(arrays))
    return Checkpoint(steps=steps, arrays=arrays, counted={place: counted(material[place], weights) for place in held})


def counted(one: Material, weights: Weights) -> int:
    """Return how many steps the counter finds in a recording with these weights."""
    x, y, z = (np.ascontiguousarray(column) for column in one.acc_g.T)
    return len(SteplinkCounter(weights=weights).count(SampleBlock(start=0, acc_g=(x, y, z))))


def shares(material: Sequence[Material]) -> dict[str, float]:
    """Return how often clips take from each pool: as WEIGHTS says, OTHERS of a source that is not named there."""
    from service.evaluation.training.clips import pool  # noqa: PLC0415  # numba: heavy

    named = {name.partition("/")[0] for name in WEIGHTS}
    return {pool(one): WEIGHTS.get(pool(one), 0.0 if one.source in named else OTHERS) for one in material}
