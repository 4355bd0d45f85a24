"""Trials over the API: two wrists, one walk, and the table of what each counted."""

import asyncio
import csv
import io

import pytest
from api.standing import standing
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker

BOTH = {"devices": ["sim-1", "sim-2"]}
WALK = "rest:8,normal:30,rest:120"


async def walked(lab, **wanted):
    """Two wrists walk one trial to its end; return it as it was when it was finished."""
    begun = await lab.ask("POST", "trials", 201, json=BOTH | wanted)
    lab.walk(45)
    return await lab.ask("POST", f"trials/{begun['number']}/finish")


async def test_a_trial_from_its_beginning_to_the_table():
    async with standing(WALK, WALK) as lab:
        wrists = {"sim-1": "left", "sim-2": "right"}
        begun = await lab.ask("POST", "trials", 201, json=BOTH | {"name": "slow", "wrists": wrists})
        assert (begun["state"], begun["name"], begun["true_steps"]) == ("walking", "slow", None)
        assert [(row["device"], row["wrist"], row["steps"]) for row in begun["rows"]] == [
            ("sim-1", "left", 0),
            ("sim-2", "right", 0),
        ]
        lab.walk(20)
        now = await lab.ask("GET", "trials/1")
        assert all(0 < row["steps"] <= row["steps_now"] for row in now["rows"])
        lab.walk(25)
        true = lab.stands[0].true_steps
        ended = await lab.ask("POST", "trials/1/finish", json={"true_steps": true})
        assert (ended["state"], ended["true_steps"]) == ("settling", true)
        assert ended["rows"][0]["error"] is None
        assert len((await lab.ask("GET", "trials/table.csv")).splitlines()) == 1
        lab.walk(12)
        done = await lab.ask("GET", "trials/1")
        assert done["state"] == "done"
        for row in done["rows"]:
            assert row["error"] == row["steps"] - true
            assert row["accuracy_percent"] == pytest.approx(100 * (1 - abs(row["error"]) / true))
            assert row["note"] is None
        errors = [row["error"] for row in done["rows"]]
        assert done["mean"]["error"] == sum(errors) / 2
        assert done["mean"]["accuracy_percent"] > 90
        assert await lab.ask("GET", "trials") == {"items": [done], "next": None}
        rows = list(csv.DictReader(io.StringIO(await lab.ask("GET", "trials/table.csv"))))
        assert [(row["device"], row["test item"], row["counted steps"]) for row in rows[:2]] == [
            (row["device"], "slow", str(row["steps"])) for row in done["rows"]
        ]
        assert [row["test item"] for row in rows[2:]] == ["mean", "mean"]


async def test_the_table_is_a_file_of_its_own():
    async with standing(WALK, WALK) as lab:
        answer = await lab.http.get("/api/v1/trials/table.csv")
        assert answer.headers["content-type"] == "text/csv; charset=utf-8"
        assert "trials.csv" in answer.headers["content-disposition"]


async def test_the_true_number_may_come_later_and_be_put_right():
    async with standing(WALK, WALK) as lab:
        await walked(lab)
        lab.walk(12)
        assert (await lab.ask("GET", "trials/1"))["rows"][0]["accuracy_percent"] is None
        told = await lab.ask("PATCH", "trials/1", json={"true_steps": 60})
        assert told["rows"][0]["error"] == told["rows"][0]["steps"] - 60
        named = await lab.ask("PATCH", "trials/1", json={"name": "fast"})
        assert (named["name"], named["true_steps"]) == ("fast", 60)
        assert (await lab.ask("PATCH", "trials/1", json={"true_steps": None}))["true_steps"] is None
        await lab.ask("DELETE", "trials/1", 204)
        assert "no trial 1" in await lab.refused("GET", "trials/1", 404)


async def test_an_end_that_is_refused_changes_nothing():
    async with standing(WALK, WALK) as lab:
        await lab.ask("POST", "trials", 201, json=BOTH)
        await lab.refused("POST", "trials/1/finish", 422, json={"true_steps": -1})
        assert (await lab.ask("GET", "trials/1"))["state"] == "walking"
        await lab.ask("POST", "trials/1/finish", json={"true_steps": 10})
        assert "cannot finish" in await lab.refused("POST", "trials/1/finish", 409, json={"true_steps": 20})
        assert (await lab.ask("GET", "trials/1"))["true_steps"] == 10


async def test_what_hurts_a_count_is_noted_beside_it():
    async with standing(WALK, WALK) as lab:
        await lab.ask("POST", "trials", 201, json=BOTH)
        lab.walk(12)
        lab.stands[0].walk(3, heard=False)
        lab.stands[1].walk(3)
        lab.walk(10)
        hurt, whole = (await lab.ask("POST", "trials/1/finish"))["rows"]
        assert "samples missing for 3." in hurt["note"]
        assert whole["note"] is None


async def test_a_device_is_in_one_walking_trial_and_must_stream():
    async with standing(WALK, WALK, WALK) as lab:
        await lab.ask("POST", "trials", 201, json=BOTH)
        wanted = {"devices": ["sim-2", "sim-3"]}
        assert "sim-2 walks in trial 1" in await lab.refused("POST", "trials", 409, json=wanted)
        await lab.ask("POST", "trials/1/finish")
        await lab.ask("POST", "trials", 201, json=wanted)
        lab.stands[0].lose()
        wanted = {"devices": ["sim-1", "sim-3"]}
        assert "sim-1 is lost" in await lab.refused("POST", "trials", 409, json=wanted)


@pytest.mark.parametrize(
    ("wanted", "status", "said"),
    [
        ({"devices": ["sim-1"]}, 422, "at least 2"),
        ({"devices": ["sim-1", "sim-1"]}, 422, "different"),
        ({"devices": ["sim-1", "sim-1:address"]}, 422, "different"),
        ({"devices": ["sim-1", "nobody"]}, 404, "nobody"),
        (BOTH | {"wrists": {"sim-3": "left"}}, 422, "sim-3"),
        (BOTH | {"wrists": {"sim-1": "ankle"}}, 422, "left"),
        (BOTH | {"name": ""}, 422, "at least 1"),
        (BOTH | {"colour": "red"}, 422, "extra inputs"),
    ],
)
async def test_a_wrong_wish_is_refused_with_a_sentence(wanted, status, said):
    async with standing(WALK, WALK) as lab:
        assert said in await lab.refused("POST", "trials", status, json=wanted)
        assert (await lab.ask("GET", "trials"))["items"] == []


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [("GET", "9", {}), ("POST", "9/finish", {}), ("PATCH", "9", {"json": {"name": "x"}}), ("DELETE", "9", {})],
)
async def test_an_unknown_trial_is_a_404_that_says_where_to_look(method, path, body):
    async with standing(WALK, WALK) as lab:
        assert "/api/v1/trials" in await lab.refused(method, f"trials/{path}", 404, **body)


async def test_openapi_describes_every_field_of_what_is_asked():
    async with standing(WALK, WALK) as lab:
        openapi = (await lab.http.get("/openapi.json")).json()
        for name in ("CalibrationWanted", "TrialWanted", "TrialEnd", "TrialChange"):
            properties = openapi["components"]["schemas"][name]["properties"]
            assert [key for key, told in properties.items() if "description" not in told] == []
        for path, operations in openapi["paths"].items():
            for operation in operations.values():
                assert operation.get("description"), path
                assert "404" in operation["responses"] or "{" not in path


@pytest.mark.full
async def test_two_bracelets_on_the_air_are_a_trial():
    left, right = (Bracelet(Walker("normal:600", seed=seed), device_id=f"sim-{seed}") for seed in (1, 2))
    async with staged(left, right) as stage:
        await stage.poll("devices", both_stream, within_s=20)
        begun = await stage.http.post("api/v1/trials", json=BOTH)
        assert begun.status_code == 201, begun.text
        await asyncio.sleep(10)
        await stage.http.post("api/v1/trials/1/finish", json={"true_steps": 18})
        now = await stage.poll("trials/1", lambda trial: trial["state"] == "done", within_s=20)
        assert [row["device"] for row in now["rows"]] == ["sim-1", "sim-2"]
        assert all(row["steps"] == pytest.approx(18, abs=3) and row["note"] is None for row in now["rows"])


def both_stream(devices):
    return [device["state"] == "streaming" and device["samples"] > 0 for device in devices["items"]] == [True, True]
