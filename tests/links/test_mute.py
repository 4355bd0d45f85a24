"""A peer that never answers, at each thing it is asked: every wait ends by its timeout, or at once when cancelled."""

import asyncio
import contextlib
import time

import pytest
from links.air import at_each_step, link_to, on_air
from links.conformance import CANCELLED_WITHIN_S, take

from service.errors import LinkError, LinkFault
from service.links.ble import Timeouts
from service.wearables import bracelet as wire
from service.wearables.contract import Write

BOUND_S = 0.3
"""Each timeout here."""
SLACK_S = 0.5
"""What a busy machine may add, and the closing of the link."""
QUICK = Timeouts(connect_s=BOUND_S, request_s=BOUND_S, silence_s=BOUND_S)


class Mute:
    """Silences the bracelet when a link comes to `asked`: from then on it answers nothing."""

    def __init__(self, asked, gatt):
        self.asked = asked
        self.reached = asyncio.Event()
        self._gatt = gatt

    async def comes(self, step):
        if self.asked == "connect" == step:
            await self._gatt.go_away()
        elif self.asked == step or (self.asked == "mtu" and step == "connect"):
            self._gatt.silence()
        else:
            return
        self.reached.set()


async def use(link):
    """Do all that is done with a link."""
    async with link:
        with contextlib.suppress(TimeoutError):
            await take(link, 15)
        await link.request(Write(characteristic=wire.SCALE, data=b"\0\0"))


@contextlib.asynccontextmanager
async def mute_at(asked):
    async with on_air(speed=8) as (gatt, sighting, backend):
        mute = Mute(asked, gatt)
        yield mute, lambda: link_to(sighting, at_each_step(backend, gatt, mute.comes), timeouts=QUICK)
        # The peer is as free as before.
        mute.asked = None
        gatt.speak()
        await gatt.come_back()
        async with asyncio.timeout(5), link_to(sighting, backend) as link:
            assert await take(link, 12)


ASKED = ["connect", "mtu", "discovery", "read", "subscribe", "write"]


@pytest.mark.full
@pytest.mark.parametrize("asked", ASKED)
async def test_every_wait_is_bounded(asked):
    async with mute_at(asked) as (mute, make):
        task = asyncio.create_task(use(make()))
        async with asyncio.timeout(5):
            await mute.reached.wait()
        began = time.monotonic()
        with pytest.raises(LinkError) as failed:
            await task
        assert failed.value.reason is LinkFault.TIMEOUT
        assert BOUND_S / 2 < time.monotonic() - began < BOUND_S + SLACK_S


@pytest.mark.full
@pytest.mark.parametrize("asked", ASKED)
async def test_every_wait_can_be_cancelled(asked):
    async with mute_at(asked) as (mute, make):
        task = asyncio.create_task(use(make()))
        async with asyncio.timeout(5):
            await mute.reached.wait()
        await asyncio.sleep(BOUND_S / 3)
        began = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - began < CANCELLED_WITHIN_S


@pytest.mark.full
@pytest.mark.parametrize("how", ["bounded", "cancelled"])
async def test_a_peer_that_never_notifies(how):
    async with mute_at("never") as (mute, make), make() as link:
        await take(link, 12)
        mute._gatt.silence()
        task = asyncio.create_task(take(link, 1_000_000))
        await asyncio.sleep(BOUND_S / 3)
        began = time.monotonic()
        if how == "bounded":
            with pytest.raises(LinkError) as silent:
                await task
            assert silent.value.reason is LinkFault.SILENT
            assert time.monotonic() - began < BOUND_S + SLACK_S
            return
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - began < CANCELLED_WITHIN_S
