"""The bracelet itself, without its radio: sensor, tick clock, sample numbers and packets.

Pure state: whoever owns it says how many samples to measure and when to cut a packet, so its behaviour is the same at
any speed and without any clock. Samples are numbered from the boot on whether anybody listens or not; what is
discarded is lost, and its numbers are not given again.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from device_sim.source import Samples, Source
from service.errors import ParameterError
from service.samples import TICK_HZ, Sensor, Sensors
from service.wearables.bracelet import (
    DEFAULT_LSB_PER_100_UT,
    DEFAULT_LSB_PER_G,
    DEFAULT_LSB_PER_RAD_S,
    DataPacket,
    encode,
    encode_boot,
    encode_clock,
    encode_device_id,
    encode_rate,
    encode_scale,
    encode_sensors,
    packet_sensors,
    samples_per_packet,
    tick_index,
)

PACKET_SAMPLES: Final = 8
"""0.16 s at 50 Hz: after a counter's filter and a peak's turn, 0.06 s, a quarter second leaves the radio 0.05 s."""
BUFFER_SAMPLES: Final = 512
"""What waits for the radio at most (10 s at 50 Hz); beyond it the oldest samples are lost."""
I16_MIN, I16_MAX = -32768, 32767


def quantise(values: Samples, lsb: float | NDArray[np.float64]) -> NDArray[np.int64]:
    """Return counts in LSB, rounded half to even and saturated to i16; `lsb` is per unit, of all or of each column."""
    return np.clip(np.rint(values * lsb), I16_MIN, I16_MAX).astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class BraceletStatistics:
    """Samples since power-on, over all boots: `measured` = sent + lost + waiting."""

    measured: int
    sent: int
    lost: int
    waiting: int
    saturated: int


class Bracelet:
    """A bracelet's state.

    `source` gives the samples; `packet_samples` is the most a packet holds (0: as many as the MTU); `boot` is the
    number of the first boot and `index` that of its first sample (u32, for a test of the wrap).
    """

    manufacturer = "steplink"
    model = "simulated bracelet"
    firmware = "1"

    def __init__(
        self,
        source: Source,
        *,
        device_id: str = "sim-1",
        boot: int = 1,
        index: int = 0,
        lsb_per_g: int = DEFAULT_LSB_PER_G,
        packet_samples: int = PACKET_SAMPLES,
        battery_percent: int = 100,
    ) -> None:
        encode_device_id(device_id)  # raises here rather than at the first read
        if not 1 <= lsb_per_g <= 0xFFFF:
            raise ParameterError("lsb_per_g", lsb_per_g, "1 to 65535 LSB per g")
        if packet_samples < 0:
            raise ParameterError("packet_samples", packet_samples, "0 (fill the MTU) or more samples")
        if not 1 <= source.rate_hz <= 400:
            raise ParameterError("rate_hz", source.rate_hz, "1 to 400 samples per second")
        self.device_id = device_id
        self.boot = boot
        self.lsb_per_g = lsb_per_g
        self.packet_samples = packet_samples
        self.battery_percent = battery_percent
        self.ended = False
        self._source = source
        self._rate = Fraction(source.rate_hz)
        self._lsb = np.repeat([_lsb(sensor, lsb_per_g) for sensor in source.sensors], 3)
        self._next = index
        self._waiting: deque[list[int]] = deque()
        self._measured = self._sent = self._lost = self._saturated = 0

    @property
    def rate_hz(self) -> float:
        """Samples per second of the bracelet's own clock."""
        return self._source.rate_hz

    @property
    def sensors(self) -> Sensors:
        """What it measures."""
        return self._source.sensors

    def measure(self, n: int) -> int:
        """Take `n` more samples from the source; return how many there were, and end where there are fewer."""
        values = self._source.read(n)
        counts = quantise(values, self._lsb)
        self._saturated += int((np.abs(values * self._lsb - counts) > 1).any(axis=1).sum())
        self._waiting.extend(counts.tolist())
        self._next += len(counts)
        self._measured += len(counts)
        self.ended = len(counts) < n
        while len(self._waiting) > BUFFER_SAMPLES:
            self._waiting.popleft()
            self._lost += 1
        return len(counts)

    def wanting(self, mtu: int) -> int:
        """Return how many samples are to be measured until the next packet is full at an MTU of `mtu` bytes."""
        return max(0, self._packet_size(mtu) - len(self._waiting))

    def next_packet(self, mtu: int) -> bytes | None:
        """Cut the next full packet; after the source's end also the rest of it; None where there is none yet."""
        size = self._packet_size(mtu)
        if len(self._waiting) < size and not (self.ended and self._waiting):
            return None
        index = self._next - len(self._waiting)
        sensors = packet_sensors(mtu, self.sensors)
        counts = [self._waiting.popleft()[: 3 * len(sensors)] for _ in range(min(size, len(self._waiting)))]
        self._sent += len(counts)
        tick = self.tick(tick_index(index))
        return encode(DataPacket(boot=self.boot, index=index, tick=tick, counts=counts, sensors=sensors))

    def discard(self) -> None:
        """Lose what waits: nobody listens, and this bracelet keeps no history."""
        self._lost += len(self._waiting)
        self._waiting.clear()

    def reset(self) -> None:
        """Boot again: a new boot number, samples and ticks from 0. The wearer goes on walking."""
        self.discard()
        self.boot = (self.boot + 1) & 0xFFFFFFFF
        self._next = 0

    def tick(self, index: int) -> int:
        """Return the full tick (1/1024 s since boot) at sample `index` of an ideal clock."""
        return int(TICK_HZ * index / self._rate)

    def statistics(self) -> BraceletStatistics:
        """Return what became of the samples."""
        return BraceletStatistics(
            measured=self._measured,
            sent=self._sent,
            lost=self._lost,
            waiting=len(self._waiting),
            saturated=self._saturated,
        )

    # Values of the characteristics that are read, as `service.wearables.bracelet` tables them.

    def scale_value(self) -> bytes:
        """Return LSB per g."""
        return encode_scale(self.lsb_per_g)

    def rate_value(self) -> bytes:
        """Return samples per second × 100."""
        return encode_rate(self.rate_hz)

    def boot_value(self) -> bytes:
        """Return the boot number."""
        return encode_boot(self.boot)

    def device_id_value(self) -> bytes:
        """Return the device id in UTF-8."""
        return encode_device_id(self.device_id)

    def clock_value(self) -> bytes:
        """Return index and full tick of the newest sample at which a tick was taken."""
        index = tick_index(max(self._next - 1, 0))
        return encode_clock(index, self.tick(index))

    def sensors_value(self) -> bytes:
        """Return what it measures, and the scales of gyroscope and magnetometer."""
        return encode_sensors(self.sensors, lsb_per_rad_s=DEFAULT_LSB_PER_RAD_S, lsb_per_100_ut=DEFAULT_LSB_PER_100_UT)

    def battery_value(self) -> bytes:
        """Return the charge in percent."""
        return bytes([self.battery_percent])

    def _packet_size(self, mtu: int) -> int:
        fits = samples_per_packet(mtu, self.sensors)
        return min(fits, self.packet_samples) if self.packet_samples else fits


def _lsb(sensor: Sensor, lsb_per_g: int) -> float:
    """Return LSB per g, rad/s or µT."""
    match sensor:
        case Sensor.ACCELEROMETER:
            return lsb_per_g
        case Sensor.GYROSCOPE:
            return DEFAULT_LSB_PER_RAD_S
        case Sensor.MAGNETOMETER:
            return DEFAULT_LSB_PER_100_UT / 100
