"""Many recordings, each counted by each chosen counter, over all cores: a row each, whatever a file holds.

A recording is read and put on the grid once, in a process of a pool; there each counter runs on one thread. What
cannot be counted (a damaged file, a missing sensor, a rate under 10 Hz) is a row that says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial

from service.counters import registry
from service.errors import SteplinkError
from service.evaluation.calibration import taught
from service.evaluation.choices import Found
from service.evaluation.counting import count, grid_block
from service.evaluation.metrics import Times, match, metronome_s
from service.evaluation.pool import ENDED, Progress, mapped
from service.evaluation.rows import Choice, Row
from service.evaluation.saturation import saturated
from service.recordings import Recording, read
from service.samples import SampleBlock


async def evaluate(
    found: Sequence[Found], chosen: Sequence[Choice], *, jobs: int, lsb_per_g: float, progress: Progress
) -> list[Row]:
    """Count every recording with every counter, `jobs` recordings at a time; rows in the order given.

    `lsb_per_g` scales recordings in raw units. When cancelled, it ends its processes and returns at once.
    """
    by_file = await mapped(
        partial(rows_of, chosen=chosen, lsb_per_g=lsb_per_g),
        found,
        jobs=jobs,
        progress=progress,
        ended=lambda file: failed_rows(file, chosen, ENDED),
    )
    return [row for made in by_file for row in made]


def rows_of(file: Found, chosen: Sequence[Choice], lsb_per_g: float) -> list[Row]:
    """Read one recording and count it with each counter."""
    try:
        recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping, rate_hz=file.rate_hz)
        block = grid_block(recording)
    except Exception as error:  # one recording must not end the others
        return failed_rows(file, chosen, _told(error))
    return [_row(file, recording, block, taught(choice, block), asked=choice) for choice in chosen]


def failed_rows(file: Found, chosen: Sequence[Choice], error: str) -> list[Row]:
    """Return a row for each counter that says why there is no count."""
    return [
        Row(
            path=file.shown,
            dataset=file.dataset,
            counter=choice.counter,
            preset=choice.preset,
            params=_params(choice),
            changed=tuple(choice.overrides),
            error=error,
        )
        for choice in chosen
    ]


def _row(file: Found, recording: Recording, block: SampleBlock, choice: Choice, *, asked: Choice) -> Row:
    true_s = None if recording.step_t_s is None else recording.step_t_s - recording.t_s[0]
    true = len(true_s) if recording.true_steps is None and true_s is not None else recording.true_steps
    row = Row(
        path=file.shown,
        dataset=file.dataset,
        counter=choice.counter,
        preset=choice.preset,
        params=_params(choice),
        changed=tuple(asked.overrides),
        calibration=choice.calibration,
        uncalibrated=choice.from_middle and choice.calibration is None,
        placement=recording.placement,
        activity=recording.activity,
        rate_hz=recording.rate_hz,
        true_steps=true,
        duration_s=recording.duration_s,
        samples=len(block),
        saturated=saturated(recording),
    )
    return _counted(row, block, choice, true_s)


def _counted(row: Row, block: SampleBlock, choice: Choice, true_s: Times | None) -> Row:
    """Return `row` with its count, or with the reason why there is none."""
    try:
        counted = count(block, choice.counter, choice.preset, choice.overrides)
    except Exception as error:  # one counter must not end the others
        return replace(row, error=_told(error))
    row = replace(row, steps=counted.steps, elapsed_s=counted.elapsed_s)
    if true_s is None:
        return row
    blind = match(metronome_s(counted.steps, true_s), true_s)
    return replace(row, matches=match(counted.step_t_s, true_s), blind=blind)


def _params(choice: Choice) -> dict[str, object]:
    return asdict(registry.parameters(choice.counter, choice.preset, choice.overrides))


def _told(error: Exception) -> str:
    return str(error) if isinstance(error, SteplinkError) else f"{type(error).__name__}: {error}"
