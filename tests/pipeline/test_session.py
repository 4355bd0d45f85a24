"""A session: what it tells, to whom, and the host time it tells it with."""

import logging
from dataclasses import replace

from fakes import MetronomeCounter, data_packet, data_packets, described

from service.events import Gap, Gridded, Rebooted, StepCounted
from service.pipeline.lineup import lineup
from service.pipeline.notices import DeviceChanged
from service.pipeline.session import Session
from service.samples import GRID_HZ, Sensor, Step, Update
from service.tracking.backfill import BackfillTracker
from service.wearables import bracelet as wire


class LateCounter(MetronomeCounter):
    """Decides one more step at the end of a stream."""

    def finish(self):
        return Update(steps=(Step(at_s=self._next / GRID_HZ, strength=1.0),))


def session(told):
    tracker = BackfillTracker(wire.Bracelet(), {"late": LateCounter}, primary="late")
    made = Session(lambda: "dev-1", tracker, told.append)
    for packet in described():
        made.apply(packet)
    return made


def test_steps_decided_at_a_reboot_happened_before_it():
    """Device time begins anew, so the clock of the first boot must label them."""
    told = []
    made = session(told)
    for packet in data_packets([10] * 50):
        made.apply(packet)
    for packet in data_packets([10] * 5, boot=2):
        made.apply(replace(packet, at_ns=packet.at_ns + 20_000_000_000))
    steps = [notice for notice in told if isinstance(notice.event, StepCounted)]
    (reboot,) = (notice for notice in told if isinstance(notice.event, Rebooted))
    assert [step.event.boot for step in steps[:-2]] == [1] * 21
    at_ns = [step.at_ns - steps[0].at_ns for step in steps[:21]]
    assert at_ns == [round(n * 0.5e9) for n in range(21)]
    assert reboot.at_ns - steps[0].at_ns > 20e9


def test_observers_hear_everything_in_order_and_the_public_hears_no_samples():
    told, heard = [], []
    made = session(told)
    for packet in data_packets([10] * 3):
        made.apply(packet)
    made.observers.append(heard.append)
    told.clear()
    for packet in data_packets([10] * 30, start=30):
        made.apply(packet)
    blocks = [notice.event.block for notice in heard if isinstance(notice.event, Gridded)]
    assert [block.start for block in blocks] == list(range(30, 330, 10))
    assert [notice for notice in heard if not isinstance(notice.event, Gridded)] == told


def test_an_observer_may_leave_while_it_is_told():
    heard = []

    def once(notice):
        heard.append(notice)
        made.observers.remove(once)

    made = session([])
    made.observers += [once, once]
    for packet in data_packets([10]):
        made.apply(packet)
    assert len(heard) == 2
    assert made.observers == []


A, G, M = Sensor


def described_to(counter, published, **said):
    chosen = lineup(counter)
    made = Session(lambda: "sim-1", BackfillTracker(wire.Bracelet(), chosen.makers, primary=counter), published.append)
    for packet in described(**said):
        made.apply(packet)
    return made


def test_a_missing_sensor_is_on_the_log_before_the_first_sample(caplog):
    published = []
    with caplog.at_level(logging.WARNING):
        described_to("fusion", published)
    why = "fusion needs gyroscope, magnetometer; the device has accelerometer"
    assert [record.getMessage() for record in caplog.records] == [f"sim-1: not counted: {why}"]
    assert isinstance(published[-1].event, DeviceChanged)


def test_a_sensor_that_comes_and_goes_is_on_the_log_once_and_told_each_time(caplog):
    published = []
    with caplog.at_level(logging.WARNING):
        made = described_to("gyro_zero_crossing", published, sensors=(A, G))
        at, changes = 0, 0
        for held in [(A, G), (A,), (A, G), (A,), (A, G)]:
            published.clear()
            made.apply(data_packet(at, sensors=held))
            changes += any(isinstance(notice.event, DeviceChanged) for notice in published)
            at += 10
    assert len(caplog.records) == 1
    assert "does not send" in caplog.text
    assert changes >= 4


async def test_a_session_that_ends_decides_what_is_pending_and_tells_what_was_behind_a_hole():
    told = []
    made = session(told)
    for packet in data_packets([10] * 10):
        made.apply(packet)
    for packet in data_packets([10] * 3, start=120):
        made.apply(packet)
    before = len([notice for notice in told if isinstance(notice.event, StepCounted)])
    await made.close(ended=True)
    steps = [notice.event for notice in told if isinstance(notice.event, StepCounted)]
    assert before == 4
    assert [step.steps for step in steps] == list(range(1, len(steps) + 1))
    assert steps[-1].step.at_s == 3.0
    assert [notice.event.samples for notice in told if isinstance(notice.event, Gap)] == [20]
