"""The Tracker: a pure fold over a device's packets, in order of (boot, index), that gives events.

Codec, timebase and counters in one synchronous object without I/O or clocks: the same packets give the same steps at
the same device times, whether they come live, from a store or on another machine. Bad packets are counted and
skipped; samples seen before are dropped; samples that arrive late, behind newer ones, are counted as such.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from service.counters.contract import StepCounter
from service.errors import CounterError, WireError, WireFault
from service.samples import (
    GRID_HZ,
    TICK_EVERY,
    Columns,
    Counting,
    Described,
    DeviceInfo,
    Event,
    Gridded,
    Likely,
    Packet,
    RawBlock,
    Rebooted,
    Reply,
    Segmented,
    Sensor,
    Sensors,
    Signal,
    Step,
    StepCounted,
    Update,
)
from service.signals.heading import WalkingDirection
from service.signals.timebase import Timebase
from service.tracking.cadence import Cadence
from service.tracking.doubt import Doubt, index_ahead
from service.tracking.fitness import Stream, faults
from service.tracking.tentative import TentativeSteps
from service.wearables.contract import Wearable

CounterFactory = Callable[[], StepCounter]


@dataclass(slots=True, kw_only=True)
class Tally:
    """What became of a device's packets and samples."""

    packets: int = 0
    packets_bad: int = 0
    packets_duplicate: int = 0
    packets_reordered: int = 0
    samples: int = 0
    samples_awaited: int = 0
    samples_lost: int = 0
    samples_saturated: int = 0
    gaps: int = 0
    reboots: int = 0


class Tracker:
    """Counts one device's steps.

    `counters` makes each counter by name; `primary` names the one whose count is the device's `steps`.
    """

    def __init__(self, wearable: Wearable, counters: Mapping[str, CounterFactory], *, primary: str) -> None:
        self.primary = primary
        self.info = DeviceInfo()
        self.tally = Tally()
        self.steps = dict.fromkeys(counters, 0)
        self.steps_now = 0
        self._segment = (0, 0)
        """The device's steps when the primary took over, and the primary's own count then."""
        self.last_fault: WireError | None = None
        self.counter_faults: dict[str, str] = {}
        """Why a counter does not count, as a sentence: a sensor that the device does not send, or too low a rate."""
        self._judged: object = None
        self._held: Sensors | None = None
        self._measured_hz = 0.0
        """What the newest block held, and the rate after it."""
        self._wearable = wearable
        self._factories = dict(counters)
        self._counters = {name: make() for name, make in counters.items()}
        self._cadence = Cadence()
        self._tentative = TentativeSteps()
        self._heading = WalkingDirection()
        self._timebase: Timebase | None = None
        self._boot: int | None = None
        self._next_index = 0
        self._doubt = Doubt()
        self._said: dict[str, bytes] = {}
        """Last value of each characteristic that describes the device: the codec's state, for a snapshot."""

    @property
    def now_s(self) -> float:
        """Device time of the newest sample, seconds after boot."""
        return self._timebase.now_s if self._timebase else 0.0

    @property
    def total(self) -> int:
        """The device's confirmed steps: the primary's of each segment, added up; never falls."""
        before, own = self._segment
        return before + self.steps[self.primary] - own

    @property
    def cadence_spm(self) -> float | None:
        """Steps a minute now; None while nobody walks."""
        return self._cadence.spm(self.now_s)

    @property
    def measured_rate_hz(self) -> float | None:
        """The device's sampling rate as its own clock tells it."""
        return self._timebase.measured_rate_hz if self._timebase else None

    @property
    def stream(self) -> Stream:
        """What is known of what the device sends."""
        rates = [rate_hz for rate_hz in (self.info.rate_hz, self.measured_rate_hz) if rate_hz is not None]
        return Stream(has=self.info.sensors, holds=self._held, rate_hz=min(rates, default=None))

    def apply(self, packet: Packet) -> list[Event]:
        """Take one packet; return what it tells. Never raises for what a device sends."""
        said: RawBlock | DeviceInfo | Reply | None = None
        try:
            said = self._wearable.feed(packet.characteristic, packet.data)
            if isinstance(said, RawBlock):
                self.tally.packets += 1
                return self._receive(said)
        except WireError as fault:
            self.tally.packets += said is None
            self.tally.packets_bad += 1
            self.last_fault = fault
        if not isinstance(said, DeviceInfo):
            return []
        self._said[packet.characteristic] = packet.data
        return self._describe(said)

    def change_counters(self, counters: Mapping[str, CounterFactory], *, primary: str) -> list[Event]:
        """Go on with other counters: equal ones as they are, the others afresh from the next sample on.

        Another primary, or other parameters of it, begin a new segment of the device's count. Where a counter cannot be
        built its error is raised, and nothing has changed.
        """
        kept = {name for name, make in counters.items() if self._factories.get(name) == make}
        running = {name: self._counters[name] if name in kept else make() for name, make in counters.items()}
        dropped = [name for name in self._counters if name not in kept]
        events = [event for name in dropped for event in self._take(name, self._counters[name].finish())]
        before = self.total
        self.steps = {name: self.steps[name] if name in kept else 0 for name in counters}
        self._counters, self._factories = running, dict(counters)
        self._judged = None
        self._judge()
        if primary == self.primary and primary in kept:
            return events
        self.primary, self._segment = primary, (before, self.steps[primary])
        self._cadence = Cadence()
        events += self._follow((), ())
        return [*events, Segmented(primary=primary, steps=before), self._counting(0)]

    def finish(self) -> list[Event]:
        """End the stream: decide what is still pending."""
        return [*self._finish_counters(), self._counting(0)]

    def snapshot(self) -> dict[str, Any]:
        """Return the whole state as plain data."""
        return {
            "said": {uuid: data.hex() for uuid, data in self._said.items()},
            "info": dataclasses.asdict(self.info),
            "tally": dataclasses.asdict(self.tally),
            "steps": dict(self.steps),
            "steps_now": self.steps_now,
            "segment": list(self._segment),
            "cadence": self._cadence.snapshot(),
            "tentative": self._tentative.snapshot(),
            "heading": self._heading.snapshot(),
            "boot": self._boot,
            "next_index": self._next_index,
            "counter_faults": dict(self.counter_faults),
            "doubt": self._doubt.snapshot(),
            "timebase": self._timebase.snapshot() if self._timebase else None,
            "counters": {name: counter.snapshot() for name, counter in self._counters.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state; SnapshotError where its counters are not ours."""
        for uuid, data in state["said"].items():
            self.apply(Packet(characteristic=uuid, data=bytes.fromhex(data), at_ns=0))
        info = state["info"]
        clock, sensors = info["clock"] and tuple(info["clock"]), info["sensors"] and tuple(map(Sensor, info["sensors"]))
        self.info = DeviceInfo(**{**info, "clock": clock, "sensors": sensors})
        for name, counter in self._counters.items():
            counter.restore(state["counters"][name])
        self.tally = Tally(**state["tally"])
        self.steps, self.steps_now = dict(state["steps"]), state["steps_now"]
        before, own = state["segment"]
        self._segment = (before, own)
        self._cadence.restore(state["cadence"])
        self._tentative.restore(state["tentative"])
        self._heading.restore(state["heading"])
        self._boot, self._next_index = state["boot"], state["next_index"]
        self.counter_faults = dict(state["counter_faults"])
        self._doubt.restore(state["doubt"])
        self._timebase = Timebase.restored(state["timebase"]) if state["timebase"] else None

    def _describe(self, said: DeviceInfo) -> list[Event]:
        told = {f.name: value for f in dataclasses.fields(said) if (value := getattr(said, f.name)) is not None}
        if self._timebase and said.clock is not None:
            self._timebase.set_clock(*said.clock)
        info = dataclasses.replace(self.info, **told)
        if info == self.info:
            return []
        self.info = info
        self._judge()
        return [Described(info=info)]

    def _receive(self, block: RawBlock) -> list[Event]:
        """Count what can be believed of a block and of the one held before it."""
        if self.info.rate_hz is None:
            raise WireError(WireFault.ORDER, "samples before the rate was read")
        awaited = self._next_index if self._timebase and block.boot == self._boot else None
        boots = {boot for boot in (self._boot, self.info.boot) if boot is not None}
        verdict = self._doubt.judge(block, boots=boots, awaited=awaited, rate_hz=self.info.rate_hz)
        self.tally.packets_bad += verdict.refused
        events = self._begin_boot(block.boot) if verdict.restarted else []
        return [*events, *(event for believed in verdict.blocks for event in self._count(believed))]

    def _count(self, block: RawBlock) -> list[Event]:
        """Place a block on the grid and run the counters over it."""
        events = self._follow_boot(block.boot)
        fresh = self._unseen(block)
        if fresh is None:
            self.tally.packets_duplicate += 1
            return events
        timebase = self._ready_timebase()
        samples, gap = timebase.feed(fresh)
        self._next_index = fresh.index + len(fresh)
        self.tally.samples += len(fresh)
        self.tally.samples_saturated += len(fresh.saturated)
        if fresh.sensors is not self._held or timebase.measured_rate_hz != self._measured_hz:
            self._held, self._measured_hz = fresh.sensors, timebase.measured_rate_hz
            self._judge()
        if gap is not None:
            self.tally.gaps += 1
            self.tally.samples_lost += gap.samples
            events.append(gap)
        self._heading.update(samples)
        events.append(Gridded(block=samples))
        pending = self.steps_now - self.total if self.primary in self.counter_faults else 0
        for name in [name for name in self._counters if name not in self.counter_faults]:
            try:
                update = self._counters[name].update(samples)
            except CounterError as fault:
                self.counter_faults[name] = str(fault)
                continue
            events += self._take(name, update)
            if name == self.primary:
                pending = update.pending
                if len(update.trace) or update.bands:
                    events.append(Signal(from_s=update.trace_from_s, values=update.trace, bands=update.bands))
        events.append(self._counting(pending))
        return events

    def _judge(self) -> None:
        """Find the counters that cannot count what the device has or sends, where that may have changed."""
        stream = self.stream
        judged = (stream.has, stream.holds, stream.too_slow)
        if judged != self._judged:
            self._judged, self.counter_faults = judged, faults(self._counters, stream)

    def _follow_boot(self, boot: int) -> list[Event]:
        if self._boot == boot:
            return []
        if self._boot is None:
            self._boot = boot
            return []
        return self._begin_boot(boot)

    def _begin_boot(self, boot: int) -> list[Event]:
        """End what was counted, begin device time anew; the counts go on."""
        previous = boot if self._boot is None else self._boot
        self.tally.reboots += 1
        events = self._finish_counters()
        self._counters = {name: make() for name, make in self._factories.items()}
        self._cadence, self._tentative = Cadence(), TentativeSteps()
        self._timebase, self._next_index, self._heading = None, 0, WalkingDirection()
        if self.info.boot != boot or previous == boot:
            self.info = dataclasses.replace(self.info, boot=boot, clock=None)
        self._boot = boot
        return [*events, Rebooted(boot=boot, previous=previous)]

    def _unseen(self, block: RawBlock) -> RawBlock | None:
        """Unwrap the block's index and cut off the samples seen before; None if it holds no others."""
        index = block.index
        if self._timebase is not None:
            index = self._next_index + index_ahead(block.index, self._next_index)
        seen = max(0, self._next_index - index) if self._timebase else 0
        if seen == 0:
            return block if index == block.index else dataclasses.replace(block, index=index)
        if seen >= len(block):
            return None
        # The tick is of the stretch the block began in; what is left of it may begin in the next.
        same_stretch = index // TICK_EVERY == (index + seen) // TICK_EVERY
        return dataclasses.replace(
            block,
            index=index + seen,
            tick=block.tick if same_stretch else None,
            saturated=[at - seen for at in block.saturated if at >= seen],
            acc_g=_cut(block.acc_g, seen),
            gyro_rad_s=_cut(block.gyro_rad_s, seen) if block.gyro_rad_s else None,
            mag_ut=_cut(block.mag_ut, seen) if block.mag_ut else None,
        )

    def _ready_timebase(self) -> Timebase:
        if self._timebase is None:
            self._timebase = Timebase(self.info.rate_hz or GRID_HZ)
            if self.info.clock is not None:
                self._timebase.set_clock(*self.info.clock)
        return self._timebase

    def _take(self, name: str, update: Update) -> list[Event]:
        """Take what a counter says: of the primary, tentative steps first, so that each step has been told before."""
        events: list[Event] = []
        if name == self.primary:
            events += self._follow(update.likely, update.steps)
        for step in update.steps:
            self.steps[name] += 1
            events.append(
                StepCounted(
                    counter=name,
                    boot=self._boot or 0,
                    steps=self.steps[name],
                    step=step,
                    uncertainty_s=self._uncertainty_s(name),
                    heading=self._heading.at(step.at_s),
                )
            )
            if name == self.primary:
                self._cadence.add(step.at_s)
        return events

    def _follow(self, likely: Sequence[Likely], confirmed: Sequence[Step]) -> list[Event]:
        """Tell what the primary calls likely, and take back what it does no more."""
        told = self._tentative.follow(self.primary, self._boot or 0, likely, confirmed)
        if not told:
            return []
        uncertainty_s = self._uncertainty_s(self.primary)
        return [
            dataclasses.replace(event, uncertainty_s=uncertainty_s, heading=self._heading.at(event.at_s))
            for event in told
        ]

    def _uncertainty_s(self, name: str) -> float:
        """Return how well the device time of this counter's steps is known."""
        timebase_s = self._timebase.uncertainty_s if self._timebase else 0.5 / GRID_HZ
        return timebase_s + self._counters[name].time_error_s

    def _finish_counters(self) -> list[Event]:
        return [event for name, counter in self._counters.items() for event in self._take(name, counter.finish())]

    def _counting(self, pending: int) -> Counting:
        steps = self.total
        self.steps_now = steps + pending
        return Counting(now_s=self.now_s, steps=steps, steps_now=self.steps_now, cadence_spm=self.cadence_spm)


def _cut(columns: Columns, seen: int) -> Columns:
    x, y, z = columns
    return x[seen:], y[seen:], z[seen:]
