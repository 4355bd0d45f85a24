"""The truth that a disturbed run is held against: the very samples the bracelet played, counted by the pure Tracker."""

from functools import partial

import numpy as np
from fakes import described

from device_sim.bracelet import quantise
from device_sim.gait import Walker
from service.counters import registry
from service.events import Rebooted, StepCounted
from service.samples import GRID_HZ, TICK_HZ, Packet
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

PACKET_SAMPLES = 10
LSB_PER_G = wire.DEFAULT_LSB_PER_G


class Played:
    """What a bracelet plays from each of its boots on: a walker, at the machine's leisure."""

    def __init__(self, walk, seed):
        self._walker = Walker(walk, seed=seed, loop=True)
        self._counts = np.empty((0, 3), dtype=np.int64)

    def counts(self, first, end):
        """Samples [first, end) as the device counts."""
        while len(self._counts) < end:
            more = quantise(self._walker.read(max(end - len(self._counts), 10 * GRID_HZ)), LSB_PER_G)
            self._counts = np.vstack([self._counts, more])
        return self._counts[first:end]


class Undisturbed:
    """Counts samples of one run of the device after another, as far as it is told to; `steps` are those confirmed."""

    def __init__(self, played, counters):
        makers = {name: partial(registry.make, name, "tuned") for name in counters}
        self._tracker = Tracker(wire.Bracelet(), makers, primary=counters[0])
        self._played = played
        self._boot = self._next = None
        self.steps, self.reboots = {name: [] for name in counters}, 0

    def count(self, boot, first, end):
        """Count on up to sample `end` of a boot that was recorded from `first` on; never back."""
        if boot != self._boot:
            self._boot, self._next = boot, first
            at = wire.tick_index(first)
            for packet in described(device="sim-1", boot=boot, clock=(at, _tick(at))):
                self._apply(packet)
        assert self._next <= end
        for index in range(self._next, end, PACKET_SAMPLES):
            self._apply(self._packet(index, min(end, index + PACKET_SAMPLES)))
        self._next = end

    def _packet(self, index, end):
        counts = self._played.counts(index, end).tolist()
        data = wire.encode(
            wire.DataPacket(boot=self._boot, index=index, tick=_tick(wire.tick_index(index)), counts=counts)
        )
        return Packet(characteristic=wire.DATA, data=data, at_ns=0)

    def _apply(self, packet):
        for event in self._tracker.apply(packet):
            if isinstance(event, StepCounted):
                self.steps[event.counter].append((event.boot, event.steps, event.step))
            self.reboots += isinstance(event, Rebooted)


def _tick(index):
    return index * TICK_HZ // GRID_HZ
