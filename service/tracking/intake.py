"""Intake: packets in, what can be believed of them out: samples with unwrapped indices, and what a device says.

It decodes, doubts, and tells one boot of the device from the next. In which order samples are counted, and what becomes
of holes, is for others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from service.errors import WireError, WireFault
from service.samples import DeviceInfo, Packet, RawBlock, Reply, Sensor
from service.tracking.doubt import Doubt, index_ahead
from service.tracking.tally import Tally
from service.wearables.contract import Wearable


@dataclass(frozen=True, slots=True, kw_only=True)
class Booted:
    """The device has started again: what follows is of another boot."""

    boot: int
    previous: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """The device described itself; `is_change` of what was known, `is_new` in this run."""

    info: DeviceInfo
    is_change: bool
    is_new: bool


Believed = RawBlock | Booted | Said | Reply


class Intake:
    """One device's packets. `next_index` is the newest believed sample's index and one more, None before the first."""

    def __init__(self, wearable: Wearable, tally: Tally) -> None:
        self.info = DeviceInfo()
        self.last_fault: WireError | None = None
        self.boot: int | None = None
        self.run = 0
        self.next_index: int | None = None
        self.tally = tally
        self._wearable = wearable
        self._doubt = Doubt()
        self._said: dict[str, bytes] = {}
        """Last value of each characteristic that describes the device: the codec's state, for a snapshot."""
        self._said_run: dict[str, int] = {}

    def take(self, packet: Packet) -> Sequence[Believed]:
        """Take one packet. Never raises for what a device sends."""
        said: RawBlock | DeviceInfo | Reply | None = None
        try:
            said = self._wearable.feed(packet.characteristic, packet.data)
            if isinstance(said, RawBlock):
                self.tally.packets += 1
                return self._judge(said)
        except WireError as fault:
            self.tally.packets += said is None
            self.tally.packets_bad += 1
            self.last_fault = fault
        if isinstance(said, DeviceInfo):
            return (self._describe(said, packet.characteristic, packet.data),)
        return () if not isinstance(said, Reply) else (said,)

    def hear(self, characteristic: str, data: bytes) -> Said | None:
        """Take a value by which the device described itself, from a store; None where it says nothing."""
        try:
            said = self._wearable.feed(characteristic, data)
        except WireError as fault:
            self.last_fault = fault
            return None
        return self._describe(said, characteristic, data) if isinstance(said, DeviceInfo) else None

    def follow(self, run: int, block: RawBlock) -> Booted | None:
        """Take note of a block that a store gives back."""
        booted = self._begin_boot(block.boot) if self.boot is not None and run != self.run else None
        self.run, self.boot = run, block.boot
        self._note(block)
        return booted

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data: all but where in the stream it is."""
        return {
            "said": {uuid: data.hex() for uuid, data in self._said.items()},
            "said_run": dict(self._said_run),
            "info": dataclasses.asdict(self.info),
            "doubt": self._doubt.snapshot(),
        }

    def restore(self, state: Mapping[str, Any], *, run: int, boot: int | None, next_index: int | None) -> None:
        """Take over a snapshot's state, at that place of the stream."""
        for uuid, data in state["said"].items():
            self.hear(uuid, bytes.fromhex(data))
        self._said_run = dict(state["said_run"])
        self.info = info_of(state["info"])
        self._doubt.restore(state["doubt"])
        self.run, self.boot, self.next_index = run, boot, next_index

    def _judge(self, block: RawBlock) -> Sequence[Believed]:
        """Return what can be believed of a block and of the one held before it."""
        rate_hz = self.info.rate_hz
        if rate_hz is None:
            raise WireError(WireFault.ORDER, "samples before the rate was read")
        awaited = self.next_index if block.boot == self.boot else None
        boots = [boot for boot in (self.boot, self.info.boot) if boot is not None]
        verdict = self._doubt.judge(block, boots=boots, awaited=awaited, rate_hz=rate_hz)
        self.tally.packets_bad += verdict.refused
        self.tally.packets_duplicate += verdict.repeated
        self.tally.packets_reordered += verdict.overtaken
        believed: list[Believed] = []
        if verdict.restarted:
            believed.append(self._begin_boot(block.boot))
        for one in verdict.blocks:
            if self.boot != one.boot:
                if self.boot is not None:
                    believed.append(self._begin_boot(one.boot))
                self.boot = one.boot
            believed.append(self._note(one))
        return believed

    def _note(self, block: RawBlock) -> RawBlock:
        """Unwrap a block's index."""
        newest = self.next_index
        if newest is None:
            self.next_index = block.index + len(block)
            return block
        index = newest + index_ahead(block.index, newest)
        if index != block.index:
            block = dataclasses.replace(block, index=index)
        self.next_index = max(newest, index + len(block))
        return block

    def _begin_boot(self, boot: int) -> Booted:
        previous = boot if self.boot is None else self.boot
        self.info = info_after(self.info, boot, previous)
        self.boot, self.next_index = boot, None
        self.run += 1
        return Booted(boot=boot, previous=previous)

    def _describe(self, said: DeviceInfo, characteristic: str, data: bytes) -> Said:
        place = self._said.get(characteristic), self._said_run.get(characteristic)
        self._said[characteristic], self._said_run[characteristic] = data, self.run
        info = merged(self.info, said)
        is_change = info != self.info
        self.info = info
        return Said(info=said, is_change=is_change, is_new=place != (data, self.run))


def merged(info: DeviceInfo, said: DeviceInfo) -> DeviceInfo:
    """Return `info` with what `said` tells."""
    told = {f.name: value for f in dataclasses.fields(said) if (value := getattr(said, f.name)) is not None}
    return dataclasses.replace(info, **told)


def info_after(info: DeviceInfo, boot: int, previous: int) -> DeviceInfo:
    """Return what is known of a device once boot `boot` has begun: its clock only if it was told of that boot."""
    if info.boot != boot or previous == boot:
        return dataclasses.replace(info, boot=boot, clock=None)
    return info


def info_of(state: Mapping[str, Any]) -> DeviceInfo:
    """Return the description that a snapshot holds as plain data."""
    clock, sensors = state["clock"], state["sensors"]
    return DeviceInfo(
        **{**state, "clock": clock and tuple(clock), "sensors": sensors and tuple(map(Sensor, sensors))},
    )
