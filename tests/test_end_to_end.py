"""Real wrist recordings through GATT, bleak, the pipeline and the WebSocket: exactly the steps of a direct run."""

import asyncio
import json
import math

import numpy as np
import pytest
from fakes import described
from stage import default_tracker, staged

from device_sim.bracelet import Bracelet
from device_sim.gatt import Start
from device_sim.source import RecordingSource
from service.counters.registry import DEFAULT, make
from service.recordings import read
from service.samples import Packet, RawBlock, StepCounted
from service.signals.timebase import Timebase
from service.wearables import bracelet as wire

MTU = 517

PLAYED = [
    ("eth2022_wrist/10_hand_moving_60.npz", 1.0),
    ("eth2023_wrist/labeled_01.npz", 20.0),
    ("banglejs_walk/walk_100.npz", 40.0),
    ("banglejs_walk/walk_100_2.npz", math.inf),
    ("pebble_wrist/walk_100_pbl_25296_1.npz", math.inf),
]


def direct(recording):
    """Steps of the Tracker on the very packets a bracelet makes of the recording: (device_s, steps) each."""
    bracelet = Bracelet(RecordingSource(recording))
    tracker = default_tracker(wire.Bracelet())
    for packet in described(rate_hz=bracelet.rate_hz):
        tracker.apply(packet)
    events = []
    while not bracelet.ended:
        bracelet.measure(10)
        while (data := bracelet.next_packet(MTU)) is not None:
            events += tracker.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
    return [(event.step.at_s, event.steps) for event in events if isinstance(event, StepCounted)], tracker


def from_file(recording):
    """Steps of the same counter on the file's own values, evenly spaced but unquantised."""
    source = RecordingSource(recording)
    acc_g = source.read(10 * len(recording))
    columns = tuple(np.ascontiguousarray(acc_g[:, axis]) for axis in range(3))
    samples, _ = Timebase(source.rate_hz).feed(RawBlock(boot=1, index=0, tick=None, acc_g=columns))
    counter = make(DEFAULT)
    return len(counter.update(samples).steps)


async def hear_steps(feed, heard):
    async for text in feed:
        message = json.loads(text)
        if message["type"] == "step":
            heard.append((message["device_s"], message["steps"]))


async def over_the_air(recording, speed, samples):
    """Steps heard on the WebSocket while a bracelet plays the recording: (device_s, steps) each."""
    heard = []
    bracelet = Bracelet(RecordingSource(recording))
    async with staged(bracelet, speed=speed, start=Start.ON_SUBSCRIBE, durable_limit=100_000) as stage:
        async with stage.live() as feed:
            reader = asyncio.create_task(hear_steps(feed, heard))
            async with asyncio.timeout(recording.duration_s / min(speed, 20) + 30):
                await stage.bracelet.played.wait()
            device = await stage.until(
                lambda device: device["samples"] == samples and device["steps"] == len(heard), within_s=30
            )
            reader.cancel()
        assert (device["samples_lost"], device["packets_bad"], device["packets_duplicate"]) == (0, 0, 0)
    return heard


@pytest.mark.full
@pytest.mark.parametrize(("name", "speed"), PLAYED)
async def test_the_feed_gives_exactly_the_steps_of_a_direct_run(recordings, name, speed):
    recording = read(recordings / name)
    expected, tracker = direct(recording)
    assert len(expected) > 20
    assert await over_the_air(recording, speed, tracker.tally.samples) == expected


@pytest.mark.full
@pytest.mark.parametrize("name", [name for name, _ in PLAYED])
def test_quantisation_to_16_bits_changes_no_count(recordings, name):
    """At 4096 LSB/g a value moves by at most 0.12 mg; the README says these five agree."""
    recording = read(recordings / name)
    assert len(direct(recording)[0]) == from_file(recording)
