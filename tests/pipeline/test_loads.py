"""A thousand devices recorded at once, from their packets to the disk: nothing falls behind, nothing is left out."""

import asyncio
import contextlib
import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.cli import QUEUE_BATCHES
from service.pipeline.device import Device
from service.pipeline.journal import Journal
from service.pipeline.lineup import lineup
from service.pipeline.session import YIELD_EVERY
from service.samples import ACCELEROMETER_ONLY, Packet
from service.store.keeping import used_bytes
from service.store.store import open_store
from service.wearables import bracelet as wire

DEVICES = 1000
SECONDS = 20
PACKETS = (8, 10)
"""Samples of a packet: every other device's."""


def measured(packet_samples, seconds):
    """A bracelet's packets of a walk, and how it describes itself."""
    bracelet = Bracelet(Walker("normal:600", seed=3), packet_samples=packet_samples)
    said = {
        wire.BOOT: bracelet.boot_value(),
        wire.SENSORS: bracelet.sensors_value(),
        wire.SCALE: bracelet.scale_value(),
        wire.RATE: bracelet.rate_value(),
        wire.CLOCK: bracelet.clock_value(),
    }
    packets = []
    for _ in range(seconds * 50 // packet_samples):
        bracelet.measure(packet_samples)
        packets.append(bracelet.next_packet(mtu=185))
    return said, packets


def device_of(n, store):
    device = Device(
        address=f"{n}",
        wearable=wire.Bracelet(),
        lineup=lineup("double_threshold"),
        publish=lambda _notice: None,
        journal=Journal(store),
    )
    device.keep = lambda session: asyncio.create_task(session.keep())
    return device


async def send(devices, streams, late_s):
    """Have every device hear its bracelet at its real pace; note by how much each packet was late."""
    begin_s = time.monotonic()
    due = sorted(
        (n / len(devices) + k * PACKETS[n % 2] / 50, n, data)
        for n in range(len(devices))
        for k, data in enumerate(streams[n % 2][1], 1)
    )
    for handled, (at_s, n, data) in enumerate(due):
        early_s = begin_s + at_s - time.monotonic()
        if early_s > 0 or handled % YIELD_EVERY == 0:
            await asyncio.sleep(max(early_s, 0))
        devices[n].session.apply(Packet(characteristic=wire.DATA, data=data, at_ns=time.time_ns()))
        late_s.append(time.monotonic() - begin_s - at_s)


def introduce(device, n, said):
    for uuid, data in {wire.DEVICE_ID: wire.encode_device_id(f"b{n}"), **said}.items():
        device.session.apply(Packet(characteristic=uuid, data=data, at_ns=time.time_ns()))
    device.begin_keeping()


def kept_waiting_s():
    """How long this process's threads wanted a processor and had none, where the system tells."""
    told = Path("/proc/self/task").glob("*/schedstat")
    return sum(int(one.read_text().split()[1]) for one in told) / 1e9


def raw_bytes(path):
    """What the raw samples' pages take in a database."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        with_raw = used_bytes(connection)
        connection.execute("DELETE FROM raw")
        return with_raw - used_bytes(connection)


async def watch(store, queued):
    while True:
        queued.append(store.statistics().queued)
        await asyncio.sleep(0.01)


def quantile(values, q):
    return sorted(values)[int(q * len(values))]


@pytest.mark.full
async def test_a_thousand_devices_recorded_at_once(tmp_path):
    streams = [measured(samples, SECONDS) for samples in PACKETS]
    late_s, waits_s, queued = [], [], []
    async with open_store(tmp_path / "s.db", queue_batches=QUEUE_BATCHES) as store:
        devices = [device_of(n, Timed(store, waits_s)) for n in range(DEVICES)]
        for n, device in enumerate(devices):
            introduce(device, n, streams[n % 2][0])
        waited_s, cpu_s, loop_s = kept_waiting_s(), time.process_time(), time.thread_time()
        watching = asyncio.create_task(watch(store, queued))
        await send(devices, streams, late_s)
        waited_s, cpu_s, loop_s = kept_waiting_s() - waited_s, time.process_time() - cpu_s, time.thread_time() - loop_s
        watching.cancel()
        told = store.statistics()
        await until_stored(store)
        await asyncio.gather(*(device.close() for device in devices))
        await check_all_is_there(store, devices, streams)
        rows = (await store.read(lambda reader: reader.statistics()))["raw"]
    samples = DEVICES * SECONDS * 50
    bytes_a_sample = raw_bytes(tmp_path / "s.db") / samples
    print(
        f"{cpu_s / SECONDS:.0%} of a core, of which the loop {loop_s / SECONDS:.0%}; "
        f"packets late p99 {quantile(late_s, 0.99):.2f} s, the last {late_s[-1]:.2f} s, "
        f"kept waiting {waited_s:.1f} s; a batch is stored after p50 {quantile(waits_s, 0.5):.2f} s, "
        f"p99 {quantile(waits_s, 0.99):.2f} s; queue up to {max(queued)}; {told.commits} commits; "
        f"{bytes_a_sample:.2f} bytes a sample, {rows / DEVICES:.1f} rows a device"
    )
    assert told.trouble is None
    assert told.refused == told.retries == 0
    assert max(queued) <= 2 * DEVICES, "batches pile up"
    assert late_s[-1] < 1 + waited_s, "it fell behind"
    assert bytes_a_sample <= 9


class Timed:
    """A store that notes how long its appends take."""

    def __init__(self, store, took_s):
        self._store, self._took_s = store, took_s
        self.read = store.read

    async def append(self, batch):
        began_s = time.monotonic()
        await self._store.append(batch)
        self._took_s.append(time.monotonic() - began_s)


async def until_stored(store):
    """Wait until the disk has what was sent, as it comes by itself."""
    async with asyncio.timeout(10):
        while any(  # noqa: ASYNC110  # the disk has no event
            one.cursor.index < SECONDS * 50 for one in await store.read(lambda reader: reader.sessions())
        ):
            await asyncio.sleep(0.1)


async def check_all_is_there(store, devices, streams):
    """Every sample that a bracelet sent is on the disk, once, and every step that was counted."""
    for sent, some in zip(streams, (devices[::2], devices[1::2]), strict=True):
        counts = np.array([value for data in sent[1] for value in wire._values(data, ACCELEROMETER_ONLY)])
        for device in (some[0], some[len(some) // 2], some[-1]):
            raw = await store.read(lambda reader, key=device.session.journal.key: reader.raw(key))
            assert np.array_equal(raw.values * 4096, counts.reshape(-1, 3))
    for one in await store.read(lambda reader: reader.sessions()):
        assert one.cursor.index == SECONDS * 50
        assert one.steps["double_threshold"] == devices[int(one.key.device[1:])].session.tracker.total > 0
