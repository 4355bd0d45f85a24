"""What the words of a command ask for: which counters with which parameters, and which files."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from service.counters import registry
from service.errors import ParameterError
from service.evaluation.rows import Choice
from service.recordings import ColumnMapping, is_recording, suffixes

ALL: Final = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A file to evaluate: its path as asked for (`shown`) and as it is, its folder's name, and how to read it."""

    shown: str
    path: Path
    dataset: str
    mapping: ColumnMapping | None = None
    rate_hz: float | None = None
    """Where the file does not say its own."""


def choices(counters: Sequence[str], preset: str, params: Sequence[str]) -> list[Choice]:
    """Return the counters asked for, each once; `params` are texts NAME.KEY=V.

    CounterError where a name or the preset is unknown, ParameterError where a parameter is, or is out of range, or is
    of a counter that was not asked for.
    """
    names = list(registry.COUNTERS) if ALL in counters else list(dict.fromkeys(counters))
    overrides: dict[str, dict[str, object]] = defaultdict(dict)
    for text in params:
        name, key, value = _split(text)
        if name not in names:
            raise ParameterError(text, value, f"{name!r} is not evaluated; there are {', '.join(names)}")
        overrides[name][key] = value
    chosen = [Choice(counter=name, preset=preset, overrides=overrides[name]) for name in names]
    for choice in chosen:
        registry.parameters(choice.counter, choice.preset, choice.overrides)
    return chosen


def _split(text: str) -> tuple[str, str, str]:
    name, equals, value = text.partition("=")
    counter, dot, key = name.partition(".")
    if not (equals and dot and counter and key):
        raise ParameterError("param", text, "NAME.KEY=V is wanted, as in double_threshold.bout=3")
    return counter, key, value


def counters_and_paths(words: Sequence[str], paths: Sequence[str]) -> tuple[list[str], list[str]]:
    """Tell the names after `--counter` from the PATHs that may follow them; without names, the default counter's.

    A word that is no counter's name and does exist as a file or folder is a PATH.
    """
    names = [word for word in words if word == ALL or word in registry.COUNTERS or not Path(word).exists()]
    return names or [registry.DEFAULT], [*paths, *(word for word in words if word not in names)]


def find(
    paths: Sequence[str], mapping: ColumnMapping | None = None, rate_hz: float | None = None
) -> tuple[list[Found], list[str]]:
    """Return the recordings at `paths`, folders searched through, and what was passed over in them.

    Each file is found once, by the first path to it. With a `mapping`, every text is read as a table of those columns.

    Passed over are hidden files and texts that are no recording; a file named by itself never is. ParameterError where
    a path does not exist or there is no recording at all.
    """
    if not paths:
        raise ParameterError("PATH", "", "name a recording or a folder of recordings")
    found: dict[Path, Found] = {}
    passed: list[str] = []

    def add(shown: str, path: Path) -> None:
        place = _place(path)
        dataset = place.parent.name
        found.setdefault(place, Found(shown=shown, path=path, dataset=dataset, mapping=mapping, rate_hz=rate_hz))

    for text in dict.fromkeys(paths):
        path = Path(text)
        if not path.exists():
            raise ParameterError("PATH", text, "no such file or folder")
        if not path.is_dir():
            add(text, path)
            continue
        for file in _files(path):
            shown = f"{text.rstrip('/') or '/'}/{file.relative_to(path).as_posix()}"
            if is_recording(file, mapping):
                add(shown, file)
            else:
                passed.append(shown)
    if not found:
        why = f"no recordings ({', '.join(sorted(suffixes()))}) there"
        raise ParameterError("PATH", " ".join(paths), f"{why}; {len(passed)} texts are none" if passed else why)
    return list(found.values()), list(dict.fromkeys(passed))


def _files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.suffix.lower() in suffixes() and not hidden and path.is_file():
            yield path


def _place(path: Path) -> Path:
    """Return where `path` lies; a link is where it was put, whatever it leads to."""
    return Path(os.path.normpath(path.absolute()))
