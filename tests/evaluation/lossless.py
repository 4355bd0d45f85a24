"""A wearable whose packets carry every sensor unrounded: a Tracker must count of it what a whole file gives."""

import struct
from functools import partial

import numpy as np

from service.counters import registry
from service.evaluation.counting import raw_block
from service.events import StepCounted
from service.recordings import stated_rate_hz
from service.samples import TICK_EVERY, TICK_HZ, DeviceInfo, Packet, RawBlock
from service.tracking.tracker import Tracker

RATE, DATA = "rate", "data"
SENSORS = ("acc_g", "gyro_rad_s", "mag_ut")


class Lossless:
    """Packets of float64: index, tick, which sensors, then x, y, z of each."""

    services = ()

    def handshake(self):
        return ()

    def history(self, *_):
        return ()

    def feed(self, characteristic, data):
        if characteristic == RATE:
            return DeviceInfo(rate_hz=struct.unpack("<d", data)[0], boot=1)
        index, tick, mask = struct.unpack_from("<IHB", data)
        names = [name for bit, name in enumerate(SENSORS) if mask >> bit & 1]
        columns = np.frombuffer(data, "<f8", offset=7).reshape(3 * len(names), -1).tolist()
        values = {name: tuple(columns[3 * i : 3 * i + 3]) for i, name in enumerate(names)}
        return RawBlock(boot=1, index=index, tick=tick, **values)


def packets(recording, n=10):
    """The recording as packets of n samples, the last one shorter, with the ticks of an ideal clock."""
    block, rate_hz = raw_block(recording), stated_rate_hz(recording)
    yield Packet(characteristic=RATE, data=struct.pack("<d", rate_hz), at_ns=0)
    held = [(1 << bit, getattr(block, name)) for bit, name in enumerate(SENSORS) if getattr(block, name) is not None]
    mask = sum(bit for bit, _ in held)
    values = np.array([column for _, columns in held for column in columns])
    for index in range(0, values.shape[1], n):
        tick = int((index - index % TICK_EVERY) * TICK_HZ / rate_hz) & 0xFFFF
        data = struct.pack("<IHB", index, tick, mask) + values[:, index : index + n].astype("<f8").tobytes()
        yield Packet(characteristic=DATA, data=data, at_ns=0)


def live_steps(recording, variants, n=10):
    """Times of the steps that a Tracker with these (counter, preset) confirms: {variant: [s, …]}."""
    makers = {" ".join(variant): partial(registry.make, *variant) for variant in variants}
    tracker = Tracker(Lossless(), makers, primary=next(iter(makers)))
    found = {variant: [] for variant in variants}
    events = [event for packet in packets(recording, n) for event in tracker.apply(packet)] + tracker.finish()
    for event in events:
        if isinstance(event, StepCounted):
            found[tuple(event.counter.split())].append(event.step.at_s)
    return found
