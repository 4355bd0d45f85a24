"""What is told of holes: that samples are awaited, and that what is behind them was counted again."""

from __future__ import annotations

from service.events import Awaited, Corrected
from service.tracking.account import Account
from service.tracking.holes import Span
from service.tracking.kept import Kept


def awaited(kept: Kept, settled: float) -> list[Awaited]:
    """Return what is now worth telling: holes older than a reordering, seen before `settled` packets had come on."""
    told = []
    for span in kept.holes.spans:
        if not span.is_told and span.holes and span.since < settled:
            span.is_told = True
            told.append(Awaited(from_s=span.from_s, to_s=span.to_s, index=span.first, samples=span.end - span.first))
    return told


def corrections(kept: Kept, account: Account, now_s: float) -> list[Corrected]:
    """Return what tells that spans are over, now that all up to `now_s` was counted again.

    Each goes up to the next span that is still awaited. Where nothing was told of a hole that closed, a correction is
    told only if steps are none that were sure.
    """
    parts: list[tuple[float, float]] = []
    begun: float | None = None
    for span in kept.holes.spans:
        if span.is_told and span.holes and begun is not None:
            parts.append((begun, span.from_s))
            begun = None
        elif not span.holes and begun is None:
            begun = span.from_s
    if begun is not None:
        parts.append((begun, now_s))
    kept.holes.forget_over()
    if not parts and not _any_told(kept.holes.spans):
        parts = [(account.changed_from_s, now_s)] if account.removed else []
        if not parts:
            account.corrected()
    changed = account.corrected() if parts else (0, 0)
    told = []
    for from_s, to_s in parts:
        removed, added = changed
        told.append(Corrected(boot=kept.boot, from_s=from_s, to_s=max(from_s, to_s), removed=removed, added=added))
        changed = (0, 0)
    return told


def _any_told(spans: list[Span]) -> bool:
    return any(span.is_told for span in spans)
