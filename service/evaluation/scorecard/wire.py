"""The same recording through packets and a Tracker: sent once, sent again, and with packets lost for good.

Packets are the bracelet's own, ten samples of acceleration each at the recording's rate, with the ticks of an ideal
clock. Re-sent means that after every fourth packet the last three come once more, late and out of order: the count
must be identical. Lost packets are single ones, drawn from the recording's name. The undisturbed count beside which
these stand is that of the same packets, sent once.

The Tracker says which samples it gives its counters, and where some are missing; each counter counts those, as much at
a time as there is without a hole. That is the count it would have had live, since no counter may depend on how a
stream is cut, and a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from service.counters import registry
from service.counters.streaming import COMPILED_FROM
from service.evaluation.counting import part, streamed
from service.evaluation.rows import Choice
from service.evaluation.scorecard.sampled import Sampled, columns, stacked
from service.events import Gridded
from service.samples import TICK_HZ, Packet, SampleBlock, Sensor
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

PACKET_SAMPLES: Final = 10
RESENT_EVERY: Final = 4
RESENT: Final = 3

CHEAPEST: Final = "double_threshold"
"""A Tracker has at least one counter."""

ONCE: Final = "packets, sent once"
TWICE: Final = "packets re-sent"
LOSSES_PERCENT: Final = (1, 5, 10)
ASKED_PERCENT: Final = 5
AXIS: Final = "loss"


def loss_name(percent: int) -> str:
    """Return what a loss of so many percent of the packets is called."""
    return f"{percent} % lost"


def counts(of: Sampled, chosen: Sequence[Choice], seed: int) -> dict[str, dict[str, int]]:
    """Return, by way of sending, the steps of each counter that needs nothing but acceleration."""
    able = [choice for choice in chosen if registry.kind(choice.counter).sensors == {Sensor.ACCELEROMETER}]
    if not able:
        return {}
    sent = packets(of)
    ways: dict[str, Iterable[Packet]] = {ONCE: sent, TWICE: again(sent)}
    ways |= {loss_name(percent): without(sent, percent, seed) for percent in LOSSES_PERCENT}
    found: dict[str, dict[str, int]] = {}
    for name, way in ways.items():
        parts = gridded(of.rate_hz, way)
        found[name] = {choice.counter: _steps(choice, parts) for choice in able}
    return found


def _steps(choice: Choice, parts: Iterable[SampleBlock]) -> int:
    return len(streamed(registry.make(choice.counter, choice.preset, choice.overrides), parts))


def packets(of: Sampled) -> list[Packet]:
    """Return the data packets of the whole recording; the last one may be shorter."""
    lsb = np.round(of.acc_g * wire.DEFAULT_LSB_PER_G).astype(int).tolist()
    return [
        _packet(lsb[index : index + PACKET_SAMPLES], index, of.rate_hz) for index in range(0, len(lsb), PACKET_SAMPLES)
    ]


def _packet(lsb: Sequence[Sequence[int]], index: int, rate_hz: float) -> Packet:
    tick = int(wire.tick_index(index) * TICK_HZ / rate_hz)
    data = wire.encode(wire.DataPacket(boot=1, index=index, tick=tick, counts=lsb))
    return Packet(characteristic=wire.DATA, data=data, at_ns=0)


def again(sent: Sequence[Packet]) -> Iterator[Packet]:
    """Yield the packets, and after every RESENT_EVERY of them the last RESENT ones once more."""
    for number, packet in enumerate(sent, start=1):
        yield packet
        if number % RESENT_EVERY == 0:
            yield from sent[number - RESENT : number]


def without(sent: Sequence[Packet], percent: float, seed: int) -> list[Packet]:
    """Return the packets without so many percent of them: single ones, never two in a row, nor the first."""
    rng = np.random.default_rng((seed, round(percent)))
    # Of the packets after one that came, this share is lost: so that of all of them `percent` are.
    share = percent / (100.0 - percent)
    kept = list(sent[:1])
    lost_before = False
    for packet, drawn in zip(sent[1:], rng.random(max(len(sent) - 1, 0)).tolist(), strict=True):
        lost_before = not lost_before and drawn < share
        if not lost_before:
            kept.append(packet)
    return kept


def gridded(rate_hz: float, sent: Iterable[Packet]) -> list[SampleBlock]:
    """Return what a Tracker makes of packets: the samples of the grid, each stretch without a hole as one block."""
    tracker = Tracker(wire.Bracelet(), {CHEAPEST: partial(registry.make, CHEAPEST)}, primary=CHEAPEST)
    stretches: list[list[SampleBlock]] = []
    awaited = -1
    for packet in (*_description(rate_hz), *sent):
        for event in tracker.apply(packet):
            if isinstance(event, Gridded) and len(event.block):
                if event.block.start != awaited:
                    stretches.append([])
                stretches[-1].append(event.block)
                awaited = event.block.start + len(event.block)
    return [_joined(stretch) for stretch in stretches]


def _joined(stretch: Sequence[SampleBlock]) -> SampleBlock:
    whole = SampleBlock(
        start=stretch[0].start, acc_g=columns(np.concatenate([stacked(block.acc_g) for block in stretch]))
    )
    # Short ones go through plain Python, which wants lists.
    return part(whole, 0, len(whole), as_lists=len(whole) <= COMPILED_FROM)


def _description(rate_hz: float) -> list[Packet]:
    values: Mapping[str, bytes] = {
        wire.BOOT: wire.encode_boot(1),
        wire.SCALE: wire.encode_scale(wire.DEFAULT_LSB_PER_G),
        wire.RATE: wire.encode_rate(rate_hz),
        wire.CLOCK: wire.encode_clock(0, 0),
    }
    return [Packet(characteristic=uuid, data=data, at_ns=0) for uuid, data in values.items()]
