"""One source, two speeds: a scalar kernel as it is while live, the same function compiled where a recording is long.

A kernel is a plain function of indexables and floats (`+ − × ÷`, comparisons, `math.sqrt` and the few others shown to
give equal bits). `compiled` translates it, and the plain functions it calls by their bare names, with numba from the
`fast` extra; without numba it gives back the plain function. Either way steps and state are the same, bit for bit.
"""

from __future__ import annotations

import functools
import importlib.util
import types
from collections.abc import Callable
from typing import Any, Final

Kernel = Callable[..., Any]

OPTIONS: Final[dict[str, Any]] = {"_nrt": False, "forceinline": True}
"""Every call of a function counts references to its arrays up and down, atomically: two to three times the time of a
counter. The caller holds the arrays anyway, so a kernel does without, and may then make or give back none."""


def available() -> bool:
    """Tell whether the `fast` extra is installed: `pip install 'steplink[fast]'`."""
    return importlib.util.find_spec("numba") is not None


@functools.cache
def compiled(kernel: Kernel) -> Kernel:
    """Return `kernel` compiled by numba, or `kernel` itself where numba is missing."""
    if not available():
        return kernel
    import numba  # noqa: PLC0415  # heavy, and only where a whole recording is counted

    jitted: Kernel = numba.njit(**OPTIONS)(_with_compiled_callees(kernel))
    return jitted


def _with_compiled_callees(kernel: Kernel) -> Kernel:
    """Copy `kernel` with the plain functions that it names, its own module's or imported, replaced by compiled ones."""
    if not isinstance(kernel, types.FunctionType):
        raise TypeError(f"{kernel!r} is no plain function")
    scope = dict(kernel.__globals__)
    for name in kernel.__code__.co_names:
        callee = scope.get(name)
        if isinstance(callee, types.FunctionType):
            scope[name] = compiled(callee)
    return types.FunctionType(kernel.__code__, scope, kernel.__name__, kernel.__defaults__)
