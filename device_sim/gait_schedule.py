"""What a synthetic walker does and for how long, as values and as the text a command line takes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from device_sim.gait_profiles import GAITS, MOTIONS
from service.errors import ParameterError

ACTIVITIES: Final = (*GAITS, *MOTIONS)
CADENCE_SPM: Final = (20.0, 240.0)
"""Steps a minute that a schedule may ask for."""
LONGEST_S: Final = 86_400.0
"""A segment is laid out as a whole: a day of it takes 50 MB."""
_UNITS_S: Final = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
_PART: Final = re.compile(
    r"(?P<activity>[a-z_]+):(?P<number>\d+(?:\.\d+)?)(?P<unit>s|min|h|)(?:@(?P<cadence>\d+(?:\.\d+)?))?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One activity (see ACTIVITIES) for `duration_s` seconds; a gait's own cadence unless `cadence_spm` is given."""

    activity: str
    duration_s: float
    cadence_spm: float | None = None

    def __post_init__(self) -> None:
        if self.activity not in ACTIVITIES:
            raise ParameterError("activity", self.activity, f"known are {', '.join(ACTIVITIES)}")
        if not 0 < self.duration_s <= LONGEST_S:
            raise ParameterError("duration_s", self.duration_s, "above 0 s and at most 24 h; a schedule may be looped")
        if self.cadence_spm is None:
            return
        if self.activity not in GAITS:
            raise ParameterError("cadence_spm", self.cadence_spm, f"{self.activity} has no steps")
        if not CADENCE_SPM[0] <= self.cadence_spm <= CADENCE_SPM[1]:
            low, high = CADENCE_SPM
            raise ParameterError("cadence_spm", self.cadence_spm, f"{low:g} to {high:g} steps a minute are possible")

    @property
    def steps(self) -> int:
        """True steps of the segment: cadence × duration, to the nearest whole one; 0 where nobody steps."""
        if self.activity not in GAITS:
            return 0
        return round((self.cadence_spm or GAITS[self.activity].cadence_spm) * self.duration_s / 60)


def parse_schedule(text: str) -> tuple[Segment, ...]:
    """Read `slow:20,rest:5,run:10@170`: activity, colon, seconds (or `2min`, `1h`), and after @ steps a minute.

    ParameterError names the part that cannot be read.
    """
    segments = []
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            why = f"{part.strip()!r} is not ACTIVITY:SECONDS[@STEPS_PER_MINUTE], as in normal:30@110 or rest:2min"
            raise ParameterError("schedule", text, why)
        cadence = match["cadence"]
        duration_s = float(match["number"]) * _UNITS_S[match["unit"]]
        spm = None if cadence is None else float(cadence)
        segments.append(Segment(activity=match["activity"], duration_s=duration_s, cadence_spm=spm))
    return tuple(segments)
