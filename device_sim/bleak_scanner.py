"""bleak's scanner over a bumble device."""

from __future__ import annotations

from typing import Any, ClassVar, Final, cast

from bleak.backends.scanner import AdvertisementData, AdvertisementDataCallback, BaseBleakScanner
from bleak.uuids import normalize_uuid_str
from bumble.core import UUID, AdvertisingData
from bumble.device import Advertisement

from device_sim.central import Central

_UUID_LISTS: Final = (
    AdvertisingData.Type.INCOMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.COMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.INCOMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.COMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS,
)


class BumbleScanner(BaseBleakScanner):
    """bleak's scanner; any number may scan at once."""

    central: ClassVar[Central]

    def __init__(
        self,
        detection_callback: AdvertisementDataCallback | None,
        service_uuids: list[str] | None,
        scanning_mode: str = "active",  # noqa: ARG002  # bleak passes it; the air carries no scan response
        **_platform: object,
    ) -> None:
        super().__init__(detection_callback, service_uuids)

    async def start(self) -> None:
        """Start scanning; BleakError where there is no air."""
        self.seen_devices.clear()
        await self.central.listen(self._on_advertisement)

    async def stop(self) -> None:
        """Stop scanning."""
        await self.central.ignore(self._on_advertisement)

    def _on_advertisement(self, advertisement: Advertisement) -> None:
        data = _advertised(advertisement)
        if not self.is_allowed_uuid(data.service_uuids):
            return
        address = advertisement.address.to_string(with_type_qualifier=False).upper()
        details = {"address": advertisement.address}
        device = self.create_or_update_device(address, address, data.local_name, details, data)
        self.call_detection_callbacks(device, data)


def _advertised(advertisement: Advertisement) -> AdvertisementData:
    """Return bleak's form of an advertisement."""
    # Any: each type of data has a Python type of its own.
    data, kinds = cast(Any, advertisement.data), AdvertisingData.Type
    uuids = [uuid_text(uuid) for kind in _UUID_LISTS for uuids in data.get_all(kind) for uuid in uuids]
    services = (kinds.SERVICE_DATA_16_BIT_UUID, kinds.SERVICE_DATA_128_BIT_UUID)
    return AdvertisementData(
        local_name=data.get(kinds.COMPLETE_LOCAL_NAME) or data.get(kinds.SHORTENED_LOCAL_NAME),
        manufacturer_data={int(k): bytes(v) for k, v in data.get_all(kinds.MANUFACTURER_SPECIFIC_DATA)},
        service_data={uuid_text(uuid): bytes(v) for kind in services for uuid, v in data.get_all(kind)},
        service_uuids=list(dict.fromkeys(uuids)),  # the air reports all twice
        tx_power=data.get(kinds.TX_POWER_LEVEL),
        rssi=advertisement.rssi,
        platform_data=(advertisement,),
    )


def uuid_text(uuid: UUID) -> str:
    """Return a UUID as bleak writes it: 128 bits, lower case."""
    return normalize_uuid_str(uuid.to_hex_str("-") if len(uuid.uuid_bytes) == 16 else uuid.to_hex_str())
