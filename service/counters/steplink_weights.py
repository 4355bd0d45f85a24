"""Where steplink's counter has its weights from: those that come with the package, or a file of `steplink train`.

A process counts with one set of weights, and so do the processes it starts: the file that STEPLINK_WEIGHTS names
(`--weights` sets it), else the shipped ones. Their digest enters a snapshot's hash of parameters, so that a snapshot of
other weights is refused. A file is taken only where its network is ours and within the limits that make every sum
exact; it is data, and reading it never runs code.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from service.counters import steplink_network as network
from service.errors import ParameterError

ENVIRONMENT: Final = "STEPLINK_WEIGHTS"
SHIPPED: Final = "steplink_weights.npz"
ABOUT: Final = "about"
"""Key of what a file says of itself: the bytes of a JSON object."""

LARGEST_BYTES: Final = 200_000
DIGEST_LENGTH: Final = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kept:
    """Weights and what their file says of them: steps, seed, versions and sources; empty where it says nothing."""

    weights: network.Weights
    about: Mapping[str, Any]


def in_use() -> network.Weights:
    """Return the weights this process counts with; ParameterError where STEPLINK_WEIGHTS names no such file."""
    named = os.environ.get(ENVIRONMENT)
    return _once(named) if named else shipped().weights


def use(path: str) -> None:
    """Count with the weights of that file, also in processes that are started from now on; '' leaves all as it is.

    ParameterError where it is none, or where the one that STEPLINK_WEIGHTS names is none.
    """
    if path:
        read(Path(path))
        os.environ[ENVIRONMENT] = str(Path(path).absolute())
    in_use()


@cache
def shipped() -> Kept:
    """Return what comes with the package, read once."""
    return unpacked()


def unpacked() -> Kept:
    """Read what comes with the package."""
    return parsed(resources.files("service.counters").joinpath(SHIPPED).read_bytes())


def read(path: Path) -> Kept:
    """Return the weights of a file; ParameterError where it cannot be read or is none."""
    try:
        with path.open("rb") as file:
            return parsed(file.read(LARGEST_BYTES + 1))
    except OSError as error:
        raise ParameterError("weights", str(path), error.strerror or str(error)) from error
    except ValueError as error:
        raise ParameterError("weights", str(path), f"no weights of `steplink train`: {error}") from error


def parsed(content: bytes) -> Kept:
    """Return the weights that a file's bytes hold; ValueError where they hold none."""
    if len(content) > LARGEST_BYTES:
        raise ValueError(f"it is larger than {LARGEST_BYTES:,} bytes")
    try:
        with np.load(BytesIO(content)) as archive:
            arrays = dict(archive)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        KeyError,
        AttributeError,
        TypeError,
        ValueError,
    ) as error:  # what numpy makes of another file
        raise ValueError("it is no numpy archive") from error
    for name in _NAMES:
        _check(name, arrays.get(name))
    return Kept(weights=network.weights_of(arrays), about=_about(arrays.get(ABOUT)))


_NAMES: Final = tuple(f"{kind}{i}" for i in range(len(network.LAYERS)) for kind in ("kernel", "bias"))


def _check(name: str, values: NDArray[np.generic] | None) -> None:
    if values is None:
        raise ValueError(f"{name} is missing")
    if not np.issubdtype(values.dtype, np.integer):
        raise ValueError(f"{name} is not of integers")
    limit = network.WEIGHT_LIMIT if name.startswith("kernel") else network.BIAS_LIMIT
    if np.any(np.abs(values.astype(np.float64)) > limit):
        raise ValueError(f"{name} passes {limit:,.0f}, so that a sum might not be exact")


def _about(values: NDArray[np.generic] | None) -> Mapping[str, Any]:
    if values is None:
        return {}
    said = json.loads(values.tobytes())  # not of JSON: a ValueError too
    return said if isinstance(said, dict) else {ABOUT: said}


def packed(arrays: Mapping[str, NDArray[np.integer[Any]]], about: Mapping[str, Any]) -> bytes:
    """Return the bytes of a file of these weights: the same for the same."""
    content = BytesIO()
    text = json.dumps(about, sort_keys=True, ensure_ascii=False).encode()
    held = {name: arrays[name].astype(np.int32) for name in _NAMES}
    np.savez(content, allow_pickle=False, **held, **{ABOUT: np.frombuffer(text, np.uint8)})
    return content.getvalue()


@cache
def digest(weights: network.Weights) -> str:
    """Return what tells these weights from others, in 12 letters."""
    hashed = hashlib.sha256()
    for values in integers(weights).values():
        hashed.update(values.astype("<i4").tobytes())
    return hashed.hexdigest()[:DIGEST_LENGTH]


def integers(weights: network.Weights) -> dict[str, NDArray[np.int32]]:
    """Return the arrays that `packed` takes."""
    out: dict[str, NDArray[np.int32]] = {}
    for i, kernel in enumerate(weights.kernels()):
        whole = (kernel / np.float32(network.scale(i))).astype(np.int32)
        out[f"kernel{i}"], out[f"bias{i}"] = whole[:-1], whole[-1]
    return out


@cache
def _once(path: str) -> network.Weights:
    return read(Path(path)).weights
