"""Connects that are cancelled at any moment: no link is left that nobody owns, and bumble complains of nothing."""

import asyncio
import logging
import random

import pytest

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet

GONE_WITHIN_S = 1.0
"""Long before the bracelet itself would give up a link on which nothing is asked."""


@pytest.fixture
async def stage(radio):
    async with LocalAir() as air, air.bracelet(Bracelet(radio.Endless()), speed=20) as gatt, air.central() as backends:
        yield gatt, backends, await radio.seen(backends)


async def nobody_linked(radio, gatt, backends):
    statistics = backends.central.statistics
    await radio.until(lambda: not gatt.connected and statistics()["links"] == 0, within_s=GONE_WITHIN_S)


async def works(radio, backends):
    host = await radio.Host.connect(backends)
    await host.subscribe()
    await host.got(30)
    await host.client.disconnect()


async def test_a_connect_cancelled_in_the_turn_in_which_the_link_is_made_leaves_none(radio, stage):
    gatt, backends, device = stage
    central = backends.central
    connecting = asyncio.create_task(central.connect(device.details["address"]))
    while not central._operations._tasks:  # noqa: ASYNC110  # the very first turn is wanted
        await asyncio.sleep(0)
    (attempt,) = central._operations._tasks
    attempt.add_done_callback(lambda _: connecting.cancel())
    with pytest.raises(asyncio.CancelledError):
        await connecting
    assert attempt.result() is not None  # the link was made
    await nobody_linked(radio, gatt, backends)
    await works(radio, backends)


async def test_a_subscription_that_is_told_after_its_link_has_ended_is_none(stage):
    gatt, _, _ = stage
    peripheral, ended = gatt._peripheral, object()
    peripheral._on_data_subscription(ended, notify=True, _indicate=False)
    peripheral._on_control_subscription(ended, _notify=False, indicate=True)
    peripheral._on_request(ended, b"\x01")
    assert not (peripheral._subscribed)
    assert not (peripheral._indicated)
    assert not (peripheral.control.streaming)
    assert not (gatt.subscribed)


async def storm(radio, stage, caplog, *, seed, rounds):
    gatt, backends, device = stage
    moments = random.Random(seed)
    caplog.set_level(logging.WARNING, logger="bumble")
    for _ in range(rounds):
        task = asyncio.create_task(_stream(radio, backends, device))
        if moments.random() < 0.5:
            await radio.until(lambda: gatt.connected, every_s=0)  # the worst moment is a few turns later
        else:
            await asyncio.sleep(moments.uniform(0, 0.12))
        for _ in range(moments.randrange(12)):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.wait({task})
        assert task.cancelled(), task.exception()
        await nobody_linked(radio, gatt, backends)
    await works(radio, backends)
    assert [record.getMessage() for record in caplog.records if record.name.startswith("bumble")] == []


async def _stream(radio, backends, device):
    host = await radio.Host.connect(backends, device=device, timeout=2)
    try:
        await host.subscribe()
        await asyncio.Event().wait()
    finally:
        await host.client.disconnect()


@pytest.mark.full
async def test_a_short_storm_of_cancels_leaves_no_link(radio, stage, caplog):
    await storm(radio, stage, caplog, seed=2, rounds=30)


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 4])
async def test_a_long_storm_of_cancels_leaves_no_link(radio, stage, caplog, seed):
    await storm(radio, stage, caplog, seed=seed, rounds=150)
