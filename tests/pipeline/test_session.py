"""A session tells at once which counters cannot count, and on the log once."""

import logging

from fakes import data_packet, described

from service.pipeline.lineup import lineup
from service.pipeline.notices import DeviceChanged
from service.pipeline.session import Session
from service.samples import Sensor
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

A, G, M = Sensor


def session(counter, published, **said):
    chosen = lineup(counter)
    made = Session(lambda: "sim-1", Tracker(wire.Bracelet(), chosen.makers, primary=counter), published.append)
    for packet in described(**said):
        made.apply(packet)
    return made


def test_a_missing_sensor_is_on_the_log_before_the_first_sample(caplog):
    published = []
    with caplog.at_level(logging.WARNING):
        session("fusion", published)
    why = "fusion needs gyroscope, magnetometer; the device has accelerometer"
    assert [record.getMessage() for record in caplog.records] == [f"sim-1: not counted: {why}"]
    assert isinstance(published[-1].event, DeviceChanged)


def test_a_sensor_that_comes_and_goes_is_on_the_log_once_and_told_each_time(caplog):
    published = []
    with caplog.at_level(logging.WARNING):
        made = session("gyro_zero_crossing", published, sensors=(A, G))
        at, changes = 0, 0
        for held in [(A, G), (A,), (A, G), (A,), (A, G)]:
            published.clear()
            made.apply(data_packet(at, sensors=held))
            changes += any(isinstance(notice.event, DeviceChanged) for notice in published)
            at += 10
    assert len(caplog.records) == 1
    assert "does not send" in caplog.text
    assert changes >= 4
