"""The bracelet itself, without its radio: sensor, clocks, sample numbers, packets and the last ten minutes.

Pure state: whoever owns it says how many samples to measure and when to cut a packet, so its behaviour is the same at
any speed and without any clock. Samples are numbered from the boot on whether anybody listens or not, and kept until
the ring is full; lost is what can no longer be sent to anybody. Numbers are never given again.

Two errors of its clocks, in ppm, positive where fast. `drift_ppm`: its oscillator against true time; ticks, samples
and its UTC run fast alike, and only who paces it sees true time. `sensor_ppm`: its sensor against that oscillator, so
that samples come closer together than ticks and rate say. The wearer's time is the sensor's: at +100 ppm somebody
walks 0.01 % faster.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from device_sim.battery import Battery
from device_sim.rated import Rated
from device_sim.ring import Counts, Ring
from device_sim.source import Samples, Source
from device_sim.step_register import StepRegister
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
    encode_history,
    encode_rate,
    encode_register,
    encode_scale,
    encode_sensors,
    encode_utc,
    packet_sensors,
    samples_per_packet,
    tick_index,
)
from service.wearables.bracelet_control import FULL_SCALE, Records

PACKET_SAMPLES: Final = 8
"""0.16 s at 50 Hz: after a counter's filter and a peak's turn, 0.06 s, a quarter second leaves the radio 0.05 s."""
BUFFER_SAMPLES: Final = 512
"""What waits for the radio at most (10 s at 50 Hz); beyond it live data goes on at the newest, the rest is history."""
HISTORY_S: Final = 600.0
"""How much is kept: ten minutes."""
MAX_PPM: Final = 10_000.0
"""A clock that errs by more than 1 % is none."""
I16_MIN, I16_MAX = -32768, 32767


def quantise(values: Samples, lsb: float | NDArray[np.float64]) -> NDArray[np.int64]:
    """Return counts in LSB, rounded half to even and saturated to i16; `lsb` is per unit, of all or of each column."""
    return np.clip(np.rint(values * lsb), I16_MIN, I16_MAX).astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class BraceletStatistics:
    """Samples since power-on, over all boots: `measured` = sent + lost + waiting.

    `sent` ones were sent at least once, live or from history; `waiting` ones are held and still can be.
    """

    measured: int
    sent: int
    lost: int
    waiting: int
    saturated: int


class Bracelet:
    """A bracelet's state.

    `source` gives the samples; its battery lasts `battery_hours` (None: for ever). `packet_samples` is the most a live
    packet holds (0: as many as the MTU); `boot` is the number of the first boot and `index` that of its first sample
    (u32, for a test of the wrap). It keeps `history_s` seconds (0: none). `utc_ms` is what its own clock says at
    power-on, None where that is not set. Without `control` it is one of the first firmware: no control point, no
    history, no register.
    """

    manufacturer = "steplink"
    model = "simulated bracelet"
    firmware = "2"

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
        battery_hours: float | None = None,
        history_s: float = HISTORY_S,
        drift_ppm: float = 0.0,
        sensor_ppm: float = 0.0,
        utc_ms: int | None = None,
        control: bool = True,
    ) -> None:
        encode_device_id(device_id)  # raises here rather than at the first read
        if not 1 <= lsb_per_g <= 0xFFFF:
            raise ParameterError("lsb_per_g", lsb_per_g, "1 to 65535 LSB per g")
        if packet_samples < 0:
            raise ParameterError("packet_samples", packet_samples, "0 (fill the MTU) or more samples")
        if not 1 <= source.rate_hz <= 400:
            raise ParameterError("rate_hz", source.rate_hz, "1 to 400 samples per second")
        if not 0 <= history_s <= HISTORY_S:
            raise ParameterError("history_s", history_s, f"0 (none) to {HISTORY_S:g} s")
        for name, ppm in (("drift_ppm", drift_ppm), ("sensor_ppm", sensor_ppm)):
            if not abs(ppm) <= MAX_PPM:
                raise ParameterError(name, ppm, f"-{MAX_PPM:g} to {MAX_PPM:g} ppm")
        self.device_id = device_id
        self.boot = boot
        self.lsb_per_g = lsb_per_g
        self.packet_samples = packet_samples
        self.battery = Battery(battery_percent, battery_hours)
        self.control = control
        self.ended = False
        self._source = Rated(source)
        self._register = StepRegister(self._source)
        self._history_s = history_s if control else 0.0
        self._drift, self._sensor = (1 + Fraction(ppm) / 1_000_000 for ppm in (drift_ppm, sensor_ppm))
        self._utc = None if utc_ms is None else (utc_ms, index)
        self._measured = self._sent = self._lost = self._saturated = 0
        self._live = index
        """Number of the sample that is sent next as it comes."""
        self._begin(index)

    @property
    def rate_hz(self) -> float:
        """Samples per second, as it says itself."""
        return self._source.rate_hz

    @property
    def true_rate_hz(self) -> float:
        """Samples per second of true time."""
        return float(Fraction(self.rate_hz) * self._drift * self._sensor)

    @property
    def sensors(self) -> Sensors:
        """What it measures."""
        return self._source.sensors

    @property
    def steps(self) -> int:
        """What its step register shows."""
        return self._register.steps

    @property
    def now_s(self) -> float:
        """Time by its oscillator since boot."""
        return float(self._ring.next / self._ticking)

    @property
    def history_samples(self) -> int:
        """How many of its newest samples it keeps."""
        return round(self._history_s * self.rate_hz)

    def measure(self, n: int) -> int:
        """Take `n` more samples from the source; return how many there were, and end where there are fewer."""
        values = self._source.read(n)
        counts = quantise(values, self._lsb)
        self._saturated += int((np.abs(values * self._lsb - counts) > 1).any(axis=1).sum())
        self._register.take(values)
        self.battery.run(len(counts) / self.rate_hz)
        self._measured += len(counts)
        self._lost += self._ring.append(counts.astype(np.int16))
        self._live = max(self._live, self._ring.next - BUFFER_SAMPLES)
        self.ended = len(counts) < n
        return len(counts)

    def wanting(self, mtu: int) -> int:
        """Return how many samples are to be measured until the next packet is full at an MTU of `mtu` bytes."""
        return max(0, self._packet_size(mtu) - (self._ring.next - self._live))

    def next_packet(self, mtu: int) -> bytes | None:
        """Cut the next full packet; after the source's end also the rest of it; None where there is none yet."""
        size, waiting = self._packet_size(mtu), self._ring.next - self._live
        if waiting < size and not (self.ended and waiting):
            return None
        packet = self._packet(self._live, min(size, waiting), mtu, history=False)
        self._live += min(size, waiting)
        return packet

    def discard(self) -> None:
        """Send nothing live of what waits, as nobody listens; it is history, or lost where none is kept."""
        self._live = self._ring.next
        self._lost += self._ring.drop(self._ring.next - self.history_samples)

    def held(self) -> Records:
        """Return which samples it can send again."""
        samples = min(len(self._ring), self.history_samples)
        return Records(self.boot, (self._ring.next - samples) & 0xFFFFFFFF, samples)

    def holds(self, asked: Records) -> range:
        """Return the places, for `again`, of what is held of the records asked for; empty where there is nothing."""
        samples = self.held().samples
        if asked.boot != self.boot or not samples:
            return range(0)
        oldest = self._ring.next - samples
        ahead = (asked.first - oldest + (1 << 31)) % (1 << 32) - (1 << 31)
        return range(oldest + max(ahead, 0), oldest + max(min(ahead + asked.samples, samples), 0))

    def again(self, place: int, samples: int, mtu: int) -> tuple[bytes, int] | None:
        """Return a packet of at most `samples` from `place` on and how many it holds; None where that is gone."""
        if place < self._ring.first:
            return None
        size = min(samples, samples_per_packet(mtu, self.sensors))
        return self._packet(place, size, mtu, history=True), size

    def reset(self) -> None:
        """Boot again: numbers from 0 under the next boot number, nothing kept, no time. The wearer goes on walking."""
        self._utc = None
        self._renumber()

    def set_rate(self, rate_hz: float) -> None:
        """Measure at another rate from now on, under the next boot number."""
        if rate_hz != self.rate_hz:
            utc_ms = self.utc_ms()
            self._source.set_rate(rate_hz)
            self._renumber()
            self.set_utc(utc_ms)

    def set_range(self, range_g: int) -> None:
        """Measure ±`range_g` from now on, under the next boot number."""
        if self.lsb_per_g != FULL_SCALE // range_g:
            utc_ms = self.utc_ms()
            self.lsb_per_g = FULL_SCALE // range_g
            self._renumber()
            self.set_utc(utc_ms)

    def set_utc(self, utc_ms: int | None) -> None:
        """Set its clock; None: it does not know the time."""
        self._utc = None if utc_ms is None else (utc_ms, self._ring.next)

    def utc_ms(self) -> int | None:
        """Return the time by its own clock; None where it was never set."""
        if self._utc is None:
            return None
        since_ms, index = self._utc
        return since_ms + int((self._ring.next - index) * 1000 / self._ticking)

    def tick(self, index: int) -> int:
        """Return the full tick (1/1024 s of its oscillator since boot) at sample `index`."""
        return int(TICK_HZ * index / self._ticking)

    def statistics(self) -> BraceletStatistics:
        """Return what became of the samples."""
        return BraceletStatistics(
            measured=self._measured,
            sent=self._sent,
            lost=self._lost,
            waiting=self._ring.unsent,
            saturated=self._saturated,
        )

    def _begin(self, index: int) -> None:
        """Start numbering at `index`, with the rate and scale in force."""
        self._ticking = Fraction(self.rate_hz) * self._sensor
        """Samples per second of its oscillator."""
        self._lsb = np.repeat([_lsb(sensor, self.lsb_per_g) for sensor in self.sensors], 3)
        self._ring = Ring(max(BUFFER_SAMPLES, self.history_samples), len(self._lsb), index=index)
        self._live = index

    def _renumber(self) -> None:
        self._lost += self._ring.unsent
        self.boot = (self.boot + 1) & 0xFFFFFFFF
        self._register.clear()
        self._begin(0)

    def _packet(self, first: int, n: int, mtu: int, *, history: bool) -> bytes:
        sensors = packet_sensors(mtu, self.sensors)
        counts: Counts = self._ring.read(first, n)[:, : 3 * len(sensors)]
        self._sent += self._ring.mark_sent(first, n)
        return encode(
            DataPacket(
                boot=self.boot,
                index=first,
                tick=self.tick(tick_index(first)),
                counts=counts.tolist(),
                history=history,
                sensors=sensors,
            )
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
        index = tick_index(max(self._ring.next - 1, 0))
        return encode_clock(index, self.tick(index))

    def sensors_value(self) -> bytes:
        """Return what it measures, and the scales of gyroscope and magnetometer."""
        return encode_sensors(self.sensors, lsb_per_rad_s=DEFAULT_LSB_PER_RAD_S, lsb_per_100_ut=DEFAULT_LSB_PER_100_UT)

    def history_value(self) -> bytes:
        """Return how many samples it keeps."""
        return encode_history(self.history_samples)

    def register_value(self) -> bytes:
        """Return what its step register shows."""
        return encode_register(self._register.steps)

    def utc_value(self) -> bytes:
        """Return the time by its own clock."""
        return encode_utc(self.utc_ms() or 0)

    def battery_value(self) -> bytes:
        """Return the charge in percent."""
        return bytes([self.battery.percent])

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
