"""One row of a result: one recording counted by one counter, as the tables read it and as JSON holds it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from service.evaluation.metrics import Matches, Score


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A counter to evaluate: its name, a preset and what differs from it.

    `from_middle` lets it learn from each recording; `calibration` says what it has learnt, None where nothing.
    """

    counter: str
    preset: str
    overrides: Mapping[str, object]
    from_middle: bool = False
    calibration: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A recording and a counter.

    `path` is as it was asked for, `dataset` the folder the file lies in. `true_steps` is None where unknown, `steps`
    where `error` says why there are none; `samples` are those of the 50 Hz grid. `tp`, `fp`, `fn` are None where step
    times are unknown. `saturated` tells whether the sensor was at its limit, None where the file could not be read;
    `calibration` what the counter learnt, None where nothing: `params` hold it. For the tables only are `blind`,
    `uncalibrated` (it was to learn and found no walk) and `changed` (parameters that were asked for).
    """

    path: str
    dataset: str
    counter: str
    preset: str
    params: Mapping[str, Any]
    placement: str | None = None
    activity: str | None = None
    rate_hz: float | None = None
    true_steps: int | None = None
    steps: int | None = None
    error: str | None = None
    duration_s: float | None = None
    samples: int | None = None
    elapsed_s: float | None = None
    matches: Matches | None = None
    blind: Matches | None = None
    saturated: bool | None = None
    calibration: str | None = None
    uncalibrated: bool = False
    changed: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the row as tools read it: plain data, every key always there."""
        plain = {name: getattr(self, name) for name in _PLAIN} | {"params": dict(self.params)}
        found = dataclasses.asdict(self.matches) if self.matches else dict.fromkeys(("tp", "fp", "fn"))
        return plain | found

    def score(self) -> Score | None:
        """Return what the metrics take; None where nothing was counted."""
        if self.steps is None or self.duration_s is None:
            return None
        return Score(
            counted=self.steps,
            true=self.true_steps,
            duration_s=self.duration_s,
            matches=self.matches,
            blind=self.blind,
        )


_PLAIN: Final = (
    "path", "dataset", "placement", "activity", "rate_hz", "counter", "preset", "params", "true_steps", "steps",
    "error", "duration_s", "samples", "elapsed_s", "saturated",
    "calibration",
)  # fmt: skip
"""Keys of a row in JSON, in their order; `tp`, `fp`, `fn` follow."""
