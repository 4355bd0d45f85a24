"""A session that is stored, resumed after a crash and replayed counts as one that nothing happened to, bit for bit."""

import dataclasses
import functools
import struct

import numpy as np
import pytest
from fakes import described
from store import made

from device_sim.gait import Walker
from service.counters import registry
from service.events import StepCounted
from service.samples import TICK_EVERY, Packet
from service.store import codec
from service.store.chunker import Chunker, by_stretch
from service.store.store import open_store
from service.store.values import Batch, Chunk, Cursor, Description, Layout, Snapshot
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

KEY = made.session("dev-1")
DRIFT = 1.0002
"""The device's clock is 200 ppm fast: its ticks matter."""
RATE_HZ = 50.0


def tracker():
    makers = {"double_threshold": functools.partial(registry.make, "double_threshold", "tuned", {})}
    return Tracker(wire.Bracelet(), makers, primary="double_threshold")


def packets(samples, n):
    """The samples as a bracelet sends them, n a packet."""
    for index in range(0, len(samples) - n, n):
        tick = int(wire.tick_index(index) * 1024 / RATE_HZ * DRIFT)
        counts = [tuple(xyz) for xyz in samples[index : index + n].tolist()]
        yield index, wire.encode(wire.DataPacket(boot=1, index=index, tick=tick, counts=counts))


def packets_of(item):
    """What the device sent, made again of what was stored."""
    if isinstance(item, Description):
        return [Packet(characteristic=item.characteristic, data=item.value, at_ns=item.at_ns)]
    return [_packet_of(piece) for piece in by_stretch(item)]


def _packet_of(piece):
    values = struct.unpack(f"<{3 * len(piece)}h", piece.acc)
    counts = list(zip(values[::3], values[1::3], values[2::3], strict=True))
    packet = wire.DataPacket(boot=piece.boot, index=piece.index, tick=piece.ticks[0], counts=counts)
    return Packet(characteristic=wire.DATA, data=wire.encode(packet), at_ns=piece.at_ns)


async def recorded(path, samples, n, crash_at, snapshot_at):
    """Record live until the crash; return what the Tracker told."""
    live, decoder, chunker = tracker(), wire.Bracelet(), Chunker()
    layout, events = Layout(rate_hz=RATE_HZ, lsb_per_g=4096.0), []
    async with open_store(path, queue_batches=100) as store:
        said = list(described())
        for packet in said:
            decoder.feed(packet.characteristic, packet.data)
            live.apply(packet)
        descriptions = [
            Description(run=0, boot=1, index=0, at_ns=0, characteristic=packet.characteristic, value=packet.data)
            for packet in said
        ]
        await store.append(Batch(session=KEY, descriptions=descriptions))
        chunks = []
        for index, data in packets(samples, n):
            if index >= crash_at:
                break
            events += live.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
            chunks += chunker.add(decoder.feed(wire.DATA, data), run=live.tally.reboots, layout=layout, at_ns=0)
            if index <= snapshot_at < index + n:
                place = Cursor(run=0, boot=1, index=index + n)
                snapshot = Snapshot(cursor=place, at_ns=0, state=live.snapshot())
                await store.append(Batch(session=KEY, snapshot=snapshot))
        await store.append(Batch(session=KEY, chunks=chunks))
    return events


def steps(events):
    """The steps; how well their time was known depends on the newest tick at that moment, so on the packets' size."""
    return [dataclasses.replace(event, uncertainty_s=0.0) for event in events if isinstance(event, StepCounted)]


@pytest.mark.parametrize("snapshot_at", [None, 512, 1003, 1777])
async def test_a_crash_changes_no_step(tmp_path, snapshot_at):
    n, crash_at = 7, 2000
    samples = np.rint(Walker("normal:60").read(3000) * 4096).astype(int)
    whole = tracker()
    for packet in described():
        whole.apply(packet)
    undisturbed = [
        event
        for _, data in packets(samples, n)
        for event in whole.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
    ]
    before = await recorded(tmp_path / "s.db", samples, n, crash_at, -1 if snapshot_at is None else snapshot_at)

    resumed, events = tracker(), []
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        (found,) = await store.read(lambda reader: reader.resume())
        after = found.snapshot.cursor if found.snapshot else None
        if found.snapshot:
            resumed.restore(found.snapshot.state)
        page = await store.read(lambda reader: reader.replay(KEY, after))
    stored = 0
    for item in page.items:
        stored = item.end if isinstance(item, Chunk) else stored
        events += [event for packet in packets_of(item) for event in resumed.apply(packet)]
    assert resumed.steps["double_threshold"] <= len(steps(before))
    for index, data in packets(samples, n):  # the rest comes from the device's history
        if index + n > stored:
            events += resumed.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
    told = {event.steps: event for event in steps(before)} | {event.steps: event for event in steps(events)}
    assert list(told.values()) == steps(undisturbed)
    assert len(told) > 60
    assert stored % TICK_EVERY != 0
    ends = [codec.to_json(one.snapshot()["timebase"]) for one in (resumed, whole)]
    assert ends[0] == ends[1]
