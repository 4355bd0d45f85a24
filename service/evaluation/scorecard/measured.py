"""One recording counted by each counter: plainly, and disturbed in each way that it can show something of.

Disturbed are walks of FEWEST_STEPS steps or more, where a changed count means something, and recordings without any
step, which must stay quiet. What cannot be counted is told as an error; one counter or recording ends no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from service.errors import SteplinkError
from service.evaluation.choices import Found
from service.evaluation.counting import count, grid_block
from service.evaluation.families import Outcome
from service.evaluation.metrics import Matches, Times, match, metronome_s
from service.evaluation.rows import Choice
from service.evaluation.saturation import saturated
from service.evaluation.scorecard import wire
from service.evaluation.scorecard.disturbances import DISTURBANCES, FEWEST_STEPS, seed_of
from service.evaluation.scorecard.sampled import Sampled, sampled
from service.recordings import Recording, read
from service.samples import SampleBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A recording and a counter; `steps` is None where `error` says why. `disturbed` holds counts by disturbance."""

    file: Found
    counter: str
    placement: str | None = None
    activity: str | None = None
    subject: str | None = None
    quality: str | None = None
    within: tuple[int, int] | None = None
    rate_hz: float = 0.0
    duration_s: float = 0.0
    true_steps: int | None = None
    saturated: bool = False
    steps: int | None = None
    error: str | None = None
    matches: Matches | None = None
    blind: Matches | None = None
    disturbed: Mapping[str, int] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Data set and recording."""
        return f"{self.file.dataset}/{self.file.path.stem}"

    def outcome(self, counted: int | None = None) -> Outcome:
        """Return it as the families take it, or with another count."""
        plain = self.steps if counted is None else counted
        return Outcome(
            dataset=self.file.dataset,
            true=self.true_steps,
            counted=plain or 0,
            duration_s=self.duration_s,
            placement=self.placement,
            activity=self.activity,
            quality=self.quality,
            within=self.within,
        )


def measure(file: Found, chosen: Sequence[Choice], lsb_per_g: float) -> list[Measured]:
    """Read one recording and count it with each counter, plainly and disturbed."""
    try:
        recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping, rate_hz=file.rate_hz)
        block = grid_block(recording)
    except Exception as error:  # one recording must not end the others
        return failed(file, chosen, told(error))
    about = _about(file, recording)
    plain = [_counted(replace(about, counter=choice.counter), recording, block, choice) for choice in chosen]
    if about.true_steps is None or 0 < about.true_steps < FEWEST_STEPS:
        return plain
    of, seed = sampled(recording), seed_of(about.name)
    sent = wire.counts(of, chosen, seed)
    return [
        row if row.error else replace(row, disturbed=_disturbed(of, choice, seed) | _of(sent, choice.counter))
        for row, choice in zip(plain, chosen, strict=True)
    ]


def failed(file: Found, chosen: Sequence[Choice], error: str) -> list[Measured]:
    """Return a row for each counter that says why there is no count."""
    return [Measured(file=file, counter=choice.counter, error=error) for choice in chosen]


def _about(file: Found, recording: Recording) -> Measured:
    times = recording.step_t_s
    return Measured(
        file=file,
        counter="",
        placement=recording.placement,
        activity=recording.activity,
        subject=recording.subject,
        quality=recording.quality,
        within=recording.steps_range,
        rate_hz=recording.rate_hz,
        duration_s=recording.duration_s,
        true_steps=len(times) if recording.true_steps is None and times is not None else recording.true_steps,
        saturated=saturated(recording),
    )


def _counted(row: Measured, recording: Recording, block: SampleBlock, choice: Choice) -> Measured:
    try:
        counted = count(block, choice.counter, choice.preset, choice.overrides)
    except Exception as error:  # one counter must not end the others
        return replace(row, error=told(error))
    row = replace(row, steps=counted.steps)
    if recording.step_t_s is None:
        return row
    true_s: Times = recording.step_t_s - recording.t_s[0]
    blind = match(metronome_s(counted.steps, true_s), true_s)
    return replace(row, matches=match(counted.step_t_s, true_s), blind=blind)


def _disturbed(of: Sampled, choice: Choice, seed: int) -> dict[str, int]:
    changed = {each.name: each.change(of, seed) for each in DISTURBANCES}
    return {
        name: count(other.on_grid(), choice.counter, choice.preset, choice.overrides).steps
        for name, other in changed.items()
        if other is not None
    }


def _of(sent: Mapping[str, Mapping[str, int]], counter: str) -> dict[str, int]:
    return {name: steps[counter] for name, steps in sent.items() if counter in steps}


def told(error: Exception) -> str:
    """Return why something was not counted, in a sentence."""
    return str(error) if isinstance(error, SteplinkError) else f"{type(error).__name__}: {error}"
