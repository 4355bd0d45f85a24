"""Compiled kernels: the same function, its callees included."""

import importlib

import numpy as np
import pytest

from service.signals import compiled as module
from service.signals.compiled import compiled


def half(value):
    return value / 2


def kernel(value):
    return half(value) + 1


def test_callees_are_compiled_too():
    pytest.importorskip("numba")
    fast = compiled(kernel)
    assert fast is not kernel
    assert fast(3.0) == kernel(3.0)


def first(values):
    return values[0]


def give_back(values):
    first(values)
    return values * 2


def test_a_kernel_that_makes_an_array_does_not_compile():
    numba = pytest.importorskip("numba")
    with pytest.raises(numba.core.errors.NumbaError):
        compiled(give_back)(np.zeros(3))


def test_without_numba_the_plain_function_runs(monkeypatch):
    fresh = importlib.reload(module)
    monkeypatch.setattr(fresh, "available", lambda: False)
    assert fresh.compiled(kernel) is kernel
