"""What a device measures, over the API: its sensors, what they are too little for, and where they ended."""

import logging

import pytest
from stage import staged

from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from device_sim.gatt import Start
from service.samples import Sensor

ALL = tuple(Sensor)
FLAT_OUT = {"speed": 40, "start": Start.ON_SUBSCRIBE}


def worn(**how):
    return Bracelet(Walker("normal:60", seed=3, **how))


def choose(*names):
    return {"counters": [{"name": name, "preset": "tuned", "params": {}} for name in names]}


async def test_a_counter_that_needs_more_than_the_device_has_is_refused_as_the_primary():
    async with staged(worn(), **FLAT_OUT) as stage:
        device = await stage.until(lambda device: device["steps"] > 0)
        assert (device["sensors"], device["counter_faults"]) == (["accelerometer"], {})
        before = (await stage.http.get("api/v1/devices/sim-1/counters")).json()
        answer = await stage.http.put("api/v1/devices/sim-1/counters", json=choose("gyro_zero_crossing"))
        why = "gyro_zero_crossing needs gyroscope; the device has accelerometer"
        assert (answer.status_code, answer.json()) == (422, {"detail": why})
        assert (await stage.http.get("api/v1/devices/sim-1/counters")).json() == before
        beside = choose("double_threshold", "gyro_zero_crossing")
        assert (await stage.http.put("api/v1/devices/sim-1/counters", json=beside)).json() == beside
        assert (await stage.device())["counter_faults"] == {"gyro_zero_crossing": why}


@pytest.mark.full
async def test_a_service_whose_counter_the_device_cannot_serve_says_so(caplog):
    with caplog.at_level(logging.WARNING):
        async with staged(worn(), counter="fusion", **FLAT_OUT) as stage:
            device = await stage.until(lambda device: device["samples"] > 500)
    why = "fusion needs gyroscope, magnetometer; the device has accelerometer"
    assert (device["primary"], device["counter_faults"]) == ("fusion", {"fusion": why})
    assert (device["steps"], device["steps_now"], device["cadence_spm"]) == (0, 0, None)
    assert f"sim-1: not counted: {why}" in caplog.text


async def test_a_counter_of_the_gyroscope_counts_on_a_device_that_has_one():
    async with staged(worn(sensors=ALL), **FLAT_OUT) as stage:
        await stage.until(lambda device: device["steps"] > 0)
        answer = await stage.http.put("api/v1/devices/sim-1/counters", json=choose("gyro_zero_crossing"))
        assert answer.status_code == 200
        device = await stage.until(lambda device: device["counters"].get("gyro_zero_crossing", 0) > 20)
        assert (device["sensors"], device["counter_faults"]) == (list(ALL), {})


@pytest.mark.full
async def test_at_the_smallest_mtu_the_field_is_left_out_and_the_device_says_so():
    async with staged(worn(sensors=ALL), beside=["gyro_zero_crossing", "fusion"], max_mtu=23, **FLAT_OUT) as stage:
        device = await stage.until(lambda device: device["counters"]["gyro_zero_crossing"] > 20)
    assert device["sensors"] == list(ALL)
    assert list(device["counter_faults"]) == ["fusion"]
    assert "MTU" in device["counter_faults"]["fusion"]
    assert (device["samples_lost"], device["packets_bad"]) == (0, 0)


@pytest.mark.full
async def test_under_ten_samples_a_second_nothing_is_counted_and_the_device_says_why():
    async with staged(worn(rate_hz=5.0), **FLAT_OUT) as stage:
        device = await stage.until(lambda device: device["samples"] >= 200)
    assert device["counter_faults"] == {"steplink": "steplink needs 10 samples a second or more; the device takes 5"}
    assert (device["steps"], device["steps_now"]) == (0, 0)


@pytest.mark.parametrize(("strength", "expected"), [(1.0, False), (60.0, True)])
async def test_samples_beyond_the_sensors_range_are_told(strength, expected):
    bracelet = worn(strength=strength)
    async with staged(bracelet, **FLAT_OUT) as stage:
        device = await stage.until(lambda device: device["samples"] >= 1000)
    assert (device["samples_saturated"] > 10) is expected
    assert device["samples_saturated"] <= device["samples"]
