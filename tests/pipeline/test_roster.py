"""The roster: one entry a device, whatever addresses it is heard under."""

import pytest
from fakes import described

from service.errors import LinkError, LinkFault, UnknownDeviceError
from service.pipeline import device as device_module
from service.pipeline.device import TWIN_WAIT_S, UNHEARD, Device
from service.pipeline.lifecycle import PATIENCE, Cause, State
from service.pipeline.lineup import lineup
from service.pipeline.roster import Roster, told_id
from service.samples import Packet
from service.wearables import bracelet as wire


def made(address, *, device_id=None, rssi_dbm=-50):
    one = Device(
        address=address,
        name="Bracelet",
        rssi_dbm=rssi_dbm,
        wearable=wire.Bracelet(),
        lineup=lineup("double_threshold"),
        publish=lambda _: None,
    )
    for packet in described(device=device_id) if device_id else ():
        one.session.apply(packet)
    return one


def roster(*devices):
    one = Roster()
    for device in devices:
        one.add(device)
    return one


def never(_address):
    raise AssertionError("no new device is due")


def test_who_it_is_stands_in_what_was_read():
    assert told_id(wire.Bracelet(), described(device="left")) == "left"
    assert told_id(wire.Bracelet(), []) is None
    broken = Packet(characteristic=wire.DEVICE_ID, data=b"", at_ns=0)
    assert told_id(wire.Bracelet(), [broken]) is None
    assert told_id(wire.Bracelet(), [broken, *described(device="left")]) == "left"


def test_a_new_device_is_the_one_that_was_dialled():
    one = made("A")
    assert roster(one).owner(one, "left", never) is one
    assert roster(one).owner(one, None, never) is one


def test_a_known_id_at_a_new_address_is_the_known_device():
    known, stranger = made("A", device_id="left"), made("B")
    table = roster(known, stranger)
    stranger.move(Cause.ATTEMPT)
    assert table.owner(stranger, "left", never) is known
    table.hand_over(stranger, known)
    assert table.devices == [known]
    assert (known.address, known.id) == ("B", "left")
    assert table.find("B") is table.find("left") is table.at("B") is known
    assert table.at("A") is None
    with pytest.raises(UnknownDeviceError):
        table.find("A")


def test_another_device_at_a_known_address_is_another():
    known = made("A", device_id="left")
    known.wanted = True
    table = roster(known)
    known.move(Cause.ATTEMPT)
    other = table.owner(known, "right", made)
    assert other is not known
    table.hand_over(known, other)
    assert table.devices == [known, other]
    assert table.at("A") is other
    assert known.state is State.LOST
    assert "A" in known.reason
    stranger = made("C")
    table.add(stranger)
    table.hand_over(stranger, table.owner(stranger, "left", never))
    assert (table.at("A"), table.at("C")) == (other, known)


def test_nothing_is_known_twice():
    table = roster(made("A", device_id="left"))
    with pytest.raises(ValueError, match="left"):
        table.add(made("B", device_id="left"))


def test_a_remembered_device_is_lost_until_it_is_heard():
    one = made("A", device_id="left", rssi_dbm=None)
    assert (one.state, one.reason, one.rssi_dbm) == (State.LOST, UNHEARD, None)
    one.wanted = True
    assert one.is_due


def test_whoever_was_asked_for_stays_so_under_its_true_name():
    known, stranger = made("A", device_id="left"), made("B")
    known.unwant()
    stranger.want()
    roster(known, stranger).hand_over(stranger, known)
    assert known.wanted
    assert known.state is State.LOST


def failed(device, fault):
    device.move(Cause.ATTEMPT)
    device.lost(LinkError(fault, "why"))


def wait_s(device, monkeypatch):
    now = device._moved_s
    monkeypatch.setattr(device_module.time, "monotonic", lambda: now)
    return device.not_before_s - now


def test_a_device_that_is_not_ours_is_tried_once_more_at_once_then_with_patience(monkeypatch):
    one = made("A")
    failed(one, LinkFault.NOT_OURS)
    assert wait_s(one, monkeypatch) <= PATIENCE.first_s
    failed(one, LinkFault.NOT_OURS)
    assert wait_s(one, monkeypatch) == PATIENCE.cap_s


def test_a_twin_waits_long_but_not_longer_than_it_must(monkeypatch):
    known, twin = made("A", device_id="left"), made("B")
    known.wanted = twin.wanted = True
    known.move(Cause.ATTEMPT)
    known.move(Cause.CONNECTED)
    twin.twin = known
    failed(twin, LinkFault.TWIN)
    now = [twin._moved_s]
    assert twin.not_before_s - now[0] == TWIN_WAIT_S
    monkeypatch.setattr(device_module.time, "monotonic", lambda: now[0])
    now[0] += 100
    assert not twin.is_due
    known.lost(LinkError(LinkFault.LOST, "gone"))
    assert not twin.is_due
    now[0] += device_module.TWIN_GRACE_S
    assert twin.is_due
    known.move(Cause.ATTEMPT)
    assert not twin.is_due


def test_a_loss_that_comes_after_the_end_changes_nothing():
    one = made("A")
    one.unwant()
    one.lost(LinkError(LinkFault.LOST, "late"))
    assert one.state is State.DISCONNECTED


def test_an_address_that_never_told_its_id_is_forgotten(monkeypatch):
    known, seen, heard, linked = made("A", device_id="left"), made("B"), made("C"), made("D")
    table = roster(known, seen, heard, linked)
    linked.move(Cause.ATTEMPT)
    now = [seen._heard_s + device_module.FORGET_S - 1]
    monkeypatch.setattr(device_module.time, "monotonic", lambda: now[0])
    table.forget()
    assert table.devices == [known, seen, heard, linked]
    heard.heard(None, -60, tell_every_s=5)
    now[0] += 2
    table.forget()
    assert table.devices == [known, heard, linked]
    assert table.at("B") is None
