"""Calibrations over the API: recorded on a live device, watched, applied, refused with a sentence."""

import pytest
from api.standing import standing
from pipeline.test_calibration import Tape
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.counters.double_threshold import TUNED, sampled_window
from service.pipeline.calibration import Plan

ALL = "devices/sim-1/calibrations"
WALK = {"counter": "double_threshold", "method": "walk"}


async def test_a_walk_is_watched_learnt_from_and_applied():
    async with standing("normal:90") as lab:
        begun = await lab.ask("POST", ALL, 201, json=WALK | {"pace": "normal", "steps": 20})
        assert begun == {
            "number": 1, "device": "sim-1", "counter": "double_threshold", "method": "walk", "pace": "normal",
            "steps_wanted": 20, "seconds_wanted": None, "state": "recording", "reason": None,
            "began_at": begun["began_at"], "ended_at": None, "steps": 0, "seconds": 0.0, "params": None, "detail": None,
        }  # fmt: skip
        lab.walk(8)
        halfway = await lab.ask("GET", f"{ALL}/1")
        assert 0 < halfway["steps"] < 20
        assert halfway["seconds"] == pytest.approx(8, abs=0.2)
        lab.walk(10)
        done = await lab.ask("GET", f"{ALL}/1")
        assert (done["state"], done["reason"]) == ("done", None)
        window = done["params"]["first_window"]
        assert done["params"] == {"window_mode": "fixed", "first_window": window}
        assert "a step over" in done["detail"]
        assert (await lab.ask("GET", ALL)) == {"items": [done], "next": None}
        learnt = {"window_mode": "fixed", "first_window": window}
        lineup = await lab.ask("POST", f"{ALL}/apply", json={"numbers": [1]})
        assert lineup == {"counters": [{"name": "double_threshold", "preset": "tuned", "params": learnt}]}
        assert lineup == await lab.ask("GET", "devices/sim-1/counters")
        assert lineup == await lab.ask("PUT", "devices/sim-1/counters", json=lineup)
        await lab.ask("DELETE", f"{ALL}/1", 204)
        assert "no calibration 1" in await lab.refused("GET", f"{ALL}/1", 404)


async def test_it_can_be_ended_early_or_cancelled():
    async with standing("normal:90") as lab:
        await lab.ask("POST", ALL, 201, json=WALK | {"seconds": 60})
        lab.walk(8)
        assert (await lab.ask("POST", f"{ALL}/1/finish"))["state"] == "done"
        assert "is done" in await lab.refused("POST", f"{ALL}/1/finish", 409)
        await lab.ask("POST", ALL, 201, json=WALK | {"seconds": 60})
        assert "recording" in await lab.refused("POST", ALL, 409, json=WALK | {"seconds": 60})
        assert "only done ones" in await lab.refused("POST", f"{ALL}/apply", 409, json={"numbers": [1, 2]})
        await lab.ask("DELETE", f"{ALL}/2", 204)
        await lab.ask("POST", ALL, 201, json=WALK | {"seconds": 60})


async def test_a_failed_one_says_why_and_what_to_do():
    async with standing("normal:90") as lab:
        await lab.ask("POST", ALL, 201, json=WALK | {"seconds": 60})
        lab.walk(3)
        lab.walk(2, heard=False)
        lab.walk(2)
        failed = await lab.ask("GET", f"{ALL}/1")
        assert (failed["state"], failed["params"]) == ("failed", None)
        assert "repeat" in failed["reason"]


async def test_a_device_that_does_not_stream_is_a_409():
    async with standing("normal:90") as lab:
        lab.stands[0].lose()
        assert "sim-1 is lost" in await lab.refused("POST", ALL, 409, json=WALK | {"steps": 20})


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (WALK, "exactly one"),
        (WALK | {"steps": 20, "seconds": 20}, "exactly one"),
        (WALK | {"steps": 5}, "greater than or equal to 10"),
        (WALK | {"seconds": 1e9}, "less than or equal to 600"),
        (WALK | {"seconds": "long"}, "number"),
        (WALK | {"steps": 20, "pace": "x" * 41}, "40"),
        (WALK | {"steps": 20, "speed": 1}, "speed = 1: extra inputs"),
        (WALK | {"steps": 3}, "steps = 3: input should be greater than or equal to 10"),
        ({"method": "walk", "steps": 20}, "counter: it is missing"),
        ([], "the body: "),
        ({"counter": "abacus", "method": "walk", "steps": 20}, "abacus"),
        ({"counter": "plus_minus", "method": "walk", "steps": 20}, "no calibration 'walk'"),
        ({"counter": "double_threshold", "method": "guess", "steps": 20}, "slowest_walk"),
        ({"counter": "double_threshold", "method": "middle", "seconds": 5}, "from 10 to 600"),
        ({"counter": "gyro_zero_crossing", "method": "slowest_walk", "steps": 20}, "gyroscope"),
    ],
)
async def test_a_wrong_wish_is_refused_with_a_sentence_and_begins_nothing(wanted, said):
    async with standing("normal:30") as lab:
        lab.walk(1)
        assert said in await lab.refused("POST", ALL, 422, json=wanted)
        assert (await lab.ask("GET", ALL))["items"] == []


@pytest.mark.parametrize(("numbers", "status"), [([], 422), (["one"], 422), ([9], 404), ([0], 404)])
async def test_only_what_is_there_can_be_applied(numbers, status):
    async with standing("normal:30") as lab:
        await lab.refused("POST", f"{ALL}/apply", status, json={"numbers": numbers})


@pytest.mark.parametrize(("method", "path"), [("GET", ""), ("GET", "/1"), ("POST", "/1/finish"), ("DELETE", "/1")])
async def test_an_unknown_device_or_number_is_a_404(method, path):
    async with standing("normal:30") as lab:
        assert "nobody" in await lab.refused(method, f"devices/nobody/calibrations{path}", 404)
        if path:
            assert "no calibration 1" in await lab.refused(method, ALL + path, 404)
        if path == "/1":
            await lab.refused(method, f"{ALL}/one", 422)


async def test_counters_tell_how_they_can_be_calibrated():
    async with standing("normal:30") as lab:
        items = (await lab.ask("GET", "counters"))["items"]
        told = {item["name"]: item["calibrations"] for item in items}
        assert told.pop("double_threshold") == ["walk", "middle"]
        assert told.pop("gyro_zero_crossing") == ["slowest_walk"]
        assert not any(told.values())


@pytest.mark.full
async def test_over_the_air_the_window_is_that_of_the_samples():
    async with staged(Bracelet(Walker("normal:600", seed=3)), speed=8) as stage:
        await stage.until(lambda device: device["steps"] > 0)
        (device,) = stage.supervisor.devices
        device.calibrate(Plan(choice=device.lineup.choice("double_threshold"), method="walk", steps=40))
        tape = Tape(device.session)  # in the same turn: not a packet is between them
        now = await stage.poll(f"{ALL}/1", lambda now: now["state"] != "recording", within_s=30)
        assert now["state"] == "done", now["reason"]
        samples = tape.joined(round(now["seconds"] * 50))
        assert now["params"]["first_window"] == sampled_window(samples, TUNED)
        assert now["params"]["first_window"] == pytest.approx(27, abs=2)
