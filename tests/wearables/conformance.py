"""What every wearable's protocol is held to. A new one is a line in WEARABLES and runs through all of it."""

import uuid
from collections.abc import Callable
from dataclasses import dataclass

from service.errors import WireError
from service.samples import DeviceInfo, RawBlock, Reply, Sensor
from service.wearables import bracelet
from service.wearables.contract import Read, Subscribe, Wearable, Write

FOREIGN = "00002a99-0000-1000-8000-00805f9b34fb"


@dataclass(frozen=True)
class Case:
    """A wearable, the values a host has read before data comes, and one good value of data."""

    make: Callable[[], Wearable]
    said: dict[str, bytes]
    data: tuple[str, bytes]


NINE_AXES = bracelet.DataPacket(boot=7, index=128, tick=99, counts=[range(9), range(-9, 0)], sensors=tuple(Sensor))

WEARABLES = {
    "bracelet": Case(
        make=bracelet.Bracelet,
        said={bracelet.SCALE: bracelet.encode_scale(4096), bracelet.BOOT: bracelet.encode_boot(7)},
        data=(
            bracelet.DATA,
            bracelet.encode(bracelet.DataPacket(boot=7, index=128, tick=99, counts=[(1, 2, 3), (4, 5, 6)])),
        ),
    ),
    "bracelet with all sensors": Case(
        make=bracelet.Bracelet,
        said={
            bracelet.SENSORS: bracelet.encode_sensors(tuple(Sensor), lsb_per_rad_s=900, lsb_per_100_ut=6400),
            bracelet.SCALE: bracelet.encode_scale(4096),
            bracelet.BOOT: bracelet.encode_boot(7),
        },
        data=(bracelet.DATA, bracelet.encode(NINE_AXES)),
    ),
}


def ready(case):
    wearable = case.make()
    for characteristic, data in case.said.items():
        wearable.feed(characteristic, data)
    return wearable


def check_services(case):
    """A scan compares strings: so they are 128-bit UUIDs in lower case."""
    services = case.make().services
    assert services
    assert all(str(uuid.UUID(service)) == service for service in services)


def check_handshake(case):
    """Reads, then subscriptions, so that no packet comes before its scale, then writes; always the same."""
    actions = case.make().handshake()
    assert list(actions) == list(case.make().handshake())
    places = [(Read, Subscribe, Write).index(type(action)) for action in actions]
    assert 1 in places
    assert sorted(places) == places


def check_data(case):
    """A good value gives samples whose columns are equally long."""
    block = ready(case).feed(*case.data)
    assert isinstance(block, RawBlock)
    held = [columns for columns in (block.acc_g, block.gyro_rad_s, block.mag_ut) if columns is not None]
    assert len(held) == len(block.sensors)
    assert {len(column) for columns in held for column in columns} == {len(block)}
    assert len(block) > 0
    assert all(0 <= at < len(block) for at in block.saturated)


def check_foreign(case):
    """A characteristic that is not its own holds nothing for us."""
    assert ready(case).feed(FOREIGN, b"anything") is None


def check_any_bytes(case, characteristic, data):
    """Any bytes give samples, a description, nothing, or a WireError; and leave the decoder as good as before."""
    wearable = ready(case)
    try:
        said = wearable.feed(characteristic, data)
        assert said is None or isinstance(said, RawBlock | DeviceInfo | Reply)
    except WireError as error:
        assert error.why
    if characteristic == case.data[0]:
        assert wearable.feed(*case.data) == ready(case).feed(*case.data)


def check_history(case):
    """Asking for samples again is a list of writes, perhaps an empty one."""
    assert all(isinstance(write, Write) for write in ready(case).history(1, 0, 1000))
