"""The supervisor over real GATT: known devices, devices under two addresses, and how each attempt begins."""

import asyncio
import contextlib
import time

import pytest
from pipeline.radio import on_radio, walking
from pipeline.test_roster import made

from device_sim.peripheral import static_address
from service.events import StepCounted
from service.links.ble import Backend
from service.pipeline.device import TWIN_WAIT_S
from service.pipeline.lifecycle import State
from service.pipeline.notices import StateChanged

FAST = {"speed": 8.0}


def address_of(device_id):
    return static_address(device_id).to_string(with_type_qualifier=False).upper()


async def test_a_remembered_device_is_listed_wanted_and_matched_by_its_address():
    known = made(address_of("sim-1"), device_id="sim-1", rssi_dbm=None)
    async with on_radio(remembered=[known], wanted=[]) as radio:
        assert radio.supervisor.devices == [known]
        assert known.state is State.LOST
        async with radio.air.bracelet(walking(), **FAST):
            assert await radio.streams() is known
            assert radio.supervisor.devices == [known]


@pytest.mark.full
async def test_a_device_that_comes_back_under_another_address_goes_on_with_its_session():
    body = walking("first", says="sim-1")
    async with on_radio() as radio:
        async with radio.air.bracelet(body, **FAST):
            known = await radio.streams(beyond=200)
        await radio.until(lambda: known.state is State.LOST)
        samples, steps = known.session.tracker.tally.samples, known.session.tracker.total
        assert steps > 0
        body.device_id = "second"
        async with radio.air.bracelet(body, **FAST):
            assert await radio.streams(beyond=samples + 200) is known
            assert radio.supervisor.devices == [known]
            assert known.address == address_of("second")
            tally = known.session.tracker.tally
            assert (tally.packets_duplicate, tally.reboots) == (0, 0)
            assert known.session.tracker.total > steps
        counted = [notice for notice in radio.told if isinstance(notice.event, StepCounted)]
        assert {notice.device for notice in counted} == {"sim-1"}
        assert [notice.event.steps for notice in counted] == list(range(1, len(counted) + 1))
        ordinals = [notice.ordinal for notice in radio.told if notice.ordinal and notice.device == "sim-1"]
        assert ordinals == sorted(set(ordinals))


async def test_a_restored_session_takes_a_device_that_advertises_another_address():
    known = made("OLD", device_id="sim-1", rssi_dbm=None)
    async with on_radio(remembered=[known]) as radio, radio.air.bracelet(walking(), **FAST):
        assert await radio.streams() is known
        assert radio.supervisor.devices == [known]
        assert (known.address, known.rssi_dbm is None) == (address_of("sim-1"), False)
        assert radio.supervisor.device(address_of("sim-1")) is known


async def test_a_second_bracelet_of_the_same_id_is_turned_away_and_waits():
    async with on_radio() as radio, radio.air.bracelet(walking("one", says="sim-1"), **FAST):
        known = await radio.streams()
        async with radio.air.bracelet(walking("two", says="sim-1"), **FAST) as second:
            twin = await radio.until(lambda: next((one for one in radio.supervisor.devices if one.reason), None))
            assert twin.address == address_of("two")
            assert "sim-1" in twin.reason
            assert address_of("one") in twin.reason
            assert twin.state is State.LOST
            assert twin.not_before_s - twin._moved_s == TWIN_WAIT_S
            await radio.until(lambda: not second.connected)
            samples = known.session.tracker.tally.samples
            assert await radio.streams(beyond=samples) is known
            assert second.statistics().links == 1
            assert known.session.tracker.tally.packets_duplicate == 0
            assert known.address == address_of("one")


@pytest.mark.full
async def test_a_disconnected_device_is_left_alone_under_its_new_address_too():
    body = walking("first", says="sim-1")
    async with on_radio() as radio:
        async with radio.air.bracelet(body, **FAST):
            known = await radio.streams()
            radio.supervisor.disconnect("sim-1")
            await radio.until(known.task.done)
        body.device_id = "second"
        async with radio.air.bracelet(body, **FAST) as second:
            await radio.until(lambda: known.address == address_of("second") and not second.connected)
            assert radio.supervisor.devices == [known]
            await asyncio.sleep(0.2)
            assert (known.state, second.statistics().links) == (State.DISCONNECTED, 1)
            radio.supervisor.connect("sim-1")
            assert await radio.streams() is known


class Log:
    """What scanners and clients did, in order: scan, stop, dial, up or down, each with the handle it concerns."""

    def __init__(self):
        self.lines = []

    def backend(self, inner):
        log = self.lines

        class Scanner(inner.scanner):
            async def start(self):
                log.append(("scan", None))
                await super().start()

            async def stop(self):
                await super().stop()
                log.append(("stop", None))

            def call_detection_callbacks(self, device, data):
                log.append(("heard", device))
                super().call_detection_callbacks(device, data)

        class Client(inner.client):
            def __init__(self, device, **how):
                super().__init__(device, **how)
                self.handle = device

            async def connect(self, *words, **how):
                log.append(("dial", self.handle))
                try:
                    await super().connect(*words, **how)
                finally:
                    log.append(("dialled", self.handle))

        return Backend(scanner=Scanner, client=Client)


@pytest.mark.full
async def test_each_attempt_has_a_fresh_scan_result_alone_with_the_scanner_stopped():
    log = Log()
    async with on_radio(make_backend=log.backend) as radio, contextlib.AsyncExitStack() as stack:
        bracelets = [await stack.enter_async_context(radio.air.bracelet(walking(f"sim-{n}"), **FAST)) for n in range(3)]
        for _ in range(3):
            for n, one in enumerate(bracelets):
                device = await radio.streams(f"sim-{n}")
                await one.drop_link()
                await radio.until(lambda device=device: device.state is not State.STREAMING)
        for n in range(3):
            await radio.streams(f"sim-{n}")
    fresh, scanning, dialling, dialled = set(), False, 0, []
    for what, handle in log.lines:
        if what == "scan":
            fresh, scanning = set(), True
        elif what == "stop":
            scanning = False
        elif what == "heard" and scanning:
            fresh.add(id(handle))
        elif what == "dial":
            dialling += 1
            assert (scanning, dialling) == (False, 1)
            assert id(handle) in fresh  # heard in the scan that has just ended, and in none before
            dialled.append(handle)
        elif what == "dialled":
            dialling -= 1
    assert len(dialled) >= 12
    assert len({id(handle) for handle in dialled}) == len(dialled)


async def test_stale_connections_of_remembered_devices_are_closed_first():
    closed = []

    async def close(address):
        closed.append((address, len(log.lines)))

    log = Log()

    def with_stale(inner):
        both = log.backend(inner)
        return Backend(scanner=both.scanner, client=both.client, close_stale=close)

    known = made("OLD", device_id="sim-1", rssi_dbm=None)
    async with on_radio(remembered=[known], make_backend=with_stale) as radio:
        await radio.until(lambda: log.lines)
    assert closed == [("OLD", 0)]


@pytest.mark.full
async def test_states_are_told_in_a_legal_order():
    async with on_radio() as radio, radio.air.bracelet(walking(), **FAST) as gatt:
        for _ in range(2):
            await radio.streams()
            await gatt.drop_link()
        await radio.streams()
        states = [notice.event.state for notice in radio.told if isinstance(notice.event, StateChanged)]
    assert states[:5] == ["connecting", "streaming", "lost", "connecting", "streaming"]


@pytest.mark.full
async def test_a_mute_peer_does_not_hold_up_a_disconnect():
    async with on_radio() as radio, radio.air.bracelet(walking(), **FAST) as gatt:
        gatt.silence()
        device = await radio.until(lambda: next(iter(radio.supervisor.devices), None))
        await radio.until(lambda: device.state is State.CONNECTING and gatt.connected)
        await asyncio.sleep(0.1)
        began = time.monotonic()
        radio.supervisor.disconnect(device.id)
        await radio.until(device.task.done)
        assert time.monotonic() - began < 0.1
        assert device.state is State.DISCONNECTED
        await radio.until(lambda: not gatt.connected)
