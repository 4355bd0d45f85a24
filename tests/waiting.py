"""A device with history that is heard through a bad link, for the tests of what waits for samples."""

import json
from functools import partial

import numpy as np

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters import registry
from service.events import Rebooted, StepCounted, Tentative
from service.recordings import read
from service.samples import GRID_HZ, DeviceInfo, Packet, Reply, Sensor
from service.tracking.backfill import BackfillTracker
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

REPLY = "reply"
HISTORY = "history"


class Keeping(wire.Bracelet):
    """The bracelet's host side with what the tests say instead of a control point."""

    def feed(self, characteristic, data):
        if characteristic == HISTORY:
            return DeviceInfo(history_samples=int(data))
        if characteristic == REPLY:
            accepted, boot, first, samples = (int(word) for word in data.split())
            return Reply(request="history", accepted=bool(accepted), boot=boot, first=first, samples=samples)
        return super().feed(characteristic, data)


def heard(characteristic, text):
    return Packet(characteristic=characteristic, data=str(text).encode(), at_ns=0)


def makers(names):
    return {name: partial(registry.make, name) for name in names}


def waiting(names=("double_threshold",)):
    return BackfillTracker(Keeping(), makers(names), primary=names[0])


def plain(names=("double_threshold",)):
    return Tracker(Keeping(), makers(names), primary=names[0])


class Device:
    """What a device measured of a walk: the values it describes itself by, and any packet of its samples."""

    def __init__(self, seconds=60, *, script=None, seed=3, sensors=(Sensor.ACCELEROMETER,), keeps=30_000, boot=1):
        part = script or "normal:9,rest:2,run:8,slow:7"
        bracelet = Bracelet(Walker(",".join([part] * (seconds // 20 + 1)), seed=seed, sensors=sensors))
        self.sensors, self.boot, self.keeps, self.rate_hz = sensors, boot, keeps, float(GRID_HZ)
        said = {
            wire.BOOT: wire.encode_boot(boot),
            wire.SENSORS: bracelet.sensors_value(),
            wire.SCALE: bracelet.scale_value(),
            wire.RATE: bracelet.rate_value(),
            wire.CLOCK: wire.encode_clock(0, 0),
        }
        self.said = [Packet(characteristic=uuid, data=data, at_ns=0) for uuid, data in said.items()]
        if keeps:
            self.said.append(heard(HISTORY, keeps))
        self.samples = seconds * GRID_HZ
        self.counts = []
        while len(self.counts) < self.samples:
            bracelet.packet_samples = 20
            bracelet.measure(20)
            data = bracelet.next_packet(mtu=517)
            block = wire._values(data, sensors)
            width = 3 * len(sensors)
            self.counts += [block[i : i + width] for i in range(0, len(block), width)]

    @classmethod
    def of(cls, path, *, keeps=30_000):
        """A device that measured a recording, as far as it is evenly spaced."""
        recording = read(path)
        made = cls(0, keeps=keeps)
        made.rate_hz = round(recording.rate_hz, 2)
        made.counts = np.rint(recording.acc_g * 4096).astype(int).tolist()
        made.samples = len(made.counts)
        made.said = [p for p in made.said if p.characteristic != wire.RATE]
        made.said.append(Packet(characteristic=wire.RATE, data=wire.encode_rate(made.rate_hz), at_ns=0))
        return made

    def __repr__(self):
        return f"Device(boot={self.boot}, keeps={self.keeps})"

    def packet(self, index, n, *, history=False, base=0):
        """n samples from `index` on; the wire tells `base` more."""
        n = min(n, self.samples - index)
        tick = int(wire.tick_index(base + index) * 1024 / self.rate_hz)
        told = wire.DataPacket(
            boot=self.boot,
            index=(base + index) % 2**32,
            tick=tick,
            counts=self.counts[index : index + n],
            history=history,
            sensors=self.sensors,
        )
        return Packet(characteristic=wire.DATA, data=wire.encode(told), at_ns=0)

    def live(self, n=10, *, start=0, base=0):
        return [self.packet(index, n, base=base) for index in range(start, self.samples, n)]

    def history(self, missing, n=28):
        """What it sends when asked: packets of history and the reply."""
        end = min(missing.first + missing.samples, self.samples)
        return [
            *(self.packet(i, min(n, end - i), history=True) for i in range(missing.first, end, n)),
            heard(REPLY, f"1 {self.boot} {missing.first} {end - missing.first}"),
        ]


def run(tracker, packets, *, slices=256):
    """Apply packets and catch up after each."""
    events = []
    for packet in packets:
        events += tracker.apply(packet)
        while tracker.has_work if isinstance(tracker, BackfillTracker) else False:
            events += tracker.catch_up(slices)
    return events


def ask(tracker, device, lose=lambda _: False, *, rounds=1000, slices=256):
    """Ask for what is wanted until nothing is."""
    events = []
    for _ in range(rounds):
        missing = tracker.wanted()
        if missing is None:
            return events
        tracker.ask(missing)
        events += run(
            tracker, [p for p in device.history(missing) if p.characteristic == REPLY or not lose(p)], slices=slices
        )
    raise AssertionError("it asks for ever")


def fold_state(tracker):
    """All of a snapshot that the order of packets must not change; a likely step's strength is as it was first told."""
    state = json.loads(json.dumps(tracker.snapshot()))
    told, confirmed_s = state["tentative"]
    state["tentative"] = [at_s for _, _, at_s, _, _ in told], confirmed_s
    return {key: value for key, value in state.items() if key not in {"tally", "intake"}}


def steps_of(events):
    return [(e.counter, e.boot, e.steps, e.step) for e in events if isinstance(e, StepCounted)]


def check_order(events, primary):
    """Each step of the primary's is told as likely, then retracted or confirmed."""
    told = set()
    confirmed = set()
    for event in events:
        if isinstance(event, Rebooted):  # perhaps with the same boot number
            assert not told
            confirmed.clear()
        elif isinstance(event, Tentative):
            key = event.counter, event.boot, event.at_s
            if event.retracted:
                assert key in told
                told.remove(key)
            else:
                assert key not in told
                assert key not in confirmed
                told.add(key)
        elif isinstance(event, StepCounted) and event.counter == primary:
            key = event.counter, event.boot, event.step.at_s
            assert key in told
            told.remove(key)
            confirmed.add(key)
    return told


def storm(device, rng, *, n=10, loss=0.0, burst=1, late=0, repeat=0.0, start=0):
    """Live packets as they arrive through a bad link, as (index, packet); the first and the last six get through."""
    indices = list(range(start, device.samples, n))
    arriving, left = [], 0
    for place, index in enumerate(indices):
        if 0 < place < len(indices) - 6:
            left = burst if not left and rng.random() < loss / burst else left
            if left:
                left -= 1
                continue
        at = place + (rng.random() * late if 0 < place < len(indices) - 6 else 0.0)
        arriving.append((at, index))
        if rng.random() < repeat:
            arriving.append((at + rng.random() * 5, index))
    return [(index, device.packet(index, n)) for _, index in sorted(arriving)]


def heal(tracker, device, packets, rng, *, lose=0.0, slices=256, sizes=(28,)):
    """Apply `packets`; what the tracker wants comes from history meanwhile, a packet for each live one, some lost."""
    events, queue = [], []
    for packet in packets:
        events += run(tracker, [packet], slices=slices)
        if (missing := tracker.wanted()) is not None:
            tracker.ask(missing)
            *sent, reply = device.history(missing, rng.choice(sizes))
            rng.shuffle(sent)
            queue += [*sent, *rng.sample(sent, len(sent) // 3), reply]
        if queue:
            arrived = queue.pop(0)
            if arrived.characteristic == REPLY or rng.random() >= lose:
                events += run(tracker, [arrived], slices=slices)
    return events + run(tracker, queue, slices=slices) + ask(tracker, device, slices=slices)
