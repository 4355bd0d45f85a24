"""Stand-ins that are simple enough to be right by reading: a counter, and packets of a device that sends a ramp."""

from collections.abc import Iterable, Iterator

from service.counters.contract import Snapshot
from service.samples import ACCELEROMETER_ONLY, GRID_HZ, Gait, Packet, SampleBlock, Step, Update, Verdict
from service.wearables import bracelet as wire

EVERY = 25
"""The fake counter's step: each 25th grid sample, 120 steps a minute."""


class MetronomeCounter:
    """Counts a step at every 25th sample of the grid that it is given; pending while half way to the next."""

    name = "metronome"
    sensors = ACCELEROMETER_ONLY
    latency_s = 0.0
    time_error_s = 0.0

    def __init__(self):
        self.seen: list[tuple[int, int]] = []
        self._next = 0

    def update(self, block: SampleBlock) -> Update:
        self.seen.append((block.start, len(block)))
        ks = range(block.start, block.start + len(block))
        self._next = ks.stop
        steps = tuple(Step(at_s=k / GRID_HZ, strength=1.0, interval_s=0.5) for k in ks if k % EVERY == 0)
        pending = int(self._next % EVERY > EVERY // 2)
        return Update(steps=steps, pending=pending, trace_from_s=block.start / GRID_HZ, trace=block.acc_g[0])

    def finish(self) -> Update:
        return Update()

    def snapshot(self) -> Snapshot:
        return {"next": self._next}

    def restore(self, state: Snapshot) -> None:
        self._next = state["next"]


FRAME = 24
"""The gate's verdict comes once in so many samples."""
RAMP = [(100, "rest"), (150, "perhaps"), (400, "other"), (500, "perhaps"), (1000, "walking")]
"""What the gate makes of the ramp that the fake device sends: up to which x, which verdict."""


class GateCounter(MetronomeCounter):
    """A metronome that recognises walking: it credits its steps of a walk, and the uncertain ones just before."""

    name = "gate"
    latency_s = 4.0

    def __init__(self):
        super().__init__()
        self._frame = 0
        self._waiting: list[int] = []
        self._gait = Gait(at_s=0.0, verdict=Verdict.REST, confidence=0.0, cadence_hz=None)

    def update(self, block: SampleBlock) -> Update:
        if block.start != self._next:
            self._frame = block.start
        self.seen.append((block.start, len(block)))
        self._next = block.start + len(block)
        steps: list[Step] = []
        for k in range(block.start, self._next):
            if k % EVERY == 0:
                self._waiting.append(k)
            if k - self._frame == FRAME - 1:
                self._frame = k + 1
                steps += self._decide(k, round(block.acc_g[0][k - block.start] * 4096))
        return Update(steps=tuple(steps), pending=len(self._waiting), gait=self._gait)

    def _decide(self, k: int, x: int) -> list[Step]:
        verdict = Verdict(next(word for until, word in RAMP if x < until))
        walks = verdict is Verdict.WALKING
        confidence = {Verdict.WALKING: 0.95, Verdict.PERHAPS: 0.6}.get(verdict, 0.05)
        self._gait = Gait(k / GRID_HZ, verdict, confidence, 2.0 if walks else None)
        if verdict is Verdict.PERHAPS:
            return []
        waiting, self._waiting = self._waiting, []
        return [Step(at_s=one / GRID_HZ, strength=1.0) for one in waiting if walks]

    def snapshot(self) -> Snapshot:
        return {"next": self._next, "frame": self._frame, "waiting": list(self._waiting), "gait": list(self._gait)}

    def restore(self, state: Snapshot) -> None:
        self._next, self._frame, self._waiting = state["next"], state["frame"], list(state["waiting"])
        at_s, verdict, confidence, cadence_hz = state["gait"]
        self._gait = Gait(at_s, Verdict(verdict), confidence, cadence_hz)


def described(
    *, device="dev-1", boot=1, lsb_per_g=4096, rate_hz=50.0, clock=(0, 0), sensors=ACCELEROMETER_ONLY
) -> Iterator[Packet]:
    """The values a host reads from a bracelet after connecting; one with an accelerometer only has no more to say."""
    more = {wire.SENSORS: wire.encode_sensors(sensors, lsb_per_rad_s=900, lsb_per_100_ut=6400)}
    values = {
        wire.DEVICE_ID: device.encode(),
        wire.BOOT: wire.encode_boot(boot),
        **(more if sensors != ACCELEROMETER_ONLY else {}),
        wire.SCALE: wire.encode_scale(lsb_per_g),
        wire.RATE: wire.encode_rate(rate_hz),
        wire.CLOCK: wire.encode_clock(*clock),
    }
    for uuid, data in values.items():
        yield Packet(characteristic=uuid, data=data, at_ns=0)


def tick_at(index: int, rate_hz: float = 50.0) -> int:
    """The tick a bracelet with an ideal clock tells in a packet that starts at `index`."""
    return int(wire.tick_index(index) * 1024 / rate_hz)


def data_packet(index: int, n: int = 10, *, boot=1, rate_hz=50.0, sensors=ACCELEROMETER_ONLY) -> Packet:
    """n samples of a ramp: x of each sensor is the sample's index modulo 1000, y 0, z 4096."""
    counts = [((index + i) % 1000, 0, 4096) * len(sensors) for i in range(n)]
    packet = wire.DataPacket(boot=boot, index=index, tick=tick_at(index, rate_hz), counts=counts, sensors=sensors)
    at_ns = round((index + n) / rate_hz * 1e9) + 1_700_000_000_000_000_000
    return Packet(characteristic=wire.DATA, data=wire.encode(packet), at_ns=at_ns)


def data_packets(sizes: Iterable[int], *, start=0, **how) -> Iterator[Packet]:
    """Packets of these sizes, one after the other."""
    index = start
    for n in sizes:
        yield data_packet(index, n, **how)
        index += n
