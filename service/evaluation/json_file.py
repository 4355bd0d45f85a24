"""Results for tools: a list of plain rows in a JSON file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from service.errors import ParameterError


def checked_path(text: str | None) -> Path | None:
    """Return the file to write, None where none is wanted; ParameterError before any work where it cannot be there."""
    if text is None:
        return None
    path = Path(text)
    if path.is_dir() or not path.parent.is_dir():
        raise ParameterError("json", text, "a file in a folder that exists is wanted")
    return path


def write_json(path: Path | None, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write `rows`, a line each; nothing without a path. ParameterError where the file cannot be written."""
    if path is None:
        return
    lines = ",\n".join(json.dumps(row, ensure_ascii=False, allow_nan=False) for row in rows)
    try:
        path.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    except OSError as error:
        raise ParameterError("json", str(path), error.strerror or str(error)) from error
