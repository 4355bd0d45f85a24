"""Row 2 of what must not break it: packets of any sizes give the real counters the same steps, times and state."""

import json
from functools import partial
from itertools import cycle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters import registry
from service.events import Rebooted, StepCounted
from service.samples import Packet, Sensor
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

SAMPLES = 840
"""Nearly 17 s: walking, rest, running."""
SIZES = st.lists(st.integers(1, 28), min_size=1, max_size=8)
"""At most what a packet of nine axes holds at MTU 517."""


def followed(sizes, names):
    """Tracker and steps after SAMPLES of one walker, sent in packets of these sizes by turns."""
    walker = Walker("normal:8,rest:2,run:10", seed=3, sensors=tuple(Sensor))
    bracelet = Bracelet(walker)
    tracker = Tracker(wire.Bracelet(), {name: partial(registry.make, name) for name in names}, primary=names[0])
    said = {
        wire.BOOT: bracelet.boot_value(),
        wire.SENSORS: bracelet.sensors_value(),
        wire.SCALE: bracelet.scale_value(),
        wire.RATE: bracelet.rate_value(),
        wire.CLOCK: bracelet.clock_value(),
    }
    packets = [Packet(characteristic=uuid, data=data, at_ns=0) for uuid, data in said.items()]
    left = SAMPLES
    for size in cycle(sizes):
        bracelet.packet_samples = min(size, left)
        bracelet.measure(bracelet.packet_samples)
        packets.append(Packet(characteristic=wire.DATA, data=bracelet.next_packet(mtu=517), at_ns=0))
        left -= bracelet.packet_samples
        if not left:
            break
    events = [event for packet in packets for event in tracker.apply(packet)]
    assert not any(isinstance(event, Rebooted) for event in events)
    return tracker, [event for event in events if isinstance(event, StepCounted)]


def check(sizes, names):
    whole, steps = followed([28], names)
    cut, same = followed(sizes, names)
    assert steps
    for name in names:
        assert [(e.steps, e.step) for e in same if e.counter == name] == [
            (e.steps, e.step) for e in steps if e.counter == name
        ]
    assert state(cut) == state(whole)


def state(tracker):
    """All of it but what says how often it was asked: packets, and which likely steps were told when."""
    snapshot = tracker.snapshot()
    del snapshot["tally"]["packets"], snapshot["tentative"]
    return json.dumps(snapshot, sort_keys=True)


@settings(max_examples=12, deadline=None)
@given(sizes=SIZES)
def test_packets_of_any_sizes_give_the_default_counter_the_same(sizes):
    check(sizes, [registry.DEFAULT])


@pytest.mark.full
@settings(max_examples=40, deadline=None)
@given(sizes=SIZES)
def test_packets_of_any_sizes_give_every_counter_the_same(sizes):
    check(sizes, list(registry.COUNTERS))
