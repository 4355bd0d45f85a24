"""The fold: a device's samples, believed and in order, through the grid and the counters; events come out.

Pure: no I/O, no clock, no packets. The same samples give the same steps, whichever way they came: so a Tracker, one
that awaits samples and one that reads a store all count alike. `snapshot` is the whole state; `fork` a second fold that
goes on from it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from service.counters.contract import StepCounter
from service.errors import CounterError
from service.events import (
    Counting,
    Event,
    Gridded,
    Rebooted,
    Segmented,
    Signal,
    StepCounted,
    Tentative,
    Walked,
)
from service.samples import GRID_HZ, DeviceInfo, Gait, Likely, RawBlock, Sensors, Step, Update, Verdict
from service.signals.heading import WalkingDirection
from service.signals.rate import Rate
from service.signals.timebase import Timebase
from service.tracking.cadence import Cadence
from service.tracking.cutting import cut, pieces
from service.tracking.fitness import Stream, faults
from service.tracking.intake import info_after, info_of, merged
from service.tracking.refused import Refused
from service.tracking.tally import Tally
from service.tracking.tentative import TentativeSteps
from service.tracking.walking import Walking

PIECE_SAMPLES: Final = 20
"""A primary that recognises walking is given so much at a time, less than its frame: no verdict passes unheard."""

CounterFactory = Callable[[], StepCounter]


class Fold:
    """Counts one device's steps. Gaps, what they lost and reboots go into `tally`.

    `counters` makes each counter by name; `primary` names the one whose count is the device's `steps`.
    """

    def __init__(self, counters: Mapping[str, CounterFactory], *, primary: str, tally: Tally | None = None) -> None:
        self.primary = primary
        self.info = DeviceInfo()
        """What the device had said by the newest sample."""
        self.steps = dict.fromkeys(counters, 0)
        self.steps_now = 0
        self.counter_faults: dict[str, str] = {}
        """Why a counter does not count, as a sentence: a sensor that the device does not send, or too low a rate."""
        self.run = 0
        self.boot: int | None = None
        self.next_index: int | None = None
        """Index of the sample it awaits, unwrapped; None before the first of a boot."""
        self.tentative = TentativeSteps()
        self._tally = Tally() if tally is None else tally
        self._segment = (0, 0)
        """The device's steps when the primary took over, and the primary's own count then."""
        self._judged: object = None
        self._held: Sensors | None = None
        self._measured_hz = 0.0
        """What the newest block held, and the rate after it."""
        self._factories = dict(counters)
        self._counters = {name: make() for name, make in counters.items()}
        self._cadence = Cadence()
        self._walking, self._refused = self._gate()
        self._recognises = True
        """Whether the primary has a verdict; it is believed to until it has counted a block and told none."""
        self._heading = WalkingDirection()
        self._timebase: Timebase | None = None

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
        """Steps a minute now, by the primary's own word where it has one; None while nobody walks."""
        if self.gait is None:
            return self._cadence.spm(self.now_s)
        return None if self.gait.cadence_hz is None else 60 * self.gait.cadence_hz

    @property
    def gait(self) -> Gait | None:
        """What the primary makes of the motion; None where it does not recognise walking, or cannot count."""
        return self._walking.gait

    @property
    def refused(self) -> dict[str, dict[Verdict, int]]:
        """How many steps of other counters the primary refused, by what it made of the motion."""
        return self._refused.counts

    @property
    def measured_rate_hz(self) -> float | None:
        """The rate that samples are placed by: the nominal one until the device's clock disproves it."""
        return self._timebase.measured_rate_hz if self._timebase else None

    @property
    def rate(self) -> Rate | None:
        """The sampling rate as the ticks tell it, and how well; None until this boot has told two."""
        return self._timebase.rate if self._timebase else None

    @property
    def stream(self) -> Stream:
        """What is known of what the device sends."""
        rates = [rate_hz for rate_hz in (self.info.rate_hz, self.measured_rate_hz) if rate_hz is not None]
        return Stream(has=self.info.sensors, holds=self._held, rate_hz=min(rates, default=None))

    def describe(self, said: DeviceInfo) -> None:
        """Take what the device says of itself, before the sample awaited."""
        if self._timebase and said.clock is not None:
            self._timebase.set_clock(*said.clock)
        info = merged(self.info, said)
        if info != self.info:
            self.info = info
            self._judge()

    def begin_boot(self, boot: int) -> list[Event]:
        """End what was counted, begin device time anew; the counts go on."""
        previous = boot if self.boot is None else self.boot
        self._tally.reboots += 1
        events = self._finish_counters()
        self._counters = {name: make() for name, make in self._factories.items()}
        self._cadence, self.tentative = Cadence(), TentativeSteps()
        self._timebase, self.next_index, self._heading = None, None, WalkingDirection()
        self.info = info_after(self.info, boot, previous)
        self.boot = boot
        self.run += 1
        return [*events, Rebooted(boot=boot, previous=previous)]

    def count(self, block: RawBlock) -> list[Event]:
        """Place a block of the same boot on the grid and run the counters over what is new of it."""
        expected = self.next_index
        if expected is None:
            self.boot = block.boot
        elif block.index < expected:
            fresh = cut(block, expected, block.index + len(block))
            if fresh is None:
                return []
            block = fresh
        timebase = self._timebase or self._begin_timebase()
        samples, gap = timebase.feed(block)
        self.next_index = block.index + len(block)
        if block.sensors is not self._held or timebase.measured_rate_hz != self._measured_hz:
            self._held, self._measured_hz = block.sensors, timebase.measured_rate_hz
            self._judge()
        events: list[Event] = []
        if gap is not None:
            self._tally.gaps += 1
            self._tally.samples_lost += gap.samples
            events.append(gap)
        self._heading.update(samples)
        events.append(Gridded(block=samples))
        pending = self.steps_now - self.total if self.primary in self.counter_faults else 0
        for name in [name for name in self._counters if name not in self.counter_faults]:
            cut_to = PIECE_SAMPLES if name == self.primary and self._recognises else len(samples)
            try:
                updates = [self._counters[name].update(piece) for piece in pieces(samples, cut_to)]
            except CounterError as fault:
                self.counter_faults[name] = str(fault)
                continue
            events += [event for update in updates for event in self._take(name, update)]
            if name == self.primary:
                pending = updates[-1].pending
                self._recognises = updates[-1].gait is not None or not len(samples)
                events += _signal(updates)
        if self.primary in self.counter_faults:
            events += self._recognise(None)
        self._refused.settle()
        events.append(self._counting(pending))
        return events

    def likely(self) -> list[Tentative]:
        """Return the primary's steps that were told as likely and are still open."""
        return self._placed(self.tentative.open.values())

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
            self._refused.keep(kept)
            return events
        events += self._recognise(None)
        self.primary, self._segment = primary, (before, self.steps[primary])
        self._cadence = Cadence()
        self._walking, self._refused = self._gate()
        self._recognises = True
        events += self._follow((), ())
        return [*events, Segmented(primary=primary, steps=before), self._counting(0)]

    def finish(self) -> list[Event]:
        """End the stream: decide what is still pending."""
        return [*self._finish_counters(), self._counting(0)]

    def snapshot(self) -> dict[str, Any]:
        """Return the whole state as plain data."""
        return {
            "info": dataclasses.asdict(self.info),
            "steps": dict(self.steps),
            "steps_now": self.steps_now,
            "segment": list(self._segment),
            "cadence": self._cadence.snapshot(),
            "walking": self._walking.snapshot(),
            "refused": self._refused.snapshot(),
            "tentative": self.tentative.snapshot(),
            "heading": self._heading.snapshot(),
            "run": self.run,
            "boot": self.boot,
            "next_index": self.next_index,
            "counter_faults": dict(self.counter_faults),
            "timebase": self._timebase.snapshot() if self._timebase else None,
            "counters": {name: counter.snapshot() for name, counter in self._counters.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a snapshot's state; SnapshotError where its counters are not ours."""
        for name, counter in self._counters.items():
            counter.restore(state["counters"][name])
        self.info = info_of(state["info"])
        self.steps, self.steps_now = dict(state["steps"]), state["steps_now"]
        before, own = state["segment"]
        self._segment = (before, own)
        self._cadence.restore(state["cadence"])
        self._walking.restore(state["walking"])
        self._refused.restore(state["refused"])
        self.tentative.restore(state["tentative"])
        self._heading.restore(state["heading"])
        self.run, self.boot, self.next_index = state["run"], state["boot"], state["next_index"]
        self.counter_faults = dict(state["counter_faults"])
        self._timebase = Timebase.restored(state["timebase"]) if state["timebase"] else None

    def fork(self) -> Fold:
        """Return a second fold that goes on from here; its gaps are not tallied."""
        made = Fold(self._factories, primary=self.primary)
        made.restore(self.snapshot())
        made._judged, made._held, made._measured_hz = self._judged, self._held, self._measured_hz
        return made

    def _judge(self) -> None:
        """Find the counters that cannot count what the device has or sends, where that may have changed."""
        stream = self.stream
        judged = (stream.has, stream.holds, stream.too_slow)
        if judged != self._judged:
            self._judged, self.counter_faults = judged, faults(self._counters, stream)

    def _begin_timebase(self) -> Timebase:
        timebase = self._timebase = Timebase(self.info.rate_hz or GRID_HZ)
        if self.info.clock is not None:
            timebase.set_clock(*self.info.clock)
        return timebase

    def _gate(self) -> tuple[Walking, Refused]:
        """Return what follows the primary's verdicts, afresh."""
        latency_s = self._counters[self.primary].latency_s
        return Walking(self.primary, latency_s), Refused(latency_s)

    def _recognise(self, gait: Gait | None) -> list[Walked]:
        """Take what the primary makes of the motion; return what begins or ends with it."""
        if gait is None and self.gait is None:
            return []
        self._refused.say(gait)
        return self._walking.follow(gait, self.boot or 0)

    def _take(self, name: str, update: Update) -> list[Event]:
        """Take what a counter says: of the primary, tentative steps first, so that each step has been told before."""
        events: list[Event] = []
        if name == self.primary:
            if update.gait is not None:
                events += self._recognise(update.gait)
            events += self._follow(update.likely, update.steps)
        for step in update.steps:
            self.steps[name] += 1
            events.append(
                StepCounted(
                    counter=name,
                    boot=self.boot or 0,
                    steps=self.steps[name],
                    step=step,
                    uncertainty_s=self._uncertainty_s(name),
                    heading=self._heading.at(step.at_s),
                )
            )
            if name == self.primary:
                self._cadence.add(step.at_s)
                self._refused.count(step.at_s)
            else:
                self._refused.count_beside(name, step.at_s)
        return events

    def _follow(self, likely: Sequence[Likely], confirmed: Sequence[Step]) -> list[Tentative]:
        """Tell what the primary calls likely, and take back what it does no more."""
        told = self.tentative.follow(self.primary, self.boot or 0, likely, confirmed)
        return self._placed(told) if told else []

    def _placed(self, told: Iterable[Tentative]) -> list[Tentative]:
        """Say how well the time of likely steps is known, and where they went."""
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
        events = [event for name, counter in self._counters.items() for event in self._take(name, counter.finish())]
        self._refused.end()
        return [*events, *self._recognise(None)]

    def _counting(self, pending: int) -> Counting:
        steps = self.total
        self.steps_now = steps + pending
        return Counting(
            now_s=self.now_s, steps=steps, steps_now=self.steps_now, cadence_spm=self.cadence_spm, gait=self.gait
        )


def _signal(updates: Sequence[Update]) -> list[Signal]:
    """Return what the primary's updates of one block show, as one: of two at once, only the second would be shown."""
    traced = [update for update in updates if len(update.trace)]
    bands = tuple(band for update in updates for band in update.bands)
    if not traced and not bands:
        return []
    values = traced[0].trace if len(traced) == 1 else [value for update in traced for value in update.trace]
    return [Signal(from_s=(traced or updates)[0].trace_from_s, values=values, bands=bands)]
