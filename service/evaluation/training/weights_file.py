"""The file that a training leaves: weights as integers and how they were made; whole or not there at all."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from service.counters import steplink_weights
from service.counters.steplink_network import Weights
from service.errors import ParameterError
from service.evaluation.training.material import Material
from service.evaluation.training.runs import Arrays, Trained

MADE_WITH: Final = ("steplink", "jax", "jaxlib", "optax", "numpy")


def checked(text: str, option: str) -> Path:
    """Return the file to write; ParameterError before any work where it cannot be there."""
    path = Path(text)
    if path.is_dir() or not path.parent.is_dir():
        raise ParameterError(option, text, "a file in a folder that exists is wanted")
    if not os.access(path.parent, os.W_OK):
        raise ParameterError(option, text, "nothing can be written there")
    return path


def about(
    made: Trained, material: Sequence[Material], *, steps: int | None = None, start: Weights | None = None
) -> dict[str, Any]:
    """Return what a file says of itself: how its weights were made; `steps` where not all of the run's count."""
    taught = Counter(material[place].source for place in made.run.taught)
    return {
        "from": None if start is None else steplink_weights.digest(start),
        "steps": steps or made.run.steps,
        "seed": made.run.seed,
        "loss": round(made.last_loss, 4),
        "sources": dict(sorted(taught.items())),
        "versions": {name: version(name) for name in MADE_WITH},
    }


def write(path: Path, arrays: Arrays, about: Mapping[str, Any]) -> str:
    """Write the weights and what is to be said of them; return their digest."""
    content = steplink_weights.packed(arrays, about)
    kept = steplink_weights.parsed(content)  # what cannot be read again is not written
    replace(path, content, "out")
    return steplink_weights.digest(kept.weights)


def replace(path: Path, content: bytes, option: str) -> None:
    """Put a file there in one step; ParameterError, and the old one still there, where it cannot be written."""
    beside = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            beside = Path(file.name)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        beside.chmod(0o644)
        beside.replace(path)
    except OSError as error:
        raise ParameterError(option, str(path), error.strerror or str(error)) from error
    finally:
        if beside is not None:
            with suppress(FileNotFoundError):
                beside.unlink()
