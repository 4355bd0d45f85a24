"""Compiling in the background: once, for many devices, and only what gains by it."""

from __future__ import annotations

import gc
import threading

import pytest

from service.counters import registry
from service.pipeline import compilation
from service.pipeline.compilation import MANY, Compilation


@pytest.fixture
def compiled(monkeypatch):
    """Names of the threads that steplink was compiled in, numba being there."""
    found = []
    kind = registry.COUNTERS["steplink"]
    assert kind.compile_live is not None
    changed = {"compile_live": lambda: found.append((threading.current_thread().name, gc.isenabled()))}
    fields = {name: getattr(kind, name) for name in kind.__slots__}
    monkeypatch.setattr(compilation.registry, "COUNTERS", {"steplink": registry.CounterKind(**{**fields, **changed})})
    monkeypatch.setattr(compilation, "available", lambda: True)
    return found


def test_it_compiles_once_for_many_in_a_thread_that_nobody_waits_for(compiled):
    tested = Compilation()
    tested.consider(MANY - 1, ["steplink"])
    assert tested.thread is None
    for _ in range(3):
        tested.consider(MANY, ["steplink"])
    assert tested.thread.daemon
    tested.thread.join(10)
    assert compiled == [("compilation", False)]
    assert gc.isenabled()


def test_nothing_to_compile_is_no_thread(monkeypatch):
    monkeypatch.setattr(compilation, "available", lambda: True)
    tested = Compilation()
    tested.consider(MANY, ["double_threshold"])
    monkeypatch.setattr(compilation, "available", lambda: False)
    tested.consider(MANY, ["steplink"])
    assert tested.thread is None


def test_a_compiler_that_fails_is_told_and_leaves_the_collector_on(caplog):
    compilation._compile([lambda: 1 / 0])
    assert "goes on plainly" in caplog.text
    assert gc.isenabled()
