"""A source at the rate a bracelet was set to, as the sensor's own filter gives it.

At the source's rate its samples come as they are. A lower rate averages over the time between two samples, as an
accelerometer's decimation filter does, so that what is faster than the rate can show does not alias; a higher one
lies on straight lines between the source's samples: it holds nothing new.
"""

from __future__ import annotations

import math

import numpy as np

from device_sim.source import Samples, Source
from service.samples import Sensors


class Rated:
    """`source` at a rate that may change; time goes on through a change."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._rate_hz = source.rate_hz
        self._held: Samples = np.empty((0, 3 * len(source.sensors)))
        self._held_from = 0
        """The source's samples that may be needed again, and the number of the first of them."""
        self._origin = 0.0
        """Place, in samples of the source, of the first sample since the rate was set."""
        self._made = 0

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return self._rate_hz

    @property
    def sensors(self) -> Sensors:
        """What a sample holds."""
        return self._source.sensors

    @property
    def now_s(self) -> float:
        """Time of the source that has been read."""
        return (self._origin + self._made * self._step) / self._source.rate_hz

    def true_steps(self) -> int | None:
        """Return the steps taken so far; None where nobody knows."""
        return self._source.true_steps_until(self.now_s)

    def set_rate(self, rate_hz: float) -> None:
        """Go on at another rate, from the next sample of the source on."""
        self._origin = float(math.ceil(self._origin + self._made * self._step - 1e-6))
        self._made, self._rate_hz = 0, rate_hz

    def read(self, n: int) -> Samples:
        """Return the next n samples; fewer at the end, then none."""
        if self._step == 1 and not len(self._held) and self._held_from == self._origin + self._made:
            samples = self._source.read(n)
            self._made += len(samples)
            self._held_from += len(samples)
            return samples
        places = self._origin + (self._made + np.arange(n, dtype=np.float64)) * self._step
        self._fetch(places)
        places = places[places <= self._held_from + len(self._held) - 1]
        samples = self._averaged(places) if self._step > 1 else self._interpolated(places)
        self._made += len(samples)
        self._forget()
        return samples

    @property
    def _step(self) -> float:
        """Samples of the source between two of ours."""
        return self._source.rate_hz / self._rate_hz

    def _fetch(self, places: Samples) -> None:
        """Hold the source's samples up to the last of `places`."""
        wanted = math.ceil(places[-1]) + 1 if len(places) else 0
        missing = wanted - self._held_from - len(self._held)
        if missing > 0:
            self._held = np.concatenate([self._held, self._source.read(missing)])

    def _forget(self) -> None:
        """Let go of what no sample to come needs."""
        needed = math.floor(self._origin + self._made * self._step - max(1.0, self._step)) + 1
        gone = min(len(self._held), max(0, needed - self._held_from))
        self._held, self._held_from = self._held[gone:], self._held_from + gone

    def _interpolated(self, places: Samples) -> Samples:
        at = places - self._held_from
        before = np.floor(at).astype(np.int64)
        after = np.minimum(before + 1, len(self._held) - 1)
        share = (at - before)[:, np.newaxis]
        return self._held[before] * (1 - share) + self._held[after] * share

    def _averaged(self, places: Samples) -> Samples:
        """Return the mean of the source over the step that ends with each place, of what there is of it."""
        sums = np.concatenate([np.zeros((1, self._held.shape[1])), np.cumsum(self._held, axis=0)])
        numbers = np.arange(len(sums), dtype=np.float64)
        ends = places - self._held_from + 1
        starts = np.maximum(ends - self._step, 0.0)

        def until(at: Samples) -> Samples:
            return np.column_stack([np.interp(at, numbers, column) for column in sums.T])

        return (until(ends) - until(starts)) / (ends - starts)[:, np.newaxis]
