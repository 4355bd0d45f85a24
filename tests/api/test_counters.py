"""Counters over the API: what there is, what runs on a device, and changing it while it streams."""

import asyncio
import json

import pytest
import pytest_asyncio
import websockets
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters import registry

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def walk():
    async with staged(Bracelet(Walker("normal:600", seed=3)), speed=8) as stage:
        await stage.until(lambda device: device["steps"] > 0)
        yield stage


async def test_every_counter_tells_its_parameters_with_unit_range_and_presets(walk):
    items = (await walk.http.get("api/v1/counters")).json()["items"]
    (double,) = [item for item in items if item["name"] == "double_threshold"]
    rest = {parameter["name"]: parameter for parameter in double["parameters"]}["rest_raw"]
    assert (rest["unit"], rest["low"], rest["high"]) == ("raw units", 0, 64)
    assert rest["presets"] == {"paper": 1.0, "tuned": 5.75}
    assert double["latency_s"]["tuned"] == pytest.approx(registry.make("double_threshold").latency_s)
    assert "Wang" in double["source"]
    whole = {parameter["name"] for parameter in double["parameters"] if parameter["whole"]}
    assert "bout" in whole
    assert "rest_raw" not in whole
    for parameter in (parameter for item in items for parameter in item["parameters"]):
        assert parameter["text"]
        assert parameter["options"] or (parameter["unit"] is not None and parameter["low"] < parameter["high"])


async def test_other_parameters_begin_a_segment_and_the_count_never_falls(walk):
    lineup = (await walk.http.get("api/v1/devices/sim-1/counters")).json()
    assert lineup == {"counters": [{"name": "steplink", "preset": "tuned", "params": {}}]}
    async with walk.live() as feed:
        before = (await walk.device())["steps"]
        wanted = {"counters": [{"name": "steplink", "preset": "tuned", "params": {"least_steps": 5}}]}
        answer = await walk.http.put("api/v1/devices/sim-1/counters", json=wanted)
        assert answer.json() == wanted
        async with asyncio.timeout(10):
            while (message := json.loads(await feed.recv()))["type"] != "segment":
                pass
        assert message["primary"] == "steplink"
        assert message["steps"] >= before
    device = await walk.until(lambda device: device["steps"] > message["steps"])
    assert device["counters"]["steplink"] == device["steps"] - message["steps"]


@pytest.mark.parametrize(
    ("counters", "said"),
    [
        ([], "at least 1"),
        ([{"name": "abacus"}], "abacus"),
        ([{"name": "double_threshold", "preset": "magic"}], "magic"),
        ([{"name": "double_threshold", "params": {"bout": 99}}], "from 2 to 12"),
        ([{"name": "double_threshold", "params": {"beads": 1}}], "no such parameter"),
        ([{"name": "double_threshold"}, {"name": "double_threshold"}], "once"),
        ([{"name": "double_threshold", "params": {"bout": True}}], "valid"),
        ([{"name": "autocorrelation", "params": {"t_min": 60, "t_max": 20}}], "t_max"),
        ([{"name": "double_threshold"}, {"name": "plus_minus", "params": {"half": 3, "score_over": 39}}], "half"),
    ],
)
async def test_a_wrong_lineup_is_refused_and_changes_nothing(walk, counters, said):
    before = (await walk.http.get("api/v1/devices/sim-1/counters")).json()
    answer = await walk.http.put("api/v1/devices/sim-1/counters", json={"counters": counters})
    assert answer.status_code == 422
    assert said in answer.text
    assert (await walk.http.get("api/v1/devices/sim-1/counters")).json() == before


async def test_after_a_refusal_the_device_counts_on_and_takes_the_next_lineup(walk):
    wrong = {"counters": [{"name": "autocorrelation", "params": {"t_min": 60, "t_max": 20}}]}
    assert (await walk.http.put("api/v1/devices/sim-1/counters", json=wrong)).status_code == 422
    device = await walk.device()
    later = await walk.until(lambda now: now["steps"] > device["steps"])
    assert later["packets"] > device["packets"]
    beside = {"counters": [{"name": "double_threshold", "preset": "tuned", "params": {}}, {"name": "autocorrelation"}]}
    assert (await walk.http.put("api/v1/devices/sim-1/counters", json=beside)).status_code == 200
    await walk.until(lambda now: now["steps"] > later["steps"])


async def test_the_feed_tells_steps_of_the_counters_asked_for(walk):
    alone = {"counters": [{"name": "double_threshold"}]}
    assert (await walk.http.put("api/v1/devices/sim-1/counters", json=alone)).status_code == 200
    async with walk.live("?counters=double_threshold") as feed, asyncio.timeout(10):
        while (message := json.loads(await feed.recv()))["type"] != "step":
            pass
        assert message["counter"] == "double_threshold"
    beside = {"counters": [{"name": "double_threshold"}, {"name": "autocorrelation"}]}
    assert (await walk.http.put("api/v1/devices/sim-1/counters", json=beside)).status_code == 200
    async with walk.live("?counters=autocorrelation") as feed, asyncio.timeout(10):
        heard = []
        while sum(message["type"] == "step" for message in heard) < 5:
            heard.append(json.loads(await feed.recv()))
    assert "tentative" not in {message["type"] for message in heard}, "likely steps are the primary's"
    async with walk.live("?counters=double_threshold") as feed, asyncio.timeout(10):
        while (message := json.loads(await feed.recv()))["type"] != "tentative":
            pass
        assert message["counter"] == "double_threshold"
    with pytest.raises(websockets.ConnectionClosed) as closed:
        async with walk.live("?counters=abacus") as feed:
            await feed.recv()
    assert closed.value.rcvd.code == 4404
    assert "abacus" in closed.value.rcvd.reason


async def test_a_parameter_sent_as_text_is_the_number_it_says(walk):
    body = {"counters": [{"name": "double_threshold", "params": {"bout": "3", "window_mode": "fixed"}}]}
    answer = (await walk.http.put("api/v1/devices/sim-1/counters", json=body)).json()
    assert answer["counters"][0]["params"] == {"bout": 3, "window_mode": "fixed"}
