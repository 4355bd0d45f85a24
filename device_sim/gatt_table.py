"""The bracelet's GATT table: its services, and who answers a read or a write of each characteristic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from bumble import att
from bumble.gatt import Characteristic, CharacteristicValue, Service

from device_sim.bracelet import Bracelet
from service.samples import ACCELEROMETER_ONLY
from service.wearables import bracelet as wire
from service.wearables import rsc

_P = Characteristic.Properties
_SIG: Final = "-0000-1000-8000-00805f9b34fb"

Asked = Callable[[object, bytes], None]
"""Takes who wrote, and what; raises an ATT_Error where it is refused."""


class Table:
    """What a bracelet serves; `on_request` takes the writes of its control point.

    Where it is `encrypted`, its own service is read and written on an encrypted link only; the standard ones are open.
    """

    def __init__(self, bracelet: Bracelet, on_request: Asked, *, encrypted: bool) -> None:
        self._bracelet = bracelet
        self._encrypted = encrypted
        self.data = _characteristic(wire.DATA, _P.NOTIFY)
        self.control = _characteristic(wire.CONTROL, _P.WRITE | _P.INDICATE, write=on_request)
        self.register = _characteristic(wire.REGISTER, _P.READ | _P.NOTIFY, bracelet.register_value)
        self.battery = _characteristic(wire.BATTERY_LEVEL, _P.READ | _P.NOTIFY, bracelet.battery_value)
        self.pace = _characteristic(rsc.MEASUREMENT, _P.NOTIFY)
        self.services = [self._own(), Service("180F", [self.battery]), self._about()]
        if bracelet.control:
            feature = _characteristic(rsc.FEATURE, _P.READ, lambda: rsc.encode_feature(rsc.RUNNING))
            self.services.append(Service("1814", [self.pace, feature]))

    def _own(self) -> Service:
        bracelet = self._bracelet
        values = {
            wire.SCALE: bracelet.scale_value,
            wire.RATE: bracelet.rate_value,
            wire.BOOT: bracelet.boot_value,
            wire.DEVICE_ID: bracelet.device_id_value,
            wire.CLOCK: bracelet.clock_value,
        }
        # As old firmware has it: who measures acceleration only need not say so.
        if bracelet.sensors != ACCELEROMETER_ONLY:
            values[wire.SENSORS] = bracelet.sensors_value
        if bracelet.control:
            values |= {wire.HISTORY: bracelet.history_value, wire.UTC: bracelet.utc_value}
        read = [_characteristic(uuid, _P.READ, value) for uuid, value in values.items()]
        more = [self.control, self.register] if bracelet.control else []
        all_of_it = [self.data, *more, *read]
        if self._encrypted:
            for one in all_of_it:
                one.permissions |= Characteristic.READ_REQUIRES_ENCRYPTION | Characteristic.WRITE_REQUIRES_ENCRYPTION
        return Service(wire.SERVICE, all_of_it)

    def _about(self) -> Service:
        texts = {
            wire.MANUFACTURER_NAME: self._bracelet.manufacturer,
            wire.MODEL_NUMBER: self._bracelet.model,
            wire.FIRMWARE_REVISION: self._bracelet.firmware,
        }
        return Service("180A", [_characteristic(uuid, _P.READ, text.encode) for uuid, text in texts.items()])


def _characteristic(
    uuid: str, properties: _P, value: Callable[[], bytes] | None = None, *, write: Asked | None = None
) -> Characteristic[bytes]:
    """Return a characteristic that refuses what it does not offer; bumble would leave a refused write unanswered."""

    def read(_connection: object) -> bytes:
        if value is None:
            raise att.ATT_Error(att.ErrorCode.READ_NOT_PERMITTED)
        return value()

    def refuse(_connection: object, _value: bytes) -> None:
        raise att.ATT_Error(att.ErrorCode.WRITE_NOT_PERMITTED)

    short = uuid[4:8] if uuid.endswith(_SIG) else uuid
    return Characteristic(
        short, properties, Characteristic.READABLE, CharacteristicValue(read=read, write=write or refuse)
    )
