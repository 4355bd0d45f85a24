"""The roster: every device the service knows, one entry a device, whatever addresses it is heard under.

A device is first known by its address. Once it has told its id, that is what it is known by: the same id under another
address (a private address that has changed, a session of an earlier run) is the same device, whose session goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from service.errors import UnknownDeviceError, WireError
from service.pipeline.device import Device
from service.pipeline.lifecycle import LINKED, Cause
from service.samples import DeviceInfo, Packet
from service.wearables.contract import Wearable


def told_id(wearable: Wearable, said: Iterable[Packet]) -> str | None:
    """Return the id that a device told of itself in `said`; `wearable` is used up by this."""
    for packet in said:
        try:
            info = wearable.feed(packet.characteristic, packet.data)
        except WireError:
            continue  # the session counts it
        if isinstance(info, DeviceInfo) and info.device is not None:
            return info.device
    return None


class Roster:
    """Devices in the order in which they became known."""

    def __init__(self) -> None:
        self._devices: list[Device] = []
        self._at: dict[str, Device] = {}
        """Whose an address is."""

    @property
    def devices(self) -> list[Device]:
        """Every device."""
        return list(self._devices)

    def find(self, key: str) -> Device:
        """Return the device with this id or address; UnknownDeviceError where there is none."""
        device = self._named(key) or self._at.get(key)
        if device is None:
            raise UnknownDeviceError(key)
        return device

    def at(self, address: str) -> Device | None:
        """Return whose address that is."""
        return self._at.get(address)

    def add(self, device: Device) -> None:
        """Take a device in; ValueError where its id is known already."""
        if self._named(device.id) is not None:
            raise ValueError(f"{device.id} is known already")
        self._devices.append(device)
        self._at[device.address] = device

    def forget(self) -> None:
        """Let go of addresses that never told an id and are not heard any more, or there would be ever more."""
        for device in [device for device in self._devices if device.is_forgettable]:
            self._devices.remove(device)
            del self._at[device.address]

    def owner(self, device: Device, told: str | None, make: Callable[[str], Device]) -> Device:
        """Return the device that a link to `device`'s address belongs to, now that it told its id.

        `make` gives a new device at an address: for one that is heard where another was before.
        """
        if told is None or told == device.id:
            return device
        known = self._named(told)
        if known is None and device.is_provisional:
            return device
        return known or make(device.address)

    def hand_over(self, device: Device, owner: Device) -> None:
        """Give `device`'s address to its owner; an entry that was nothing but that address is no more."""
        if self._at.get(owner.address) is owner:
            del self._at[owner.address]
        self._at[device.address] = owner
        if owner not in self._devices:
            self._devices.append(owner)
        if device.is_provisional:
            self._devices.remove(device)
        elif device.state in LINKED:
            device.move(Cause.FAILED, f"{device.address} is another device's now")
        owner.moved_to(device)

    def _named(self, key: str) -> Device | None:
        return next((device for device in self._devices if device.id == key), None)
