"""Real wrist recordings through GATT, bleak, the pipeline and the WebSocket: exactly the steps of a direct run."""

import asyncio
import json
import math

import numpy as np
import pytest
from fakes import described
from stage import default_tracker, staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from device_sim.gatt import Start
from device_sim.source import RecordingSource
from service.counters.registry import DEFAULT, make
from service.events import StepCounted
from service.pipeline.lineup import lineup
from service.recordings import read
from service.samples import Packet, RawBlock, Sensor
from service.signals.timebase import Timebase
from service.tracking.tracker import Tracker
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


TURNING = ["gyro_zero_crossing", "fusion"]
"""Counters that need more than acceleration."""


@pytest.fixture(params=["walker", "eth2023_wrist/labeled_01.npz"])
def nine_axes(request):
    """What makes a source with all three sensors: a synthetic walker, a recording."""
    if request.param == "walker":
        return lambda: Walker("normal:40,rest:4,run:20,slow:20", seed=2, sensors=tuple(Sensor))
    recording = read(request.getfixturevalue("recordings") / request.param)
    return lambda: RecordingSource(recording, sensors=tuple(Sensor))


def direct_turning(source, mtu):
    """Steps (counter, device_s, steps) of the Tracker on the very packets that a bracelet makes of `source`."""
    bracelet = Bracelet(source)
    chosen = lineup(DEFAULT, beside=TURNING)
    tracker = Tracker(wire.Bracelet(), chosen.makers, primary=chosen.primary)
    for packet in described(rate_hz=bracelet.rate_hz, sensors=bracelet.sensors):
        tracker.apply(packet)
    events = []
    while not bracelet.ended:
        bracelet.measure(10)
        while (data := bracelet.next_packet(mtu)) is not None:
            events += tracker.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
    counted = [event for event in events if isinstance(event, StepCounted)]
    return sorted((event.counter, event.step.at_s, event.steps) for event in counted), tracker


@pytest.mark.full
@pytest.mark.parametrize("mtu", [517, 23])
async def test_counters_of_gyroscope_and_field_give_the_steps_of_a_direct_run(nine_axes, mtu):
    expected, tracker = direct_turning(nine_axes(), mtu)
    assert tracker.steps["gyro_zero_crossing"] > 20
    if isinstance(nine_axes(), RecordingSource) and mtu == 517:
        assert tracker.steps["fusion"] > 20
    assert list(tracker.counter_faults) == ([] if mtu == 517 else ["fusion"])
    samples, heard = tracker.tally.samples, []
    how = {"speed": math.inf, "start": Start.ON_SUBSCRIBE, "max_mtu": mtu, "beside": TURNING, "durable_limit": 100_000}
    async with staged(Bracelet(nine_axes()), **how) as stage, stage.live() as feed:
        reader = asyncio.create_task(hear_all_steps(feed, heard))
        async with asyncio.timeout(60):
            await stage.bracelet.played.wait()
        device = await stage.until(
            lambda device: device["samples"] == samples and sum(device["counters"].values()) == len(heard), within_s=30
        )
        reader.cancel()
    assert (device["samples_lost"], device["packets_bad"]) == (0, 0)
    assert device["counter_faults"] == tracker.counter_faults
    assert sorted(heard) == expected


async def hear_all_steps(feed, heard):
    async for text in feed:
        message = json.loads(text)
        if message["type"] == "step":
            heard.append((message["counter"], message["device_s"], message["steps"]))
