"""A service that ends and starts again goes on with every session, and asks the device for what it missed."""

import asyncio
import contextlib
import sqlite3

import pytest
from stage import serving

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.source import WalkerSource

pytestmark = pytest.mark.full


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


async def test_an_option_leaves_a_device_alone_only_as_long_as_it_is_given(tmp_path):
    path = tmp_path / "s.db"
    async with LocalAir() as air, air.bracelet(Bracelet(WalkerSource("normal:600", seed=3)), speed=8):
        async with serving(air, path=path) as stage:
            await stage.until(lambda device: device["steps"] > 5)
        async with serving(air, path=path, wanted=["another"]) as stage:
            assert (await stage.device())["state"] == "disconnected"
            await asyncio.sleep(1.5)
        async with serving(air, path=path) as stage:
            await stage.until(lambda device: device["state"] == "streaming")
            await stage.http.post("api/v1/devices/sim-1/disconnect")
            await stage.until(lambda device: device["state"] == "disconnected")
        async with serving(air, path=path) as stage:
            await asyncio.sleep(1)
            assert (await stage.device())["state"] == "disconnected"


async def test_a_session_that_cannot_go_on_ends_and_the_next_is_numbered_on(tmp_path):
    path = tmp_path / "s.db"
    async with LocalAir() as air, air.bracelet(Bracelet(WalkerSource("normal:600", seed=3)), speed=8):
        async with serving(air, path=path) as stage:
            await stage.until(lambda device: device["steps"] > 5)
        with contextlib.closing(sqlite3.connect(path)) as database, database:
            database.execute("UPDATE sessions SET about = json_set(about, '$.lineup[0].name', 'gone')")
        async with serving(air, path=path) as stage:
            await stage.poll("devices", lambda page: [item["id"] for item in page["items"]] == ["sim-1"])
            anew = await stage.until(lambda device: device["steps"] > 5)
            path = "devices/sim-1/steps?limit=1000"
            page = await stage.poll(f"{path}&session=all", lambda page: len(page["items"]) > 10)
            own = await stage.poll(path, lambda page: page["items"])
        assert [item["steps"] for item in own["items"]] == list(range(1, len(own["items"]) + 1))
        assert anew["steps"] < len(page["items"])
        ordinals = [item["ordinal"] for item in page["items"]]
        assert ordinals == sorted(set(ordinals))


async def test_a_disconnect_holds_where_an_option_left_the_device_alone_already(tmp_path):
    path = tmp_path / "s.db"
    async with LocalAir() as air, air.bracelet(Bracelet(WalkerSource("normal:600", seed=3)), speed=8):
        async with serving(air, path=path) as stage:
            await stage.until(lambda device: device["steps"] > 5)
        async with serving(air, path=path, wanted=["another"]) as stage:
            await stage.http.post("api/v1/devices/sim-1/disconnect")
            await asyncio.sleep(1.5)
        async with serving(air, path=path) as stage:
            await asyncio.sleep(1)
            assert (await stage.device())["state"] == "disconnected"


async def test_pages_go_on_over_a_restart(tmp_path):
    path, page = tmp_path / "s.db", "api/v1/devices/sim-1/steps?limit=7"
    bracelet = Bracelet(WalkerSource("normal:600", seed=3))
    async with LocalAir() as air, air.bracelet(bracelet, speed=8):
        async with serving(air, path=path) as stage:
            await stage.until(lambda device: device["steps"] > 20)
            first = (await stage.http.get(page)).json()
            assert [item["steps"] for item in first["items"]] == list(range(1, 8))
        async with serving(air, path=path) as stage:
            counted, after = [], first["next"]
            await stage.until(lambda device: device["steps"] > 40)
            while after is not None and len(counted) < 34:
                following = (await stage.http.get(f"{page}&after={after}")).json()
                counted += [item["steps"] for item in following["items"]]
                after = following["next"]
    assert counted[:33] == list(range(8, 41))
