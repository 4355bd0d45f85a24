"""Whose data are whose: owners, and the deletion of all that is a person's."""

import asyncio
import sqlite3
import subprocess
import sys

import pytest
from stage import serving, staged

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.source import WalkerSource

PERSON = "api/v1/devices/sim-1/person"
OWNERS = "SELECT since_ns, name FROM sessions JOIN persons ON persons.id = sessions.person ORDER BY since_ns"


def walking():
    return Bracelet(WalkerSource("normal:600", seed=3))


@pytest.mark.full
async def test_a_persons_data_are_gone_for_good_and_the_device_is_left_alone(tmp_path):
    path = tmp_path / "s.db"
    async with staged(walking(), speed=8, path=path) as stage:
        await stage.until(lambda device: device["steps"] > 10)
        answer = await stage.http.put(PERSON, json={"person": "Anna-Lena"})
        assert answer.status_code == 204, answer.text
        walk = {"counter": "double_threshold", "method": "walk", "pace": "normal", "seconds": 60}
        begun = await stage.http.post("api/v1/devices/sim-1/calibrations", json=walk)
        assert begun.status_code == 201, begun.text
        await asyncio.sleep(1.5)
        assert b"Anna-Lena" in b"".join(file.read_bytes() for file in path.parent.glob("s.db*"))
        answer = await stage.http.delete("api/v1/persons/Anna-Lena")
        assert (answer.status_code, answer.json()) == (200, {"sessions": 1})
        device = await stage.device()
        assert (device["state"], device["steps"], device["samples"]) == ("disconnected", 0, 0)
        for kept in ("steps?session=all", "calibrations"):
            assert (await stage.http.get(f"api/v1/devices/sim-1/{kept}")).json()["items"] == []
        assert b"Anna-Lena" not in b"".join(file.read_bytes() for file in path.parent.glob("s.db*"))
        again = await stage.http.delete("api/v1/persons/Anna-Lena")
        assert again.status_code == 404
        assert "Anna-Lena" in again.json()["detail"]
        await stage.http.post("api/v1/devices/sim-1/connect")
        anew = await stage.until(lambda device: device["state"] == "streaming" and device["steps"] > 0)
        assert anew["steps"] < 10


@pytest.mark.full
async def test_another_person_gets_a_session_of_their_own(tmp_path):
    async with staged(walking(), speed=8, path=tmp_path / "s.db") as stage:
        before = await stage.until(lambda device: device["steps"] > 10)
        await stage.http.put(PERSON, json={"person": "P1"})
        await asyncio.sleep(1.5)
        assert (await stage.device())["session_since"] == before["session_since"]
        await stage.http.put(PERSON, json={"person": "P2"})
        after = await stage.until(lambda device: device["state"] == "streaming" and device["samples"] > 100)
        assert after["session_since"] > before["session_since"]
        await stage.until(lambda device: device["steps"] > 2)
        own = (await stage.http.get("api/v1/devices/sim-1/steps")).json()["items"]
        assert own[0]["steps"] == 1
        owners = {}
        async with asyncio.timeout(5):
            while len(owners) < 2:
                await asyncio.sleep(0.1)
                with sqlite3.connect(tmp_path / "s.db") as database:
                    owners = dict(database.execute(OWNERS).fetchall())
                database.close()
        assert list(owners.values()) == ["P1", "P2"]
        every = (await stage.http.get("api/v1/devices/sim-1/steps?session=all&limit=1000")).json()["items"]
        assert len(every) > len(own) + 9
        answer = await stage.http.delete("api/v1/persons/P1")
        assert answer.json() == {"sessions": 1}
        assert (await stage.device())["state"] == "streaming"


@pytest.mark.parametrize("person", ["", "a/b", "x" * 81, "a\nb"])
async def test_a_name_that_is_none_is_refused(tmp_path, person):
    async with LocalAir() as air, serving(air, path=tmp_path / "s.db") as stage:
        answer = await stage.http.put(PERSON, json={"person": person})
        assert answer.status_code == 422
        assert "person" in answer.json()["detail"]


async def test_nobody_owns_an_unknown_device(tmp_path):
    async with LocalAir() as air, serving(air, path=tmp_path / "s.db") as stage:
        answer = await stage.http.put(PERSON, json={"person": "P1"})
        assert answer.status_code == 404


def forget(*words):
    command = [sys.executable, "-m", "service.cli", "forget", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)


@pytest.mark.full
async def test_a_person_is_forgotten_by_command_while_no_service_runs(tmp_path):
    path = tmp_path / "s.db"
    async with staged(walking(), speed=8, path=path) as stage:
        await stage.until(lambda device: device["steps"] > 10)
        await stage.http.put(PERSON, json={"person": "P1"})
        busy = await asyncio.to_thread(forget, "P1", "--store", path)
        assert busy.returncode == 2
        assert "in use by another steplink" in busy.stderr
    for words, said in ((("p1", "--store", path), "p1"), (("P1", "--store", tmp_path / "none.db"), "no such file")):
        refused = forget(*words)
        assert refused.returncode == 2
        assert said in refused.stderr
    done = forget("P1", "--store", path)
    assert (done.returncode, done.stdout) == (0, "1 sessions of P1 were deleted for good\n")


async def test_ready_says_what_does_not_work(tmp_path):
    async with LocalAir() as air, serving(air, path=tmp_path / "s.db") as stage:
        ready = await stage.http.get("readyz")
        assert (ready.status_code, ready.json()) == (200, {"ready": True, "reasons": []})
