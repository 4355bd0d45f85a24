"""REST over the whole service: devices, steps page by page, and what is refused."""

import asyncio
import contextlib
import math
from datetime import datetime, timedelta

import pytest
import pytest_asyncio
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from device_sim.gatt import Start
from service.counters import registry
from service.pipeline import supervisor


def walking(seconds=30, **how):
    return Bracelet(Walker(f"normal:{seconds}", seed=3), **how)


pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def played():
    """A service that has heard a walk of 30 s to its end, of a sensor that is 1000 ppm fast."""
    async with staged(walking(sensor_ppm=1000), speed=math.inf, start=Start.ON_SUBSCRIBE) as stage:
        await stage.until(lambda device: device["samples"] == 1500)
        yield stage


async def test_a_device_tells_what_it_is_and_what_it_counted(played):
    device = await played.device()
    assert device["id"] == "sim-1"
    assert device["state"] == "streaming"
    assert device["steps"] == device["counters"][registry.DEFAULT] == pytest.approx(54, abs=8)
    assert device["steps"] <= device["steps_now"]
    assert (device["rate_hz"], device["battery_percent"], device["samples_lost"]) == (50.0, 100, 0)
    assert device["manufacturer"] == "steplink"
    assert datetime.fromisoformat(device["since"]).utcoffset() == timedelta(0)


async def test_the_rate_by_its_own_clock_is_told_as_well_as_it_is_known(played):
    device = await played.device()
    assert device["clock_drift_ppm"] is device["clock_drift_uncertainty_ppm"] is None  # not in so short a time
    assert abs(device["measured_rate_hz"] - 50.05) <= device["measured_rate_uncertainty_hz"] < 0.003


async def test_lists_are_items_and_next(played):
    answer = (await played.http.get("api/v1/devices")).json()
    assert set(answer) == {"items", "next"}
    assert [device["id"] for device in answer["items"]] == ["sim-1"]


async def test_the_link_address_finds_a_device_too(played):
    device = await played.device()
    assert (await played.device(device["address"]))["id"] == "sim-1"


async def test_steps_page_by_page_are_all_steps_once(played):
    count = (await played.device())["steps"]
    items, after = [], None
    while True:
        query = {"limit": 7} | ({"after": after} if after else {})
        page = (await played.http.get("api/v1/devices/sim-1/steps", params=query)).json()
        items += page["items"]
        after = page["next"]
        if after is None:
            break
    assert [item["steps"] for item in items] == list(range(1, count + 1))
    assert [item["device_s"] for item in items] == sorted(item["device_s"] for item in items)
    assert all(item["peak"] > item["valley"] for item in items)
    assert len({item["ordinal"] for item in items}) == count


async def test_steps_from_a_time_to_a_time(played):
    whole = (await played.http.get("api/v1/devices/sim-1/steps", params={"limit": 1000})).json()["items"]
    times = [datetime.fromisoformat(item["at"]) for item in whole]
    since, until = min(times) + (max(times) - min(times)) / 4, max(times)
    query = {"from": since.isoformat(), "to": until.isoformat(), "limit": 1000}
    some = (await played.http.get("api/v1/devices/sim-1/steps", params=query)).json()["items"]
    assert [item["steps"] for item in some] == [
        item["steps"] for item, at in zip(whole, times, strict=True) if since <= at < until
    ]
    assert 0 < len(some) < len(whole)


@pytest.mark.parametrize(
    "query",
    ["after=sim-1", "after=other:3", "after=sim-1:x", "limit=0", "limit=1001", "limit=x", "from=yesterday",
     "from=2026-01-02T03:04:05", "to=2026-01-02", "counter=nonsense", "unknown=1"],
)  # fmt: skip
async def test_a_malformed_query_is_refused_with_a_sentence(played, query):
    answer = await played.http.get(f"api/v1/devices/sim-1/steps?{query}")
    assert answer.status_code == 422
    assert answer.json()["detail"]


@pytest.mark.parametrize(
    ("method", "path"), [("get", ""), ("get", "/steps"), ("post", "/connect"), ("post", "/disconnect")]
)
async def test_an_unknown_device_is_a_404_that_says_where_to_look(played, method, path):
    answer = await getattr(played.http, method)(f"api/v1/devices/nobody{path}")
    assert answer.status_code == 404
    assert "nobody" in answer.json()["detail"]
    assert "/api/v1/devices" in answer.json()["detail"]


async def test_disconnect_leaves_alone_and_connect_brings_back():
    async with staged(walking(600)) as stage:
        await stage.until(lambda device: device["state"] == "streaming" and device["samples"] > 0)
        assert (await stage.http.post("api/v1/devices/sim-1/disconnect")).status_code == 202
        device = await stage.until(lambda device: device["state"] == "disconnected")
        assert not stage.bracelet.connected
        assert (await stage.http.post("api/v1/devices/sim-1/disconnect")).status_code == 202
        assert (await stage.http.post("api/v1/devices/sim-1/connect")).status_code == 202
        back = await stage.until(lambda now: now["state"] == "streaming" and now["samples"] > device["samples"])
        assert back["steps"] >= device["steps"]


async def test_a_disconnect_at_the_worst_moment_leaves_the_supervisor_alive(monkeypatch):
    """Between the advertisement that starts an attempt and the attempt itself the scanner takes its time to stop."""
    stopping, go_on = asyncio.Event(), asyncio.Event()
    scanning = supervisor.scanning

    @contextlib.asynccontextmanager
    async def slow_to_stop(*words):
        async with scanning(*words) as sightings:
            yield sightings
            stopping.set()
            await go_on.wait()

    monkeypatch.setattr(supervisor, "scanning", slow_to_stop)
    async with staged(walking(600)) as stage:
        await stopping.wait()
        device = stage.supervisor.devices[0]
        assert (await stage.http.post(f"api/v1/devices/{device.address}/disconnect")).status_code == 202
        go_on.set()
        await asyncio.sleep(0.3)
        assert device.state == "disconnected"
        await stage.http.post(f"api/v1/devices/{device.address}/connect")
        await stage.until(lambda now: now["state"] == "streaming")


async def test_every_refusal_is_a_sentence_as_the_schema_says(played):
    openapi = (await played.http.get("openapi.json")).json()
    for path in openapi["paths"].values():
        for operation in path.values():
            schema = operation["responses"]["422"]["content"]["application/json"]["schema"]
            assert schema == {"$ref": "#/components/schemas/Problem"}
    for query in ("limit=0", "from=2026-01-02T03:04:05", "unknown=1"):
        detail = (await played.http.get(f"api/v1/devices/sim-1/steps?{query}")).json()["detail"]
        assert isinstance(detail, str)
        assert query.partition("=")[0] in detail


async def test_only_wanted_devices_are_connected():
    async with staged(walking(600), wanted=["Somebody"]) as stage:
        listed = []
        while not listed:
            listed = (await stage.http.get("api/v1/devices")).json()["items"]
        assert listed[0]["state"] == "seen"
        address = listed[0]["address"]
        assert listed[0]["id"] == address
        await stage.http.post(f"api/v1/devices/{address}/connect")
        await stage.until(lambda device: device["state"] == "streaming")


async def test_a_lost_bracelet_is_lost_and_comes_back_with_its_count():
    async with staged(walking(600), speed=8) as stage:
        await stage.until(lambda device: device["steps"] > 5)
        await stage.bracelet.go_away()
        lost = await stage.until(lambda device: device["state"] == "lost")
        assert "lost" in lost["reason"]
        await stage.bracelet.come_back()
        back = await stage.until(lambda device: device["state"] == "streaming" and device["steps"] > lost["steps"])
        back = await stage.until(lambda device: device["samples_awaited"] == 0)
        assert (back["samples_lost"], back["gaps"]) == (0, 0)  # the bracelet kept them and sent them again


async def test_corrupt_packets_are_counted_and_skipped():
    async with staged(walking(600), speed=8) as stage:
        await stage.until(lambda device: device["samples"] > 100)
        stage.bracelet.corrupt_next(3)
        device = await stage.until(lambda device: device["packets_bad"] == 3)
        await stage.until(lambda now: now["samples"] > device["samples"] + 100)


async def test_health(played):
    health = (await played.http.get("healthz")).json()
    assert (health["status"], health["bluetooth"], health["devices"]) == ("ok", "ok", 1)
