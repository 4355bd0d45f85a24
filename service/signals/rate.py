"""The rate a device samples at, by its own clock: what its ticks say by now, and how well they can say it.

The timebase needs a pace that runs smoothly, and believes the nominal rate until ticks disprove it; a researcher wants
to know the rate. So this is the plain quotient of samples and ticks between the first tick of a span and the newest.
Each tick was counted within one tick of its sample, at either end and rounded the same way, so the quotient is wrong by
less than one tick in the span: a bound, not a likelihood. The span ends up between one and two times SPAN_S long, so
that the rate is that of now.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.samples import TICK_EVERY, TICK_HZ

SPAN_S = 600.0
"""A tick is then worth 1.6 ppm: less than crystals change within it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """Samples a second of the device's own clock; the true rate lies within the uncertainty."""

    hz: float
    uncertainty_hz: float


class RateSpan:
    """The span of ticks that tells the rate. Its attributes are plain data, for snapshots."""

    def __init__(self) -> None:
        self.anchors: list[tuple[int, int]] = []
        """Stretch and full tick at its first sample: where the span begins, and where the next one will."""
        self.newest: tuple[int, int] | None = None

    @property
    def rate(self) -> Rate | None:
        """The rate over the span; None until two ticks are known."""
        if self.newest is None or self.newest == self.anchors[0]:
            return None
        (since, first), (at, last) = self.anchors[0], self.newest
        ticks = last - first
        hz = (at - since) * TICK_EVERY * TICK_HZ / ticks
        return Rate(hz=hz, uncertainty_hz=hz / ticks)

    def observe(self, stretch: int, tick: int) -> None:
        """Take the full tick at the first sample of a stretch later than those before."""
        if self.newest is not None and not 0 < tick - self.newest[1] < SPAN_S * TICK_HZ:
            self.anchors = []  # away for so long that its rate may have changed, or a clock that does not run
        self.newest = (stretch, tick)
        if not self.anchors or tick - self.anchors[-1][1] >= SPAN_S * TICK_HZ:
            self.anchors = [*self.anchors[-1:], self.newest]
