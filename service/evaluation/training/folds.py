"""What is held back from a training, so that the figures are of what was never learnt: sources, subjects, recordings.

Sets that share an origin are one source. Who does not say who they are is, within a source, one subject: what cannot be
told apart is held back together. Which is held back with which follows from the names alone.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from service.errors import ParameterError
from service.evaluation.training.material import Material
from service.evaluation.training.sources import UNSAID, source

PARTS: Final = 5
"""Into how many parts subjects or recordings are dealt out, each held back once."""

SOURCES: Final = "sources"
SUBJECTS: Final = "subjects"
NONE: Final = "none"

Person = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """What is held back once: places in the list of material."""

    name: str
    held: tuple[int, ...]

    def taught(self, material: Sequence[Material]) -> tuple[int, ...]:
        """Return the places of all that is not held back."""
        apart = set(self.held)
        return tuple(place for place in range(len(material)) if place not in apart)


def by_source(material: Sequence[Material]) -> list[Fold]:
    """Return a fold for each source; ParameterError where there is one only."""
    groups = _groups(material, lambda one: (source(one.source).name(one.source),))
    if len(groups) < 2:
        raise ParameterError("folds", SOURCES, "two sources are needed: one to learn from, one to be held back")
    return [Fold(name=name, held=held) for (name,), held in sorted(groups.items())]


def by_subject(material: Sequence[Material]) -> list[Fold]:
    """Return up to PARTS folds of subjects, of each source dealt out evenly; ParameterError where there is one."""
    groups = _groups(material, person)
    if len(groups) < 2:
        raise ParameterError("folds", SUBJECTS, "two subjects are needed: one to learn from, one to be held back")
    return _dealt(groups)


def of_own(material: Sequence[Material]) -> list[Fold]:
    """Return up to PARTS folds of somebody's own recordings: of subjects where there are two, else of recordings.

    ParameterError where there is a single recording.
    """
    groups = _groups(material, person)
    if len(groups) < 2:
        groups = _groups(material, lambda one: (*person(one), one.recording))
    if len(groups) < 2:
        why = "two are needed: what one teaches is tried on the other. Record a second walk, and count its steps"
        raise ParameterError("data", material[0].recording, f"a single recording; {why}")
    return _dealt(groups)


def person(one: Material) -> Person:
    """Return who wore it, told apart from people of other sources."""
    return source(one.source).name(one.source), one.subject.strip().lower() or UNSAID


def _groups(
    material: Sequence[Material], key: Callable[[Material], tuple[str, ...]]
) -> dict[tuple[str, ...], tuple[int, ...]]:
    found: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for place, one in enumerate(material):
        found[key(one)].append(place)
    return {name: tuple(places) for name, places in found.items()}


def _dealt(groups: dict[tuple[str, ...], tuple[int, ...]]) -> list[Fold]:
    parts = min(PARTS, len(groups))
    held: list[list[int]] = [[] for _ in range(parts)]
    for number, (_, places) in enumerate(sorted(groups.items())):
        held[number % parts] += places
    return [Fold(name=f"{number + 1} of {parts}", held=tuple(sorted(places))) for number, places in enumerate(held)]
