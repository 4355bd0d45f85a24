"""Two bracelets that tell one id, as an operator and a reader of the feed see them."""

import asyncio
import json

import pytest
from pipeline.radio import walking
from stage import staged


async def hear(feed, heard):
    async for text in feed:
        heard.append(json.loads(text))  # until it is cancelled


@pytest.mark.full
async def test_a_twin_is_listed_with_a_reason_and_takes_over_once_the_first_is_gone():
    heard = []
    both = [walking("one", says="sim-1"), walking("two", says="sim-1")]
    async with staged(*both, speed=8) as stage, stage.live() as feed:
        reader = asyncio.create_task(hear(feed, heard))
        listed = await stage.poll("devices", lambda page: any(one["reason"] for one in page["items"]))
        (twin,) = (one for one in listed["items"] if one["reason"])
        first = await stage.until(lambda device: device["steps"] > 5)
        assert twin["id"] == twin["address"] != first["address"]
        assert "calls itself sim-1" in twin["reason"]
        device = stage.supervisor.device("sim-1")
        (holder,) = (one for one in stage.bracelets if one.connected)
        await holder.go_away()
        moved = await stage.until(lambda now: now["address"] == twin["address"] and now["state"] == "streaming")
        assert stage.supervisor.devices == [device]
        assert moved["session_since"] == first["session_since"]
        await stage.until(lambda now: now["steps"] > moved["steps"])
        reader.cancel()
        await asyncio.gather(reader, return_exceptions=True)
    steps = [message["steps"] for message in heard if message["type"] == "step"]
    assert steps == list(range(1, len(steps) + 1))
    assert {message["device"] for message in heard if message["type"] == "step"} == {"sim-1"}
    ordinals = [message["ordinal"] for message in heard if message.get("device") == "sim-1" and "ordinal" in message]
    assert ordinals == list(range(ordinals[0], ordinals[0] + len(ordinals)))
