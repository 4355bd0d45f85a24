"""The hub: bounded, and no reader holds up another."""

import asyncio

import pytest

from service.events import Counting
from service.pipeline.hub import Hub, SlowSubscriberError
from service.pipeline.lifecycle import State
from service.pipeline.notices import Notice, StateChanged


def durable(ordinal, device="a"):
    return Notice(
        device=device, at_ns=0, uncertainty_s=0.0, ordinal=ordinal, event=StateChanged(state=State.LOST, reason=None)
    )


def ephemeral(steps, device="a"):
    event = Counting(now_s=0.0, steps=steps, steps_now=steps, cadence_spm=None)
    return Notice(device=device, at_ns=0, uncertainty_s=0.0, ordinal=None, event=event)


async def test_durable_notices_come_whole_and_in_order_ephemeral_ones_conflated():
    hub = Hub(durable_limit=10)
    reader = hub.subscribe()
    for i in range(5):
        hub.publish(ephemeral(i))
        hub.publish(durable(i))
        hub.publish(ephemeral(10 + i, device="b"))
    notices = await reader.receive()
    assert [notice.ordinal for notice in notices if notice.ordinal is not None] == list(range(5))
    assert [(n.device, n.event.steps) for n in notices if n.ordinal is None] == [("a", 4), ("b", 14)]
    assert reader.statistics()["conflated"] == 8


async def test_a_slow_reader_is_closed_and_the_others_go_on():
    hub = Hub(durable_limit=10)
    slow, quick = hub.subscribe(), hub.subscribe()
    got = []
    for i in range(30):
        hub.publish(durable(i))
        got += await quick.receive()
    assert [notice.ordinal for notice in got] == list(range(30))
    with pytest.raises(SlowSubscriberError):
        await slow.receive()
    assert slow.statistics()["durable"] == 10
    assert len(hub.statistics()["subscribers"]) == 1


async def test_a_reader_hears_only_the_devices_it_asked_for():
    hub = Hub(durable_limit=10)
    reader = hub.subscribe({"b"})
    hub.publish(durable(1, device="a"))
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(reader.receive(), 0.01)
    hub.publish(durable(2, device="b"))
    assert [notice.ordinal for notice in await reader.receive()] == [2]


async def test_closing_twice_is_harmless():
    hub = Hub(durable_limit=10)
    reader = hub.subscribe()
    reader.close()
    reader.close()
    hub.publish(durable(1))
    assert hub.statistics() == {"subscribers": []}
