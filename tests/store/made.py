"""Values for the store, made from a seed: what a bracelet and its Tracker would have handed over."""

import random

import numpy as np

from service.events import StepCounted
from service.samples import Step
from service.store.chunker import counts
from service.store.values import Batch, Chunk, Cursor, Layout, LogEntry, Note, SessionKey, Snapshot, stretches

RATE_HZ = 50
LAYOUT = Layout(rate_hz=float(RATE_HZ), lsb_per_g=4096.0)
SINCE_NS = 1_767_225_600_000_000_000
SECOND_NS = 1_000_000_000


def session(device="sim-1", since_ns=SINCE_NS):
    return SessionKey(device=device, since_ns=since_ns)


def column(first, end, seed=0):
    """The integers of samples first … end − 1 of an endless signal, as bytes."""
    index = np.arange(first, end)[:, None] * 3 + np.arange(3)
    return ((index * 2654435761 + seed * 40503 >> 7) % 65536 - 32768).astype("<i2").tobytes()


def tick(stretch):
    return stretch * 2621 % 65536


def chunk(first, end, *, run=0, boot=7, seed=0, at_ns=SINCE_NS, layout=LAYOUT, gyro=False):
    """A chunk of the endless signal: any two with the same seed and run agree where they overlap."""
    return Chunk(
        run=run,
        boot=boot,
        index=first,
        at_ns=at_ns,
        layout=layout,
        ticks=tuple(tick(first // 128 + k) for k in range(stretches(first, end))),
        acc=column(first, end, seed + 31 * run),
        gyro=column(first, end, seed + 31 * run + 7) if gyro else None,
    )


def step(ordinal, *, at_s=None, counter="double_threshold", run=0, at_ns=None, count=None):
    at_s = ordinal * 0.55 if at_s is None else at_s
    told = StepCounted(
        counter=counter,
        boot=7 + run,
        steps=ordinal if count is None else count,
        step=Step(at_s=at_s, strength=0.31, interval_s=0.55, peak=1.2, valley=0.89, upper=1.1, lower=0.95),
    )
    at_ns = SINCE_NS + round(at_s * SECOND_NS) if at_ns is None else at_ns
    return LogEntry(ordinal=ordinal, at_ns=at_ns, uncertainty_s=0.0125, run=run, told=told)


def note(ordinal, kind="gap", *, at_ns=SINCE_NS, run=0, **body):
    return LogEntry(ordinal=ordinal, at_ns=at_ns, uncertainty_s=0.0, run=run, told=Note(kind=kind, body=body))


def cursor(index, run=0, boot=7):
    return Cursor(run=run, boot=boot, index=index)


def snapshot(index, *, run=0, at_ns=SINCE_NS, **state):
    return Snapshot(cursor=cursor(index, run), at_ns=at_ns, state=state or {"next_index": index})


def second(key, k, *, first_ordinal=None, seed=0):
    """Second k of a walk: a chunk, two steps, the cursor."""
    ordinal = 2 * k + 1 if first_ordinal is None else first_ordinal
    at_ns = SINCE_NS + k * SECOND_NS
    return Batch(
        session=key,
        chunks=(chunk(RATE_HZ * k, RATE_HZ * (k + 1), seed=seed, at_ns=at_ns),),
        entries=(
            step(ordinal, at_s=k + 0.25, at_ns=at_ns + SECOND_NS // 4),
            step(ordinal + 1, at_s=k + 0.75, at_ns=at_ns + 3 * SECOND_NS // 4),
        ),
        cursor=cursor(RATE_HZ * (k + 1)),
    )


def walk_counts(n, seed=0):
    """n samples of a walk with noise as a wrist has it, as integers of 1/4096 g."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE_HZ
    swing = 0.25 * np.sin(2 * np.pi * 1.8 * t) + 0.1 * np.sin(2 * np.pi * 3.6 * t)
    acc = np.stack([0.2 + swing, -0.1 + 0.5 * swing, 0.95 + 0.8 * swing], axis=1) + rng.normal(0, 0.02, (n, 3))
    return counts((acc[:, 0], acc[:, 1], acc[:, 2]), 4096.0)


def shuffled(items, seed):
    items = list(items)
    random.Random(seed).shuffle(items)
    return items
