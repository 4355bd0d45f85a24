"""What every Tracker can be asked beside its events: of one fold what is certain, of another what is newest."""

from __future__ import annotations

from service.errors import WireError
from service.samples import DeviceInfo, Gait, Verdict
from service.signals.rate import Rate
from service.tracking.fold import Fold
from service.tracking.intake import Intake


class Readings:
    """A device's count as it stands: `_committed` has counted what is certain, `_front` the newest samples."""

    _intake: Intake
    _committed: Fold

    @property
    def _front(self) -> Fold:
        return self._committed

    @property
    def primary(self) -> str:
        """The counter whose count is the device's."""
        return self._committed.primary

    @property
    def info(self) -> DeviceInfo:
        """What the device has said of itself."""
        return self._intake.info

    @property
    def last_fault(self) -> WireError | None:
        """What was wrong with the newest bad packet."""
        return self._intake.last_fault

    @property
    def steps(self) -> dict[str, int]:
        """Each counter's confirmed steps."""
        return self._committed.steps

    @property
    def total(self) -> int:
        """The device's confirmed steps: the primary's of each segment, added up; never falls."""
        return self._committed.total

    @property
    def now_s(self) -> float:
        """Device time of the newest sample counted, seconds after boot."""
        return self._front.now_s

    @property
    def cadence_spm(self) -> float | None:
        """Steps a minute now; None while nobody walks."""
        return self._front.cadence_spm

    @property
    def gait(self) -> Gait | None:
        """What the primary makes of the motion now; None where it does not recognise walking, or cannot count."""
        return self._front.gait

    @property
    def refused(self) -> dict[str, dict[Verdict, int]]:
        """How many steps of other counters the primary refused, by what it made of the motion."""
        return self._committed.refused

    @property
    def measured_rate_hz(self) -> float | None:
        """The rate that samples are placed by: the nominal one until the device's clock disproves it."""
        return self._front.measured_rate_hz

    @property
    def rate(self) -> Rate | None:
        """The sampling rate as the device's clock tells it, and how well; None until this boot has told two ticks."""
        return self._front.rate

    @property
    def counter_faults(self) -> dict[str, str]:
        """Why a counter does not count now, as a sentence."""
        return self._front.counter_faults
