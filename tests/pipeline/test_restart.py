"""A service that ends and starts again goes on with every session, and asks the device for what it missed."""

import asyncio

from stage import serving

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.source import WalkerSource


async def test_steps_go_on_over_a_restart(tmp_path):
    path = tmp_path / "s.db"
    bracelet = Bracelet(WalkerSource("normal:600", seed=3))
    async with LocalAir() as air, air.bracelet(bracelet, speed=8):
        async with serving(air, path=path) as stage:
            before = await stage.until(lambda device: device["steps"] > 20)
            first = await stage.poll("devices/sim-1/steps?limit=1000", lambda page: len(page["items"]) > 20)
        await asyncio.sleep(2)
        async with serving(air, path=path) as stage:
            at_once = await stage.device()
            assert at_once["steps"] >= before["steps"]
            assert at_once["session_since"] == before["session_since"]
            then = await stage.until(
                lambda device: device["steps"] > before["steps"] + 60 and device["samples_awaited"] == 0
            )
            assert (then["samples_lost"], then["gaps"], then["reboots"]) == (0, 0, 0)
            page = await stage.poll("devices/sim-1/steps?limit=1000", lambda page: len(page["items"]) > 80)
    items = page["items"]
    assert items[: len(first["items"])] == first["items"]
    assert [item["steps"] for item in items] == list(range(1, len(items) + 1))
