"""What every link is held to: one object, one connection; packets in order; every loss told; no wait without an end.

A kind of link gives a `Bench`: how to make a link to a device that streams, and how to lose it.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import pytest

from service.errors import LinkError
from service.links.contract import Link
from service.samples import Packet
from service.wearables.contract import Write

CANCELLED_WITHIN_S = 0.1


@dataclass(frozen=True)
class Bench:
    """A device that streams: `make` gives a new link to it, `lose` ends the present one from the other side."""

    make: Callable[[], Link]
    lose: Callable[[], Awaitable[None]]
    order: Callable[[list[Packet]], list[int]]
    """The place of each packet of data in the device's own numbering."""


async def take(link, n):
    packets = []
    async with asyncio.timeout(10):
        async for packet in link:
            packets.append(packet)
            if len(packets) == n:
                break
    return packets


async def check_packets_in_order(bench):
    """Packets come as they were sent, each once, stamped with host time; what was said in the handshake comes first."""
    before = time.time_ns()
    async with bench.make() as link:
        said = list(link.said)
        packets = await take(link, 40)
    assert said
    assert packets[: len(said)] == said
    places = bench.order(packets)
    assert len(places) > 20
    assert places == sorted(set(places))
    assert all(before <= packet.at_ns <= time.time_ns() for packet in packets)


async def check_a_loss_is_told(bench):
    """What had arrived comes first; then every further wait ends by LinkError."""
    async with bench.make() as link:
        await take(link, 20)
        await bench.lose()
        for _ in range(2):
            with pytest.raises(LinkError) as lost:
                await take(link, 1_000_000)
            assert lost.value.why


async def check_closed_is_closed(bench):
    """After the context it takes no requests, and it cannot be entered again."""
    link = bench.make()
    async with link:
        await take(link, 1)
    with pytest.raises(LinkError):
        await link.request(Write(characteristic="0000ffff-0000-1000-8000-00805f9b34fb", data=b""))
    with pytest.raises(RuntimeError):
        await link.__aenter__()


async def check_cancelling_a_wait_returns_at_once(bench):
    """Whoever waits for a packet can be cancelled, and the context still closes."""
    async with bench.make() as link:
        task = asyncio.create_task(take(link, 1_000_000))
        await asyncio.sleep(0.1)
        began = time.monotonic()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert time.monotonic() - began < CANCELLED_WITHIN_S


async def check_a_new_link_goes_on(bench):
    """After any number of links, each packet of a new one comes once."""
    for _ in range(5):
        await check_packets_in_order(bench)


CHECKS = [
    check_packets_in_order,
    check_a_loss_is_told,
    check_closed_is_closed,
    check_cancelling_a_wait_returns_at_once,
    check_a_new_link_goes_on,
]
