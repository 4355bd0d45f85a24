"""A device on a stand: the real session, tracker and counters, fed by a simulated bracelet's packets, without a link.

The stand's clock is host UTC in nanoseconds and goes only where it is told to; packets arrive `delay_s` after their
newest sample was taken.
"""

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.pipeline.device import Device
from service.pipeline.lifecycle import Cause
from service.pipeline.lineup import lineup
from service.samples import ACCELEROMETER_ONLY, Packet
from service.wearables import bracelet as wire

MTU = 185
START_NS = 1_800_000_000_000_000_000


class Stand:
    """One device; `schedule` is what its walker does, from the moment on that it is connected."""

    def __init__(
        self,
        schedule,
        *,
        device_id="sim-1",
        seed=3,
        delay_s=0.05,
        counter="double_threshold",
        sensors=ACCELEROMETER_ONLY,
        **options,
    ):
        self.now_ns = START_NS
        self.walker = Walker(schedule, seed=seed, sensors=sensors)
        self.bracelet = Bracelet(self.walker, device_id=device_id, packet_samples=10)
        self.told = []
        self.device = Device(
            address=f"{device_id}:address",
            name="Bracelet",
            rssi_dbm=-50,
            wearable=wire.Bracelet(),
            lineup=lineup(counter, **options),
            publish=self.told.append,
        )
        self.device.wanted = True
        self._delay_ns = round(delay_s * 1e9)
        self.connect()

    @property
    def true_steps(self):
        """Steps taken so far."""
        return self.walker.true_steps_until((self.now_ns - START_NS) / 1e9)

    def connect(self):
        self.device.move(Cause.ATTEMPT)
        self.device.move(Cause.CONNECTED)
        values = {
            wire.DEVICE_ID: self.bracelet.device_id_value(),
            wire.BOOT: self.bracelet.boot_value(),
            wire.SENSORS: self.bracelet.sensors_value(),
            wire.SCALE: self.bracelet.scale_value(),
            wire.RATE: self.bracelet.rate_value(),
            wire.CLOCK: self.bracelet.clock_value(),
        }
        for uuid, data in values.items():
            self.device.session.apply(Packet(characteristic=uuid, data=data, at_ns=self.now_ns))

    def lose(self, why="out of range"):
        self.device.move(Cause.DROPPED, why)

    def walk(self, seconds, *, heard=True):
        """Let time pass; the samples arrive or, unless `heard`, are lost."""
        for _ in range(round(seconds * 5)):
            self.now_ns += 200_000_000
            self.bracelet.measure(10)
            data = self.bracelet.next_packet(MTU)
            if heard and data is not None:
                packet = Packet(characteristic=wire.DATA, data=data, at_ns=self.now_ns + self._delay_ns)
                self.device.session.apply(packet)

    def until(self, holds, *, within_s=60):
        """Walk on until `holds()`; fail after `within_s`."""
        begin_ns = self.now_ns
        while not holds():
            assert self.now_ns < begin_ns + within_s * 1e9, "it does not come to that"
            self.walk(0.2)
