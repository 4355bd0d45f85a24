"""Whether somebody walks, over the API: verdict, confidence, cadence, walks, and what was refused and why."""

import asyncio
import json
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from api.standing import standing
from fakes import GateCounter, MetronomeCounter, data_packets
from pydantic import TypeAdapter
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.api import models
from service.api.views import event_view
from service.counters import registry
from service.events import Counting, Walked

MESSAGE = TypeAdapter(models.LiveMessage)
pytestmark = pytest.mark.usefixtures("gate")


@dataclass(frozen=True)
class Nothing:
    """Parameters of a counter that has none."""


@pytest.fixture
def gate(monkeypatch):
    """The registry with the fake counters, which know what the ramp is."""
    known = dict(registry.COUNTERS)
    for make in (GateCounter, MetronomeCounter):
        known[make.name] = registry.CounterKind(
            name=make.name,
            params=Nothing,
            presets={"paper": Nothing(), "tuned": Nothing()},
            sensors=registry.ACCELEROMETER,
            build=lambda _params, make=make: make(),
            calibrations={},
        )
    monkeypatch.setattr(registry, "COUNTERS", known)


async def shown(packets, *, counter="gate", beside=("metronome",)):
    """The device by the API, and what the feed tells, after packets of the ramp."""
    async with standing("rest:1", counter=counter, beside=beside) as api:
        (stand,) = api.stands
        for packet in data_packets([10] * packets, boot=stand.bracelet.boot):
            stand.device.session.apply(packet)
        device = await api.ask("GET", "devices/sim-1")
        supervisor = SimpleNamespace(device=lambda _id: stand.device)
        return device, [(notice.event, event_view(notice, supervisor)) for notice in stand.told]


def only(told, kind):
    return [view for event, view in told if isinstance(event, kind)]


async def test_a_device_says_whether_its_wearer_walks_and_what_was_refused():
    device, _ = await shown(100)
    assert device["gait"] == {"verdict": "walking", "confidence": 0.95, "device_s": 983 / 50}
    assert device["cadence_spm"] == 120.0
    assert device["refused"] == {"metronome": {"rest": 4, "other": 8, "perhaps": 2}}
    resting, _ = await shown(5)
    assert (resting["gait"]["verdict"], resting["cadence_spm"], resting["refused"]) == ("rest", None, {})


async def test_the_feed_tells_verdict_and_walks():
    _, told = await shown(120)
    counted = [view.model_dump(mode="json") for view in only(told, Counting)]
    assert [view["gait"]["verdict"] for view in counted[:: len(counted) // 10]][-4:] == ["walking"] * 3 + ["rest"]
    walks = [view.model_dump(mode="json") for view in only(told, Walked)]
    assert [(walk["type"], walk["status"], walk["device_s"], walk["counter"]) for walk in walks] == [
        ("walk", "began", 7.66, "gate"),
        ("walk", "ended", 19.66, "gate"),
    ]
    assert walks[0]["ordinal"] < walks[1]["ordinal"]
    for view in (*counted, *walks):
        MESSAGE.validate_python(view)


async def test_walks_are_listed_page_by_page():
    async with standing("rest:1", counter="gate", beside=("metronome",)) as api:
        (stand,) = api.stands
        for packet in data_packets([10] * 190, boot=stand.bracelet.boot):
            stand.device.session.apply(packet)
        first = await api.ask("GET", "devices/sim-1/walks?limit=2")
        assert [(walk["status"], walk["device_s"]) for walk in first["items"]] == [("began", 7.66), ("ended", 19.66)]
        rest = await api.ask("GET", f"devices/sim-1/walks?after={first['next']}")
        assert ([walk["status"] for walk in rest["items"]], rest["next"]) == (["began"], None)
        steps = await api.ask("GET", "devices/sim-1/steps?counter=gate&limit=1000")
        assert {step["type"] for step in steps["items"]} == {"step"}
        assert "offset" in await api.refused("GET", "devices/sim-1/walks?from=2026-01-02T03:00:00", 422)
        assert await api.refused("GET", "devices/nobody/walks", 404)


async def test_a_counter_without_a_verdict_says_none():
    device, told = await shown(120, counter="metronome", beside=("gate",))
    assert (device["gait"], device["refused"]) == (None, {})
    assert device["cadence_spm"] == pytest.approx(120.0)
    assert only(told, Walked) == []


async def test_a_device_that_is_not_connected_says_nothing_of_now():
    async with standing("rest:1", counter="gate") as api:
        (stand,) = api.stands
        for packet in data_packets([10] * 100, boot=stand.bracelet.boot):
            stand.device.session.apply(packet)
        stand.lose()
        device = await api.ask("GET", "devices/sim-1")
    assert (device["state"], device["gait"], device["cadence_spm"]) == ("lost", None, None)


async def test_the_schema_says_what_each_means():
    async with standing("rest:1", counter="gate") as api:
        schemas = (await api.http.get("/openapi.json")).json()["components"]["schemas"]
    assert schemas["Verdict"]["enum"] == ["rest", "other", "perhaps", "walking"]
    gait = schemas["GaitModel"]["properties"]
    assert (gait["confidence"]["minimum"], gait["confidence"]["maximum"]) == (0.0, 1.0)
    for properties in (gait, schemas["RefusedModel"]["properties"]):
        assert all(field.get("description") for field in properties.values())


@pytest.mark.full
async def test_our_own_counter_over_the_air():
    """A real GATT bracelet, the real service: somebody rests, walks for twenty seconds, and rests."""
    bracelet = Bracelet(Walker("rest:16,normal:20,rest:60", seed=3))
    async with staged(bracelet, speed=4, counter="steplink", beside=["double_threshold"]) as stage:
        async with stage.live() as feed:
            walking = await stage.until(lambda device: device["gait"] and device["gait"]["verdict"] == "walking")
            assert walking["gait"]["confidence"] > 0.5
            assert walking["cadence_spm"] == pytest.approx(110, abs=20)
            page = await stage.poll("devices/sim-1/walks", lambda page: len(page["items"]) == 2)
            heard = []
            async with asyncio.timeout(20):
                while [one["type"] for one in heard].count("walk") < 2:
                    heard.append(json.loads(await feed.recv()))
        resting = await stage.device()
    assert [one for one in heard if one["type"] == "walk"] == page["items"]
    began, ended = page["items"]
    assert (began["status"], ended["status"]) == ("began", "ended")
    assert ended["device_s"] - began["device_s"] == pytest.approx(20, abs=1.5)
    assert (resting["gait"]["verdict"], resting["cadence_spm"]) == ("rest", None)
    steps = [one for one in heard if one["type"] == "step" and one["counter"] == "steplink"]
    assert all(began["device_s"] <= step["device_s"] <= ended["device_s"] + 0.5 for step in steps)
    assert len(steps) > 30
