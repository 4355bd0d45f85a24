"""bleak's client over a bumble device.

As with every bleak backend: the disconnected callback comes once for each connection that was made, wanted or not;
operations in flight when the link drops raise BleakError; notification callbacks are called in order.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final, TypeVar

from bleak.args import SizedBuffer
from bleak.assigned_numbers import CharacteristicPropertyName
from bleak.backends.characteristic import BleakGATTCharacteristic
from bleak.backends.client import BaseBleakClient, NotifyCallback
from bleak.backends.descriptor import BleakGATTDescriptor
from bleak.backends.device import BLEDevice
from bleak.backends.service import BleakGATTService, BleakGATTServiceCollection
from bleak.exc import BleakDeviceNotFoundError, BleakError
from bumble import hci
from bumble.device import Advertisement, Connection
from bumble.gatt import Characteristic
from bumble.gatt_client import CharacteristicProxy, ServiceProxy

from device_sim.bleak_scanner import uuid_text
from device_sim.central import Central, outcome
from device_sim.operations import Operations

MTU: Final = 517
"""What is asked for; the peripheral may agree to less."""
ATT_TIMEOUT_S: Final = 30.0
"""Core 5.4, Vol 3, Part F, 3.3.3: a transaction without an answer for so long is the link's end."""
DISCONNECT_TIMEOUT_S: Final = 2.0
DEFAULT_MTU: Final = 23

_P = Characteristic.Properties
_PROPERTIES: Final[tuple[tuple[_P, CharacteristicPropertyName], ...]] = (
    (_P.BROADCAST, "broadcast"),
    (_P.READ, "read"),
    (_P.WRITE_WITHOUT_RESPONSE, "write-without-response"),
    (_P.WRITE, "write"),
    (_P.NOTIFY, "notify"),
    (_P.INDICATE, "indicate"),
    (_P.AUTHENTICATED_SIGNED_WRITES, "authenticated-signed-writes"),
    (_P.EXTENDED_PROPERTIES, "extended-properties"),
)
T = TypeVar("T")


@dataclass(slots=True)
class _Link:
    """One connection: what waits on it, and whether it has ended."""

    connection: Connection
    requests: Operations = field(default_factory=lambda: Operations("link"))
    subscriptions: dict[int, Callable[[bytes], None]] = field(default_factory=dict)
    established: bool = False
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class BumbleClient(BaseBleakClient):
    """bleak's client; one link at a time, each a new `_Link`."""

    central: ClassVar[Central]

    def __init__(
        self,
        address_or_ble_device: BLEDevice | str,
        *,
        disconnected_callback: Callable[[], None] | None,
        timeout: float,
        services: set[str] | None = None,
        **_platform: object,
    ) -> None:
        super().__init__(address_or_ble_device, disconnected_callback=disconnected_callback, timeout=timeout)
        self._wanted_services = services
        self._target: hci.Address | None = None
        self._name: str | None = None
        if isinstance(address_or_ble_device, BLEDevice):
            self._target = address_or_ble_device.details["address"]
            self._name = address_or_ble_device.name
        self._link: _Link | None = None

    @property
    def name(self) -> str:
        """The advertised name, else the address."""
        return self._name or self.address

    @property
    def mtu_size(self) -> int:
        """The ATT MTU in force, in bytes."""
        return DEFAULT_MTU if self._link is None else self._link.connection.att_mtu

    @property
    def is_connected(self) -> bool:
        """Whether the link is up and its services are known."""
        return self._link is not None and self._link.established

    async def connect(self, pair: bool, *, timeout: float | None = None, **_kwargs: object) -> None:  # noqa: ASYNC109
        """Connect, agree on an MTU and discover; TimeoutError after `timeout` seconds.

        Where only an address is known it is looked for first, for as long; BleakDeviceNotFoundError where it is silent.
        """
        if self._link is not None:
            raise BleakError("Client is already connected")
        timeout_s = self._timeout if timeout is None else timeout
        if self._target is None:
            self._target = await self._find(timeout_s)
        async with asyncio.timeout(timeout_s):
            link = self._adopt(await self.central.connect(self._target))
            try:
                if pair:
                    await self.pair()
                gatt = link.connection.gatt_client
                await self._ask(lambda: gatt.request_mtu(MTU))
                self.services = await self._ask(lambda: _discover(link.connection, self._wanted_services))
            except BaseException:
                await self.disconnect()
                raise
            link.established = True

    async def disconnect(self) -> None:
        """Disconnect, and return when it is done; does nothing where there is no link."""
        link = self._link
        if link is None:
            return
        try:
            async with asyncio.timeout(DISCONNECT_TIMEOUT_S):
                await self.central.disconnect(link.connection)
                await link.ended.wait()
        except (BleakError, TimeoutError):
            self._on_disconnection(link)  # the air is gone; so is the link

    async def pair(self, *_args: object, **_kwargs: object) -> None:
        """Pair without any input or output (just works)."""
        link = self._up()
        await self._ask(link.connection.pair)

    async def unpair(self) -> None:
        """Forget the keys and disconnect."""
        keystore = (await self.central.device()).keystore
        if keystore is not None and self._target is not None:
            with suppress(KeyError):  # never paired: nothing to forget
                await keystore.delete(str(self._target))
        await self.disconnect()

    async def read_gatt_char(self, characteristic: BleakGATTCharacteristic, **_kwargs: object) -> bytearray:
        """Read a characteristic's value."""
        return await self._read(characteristic.handle)

    async def read_gatt_descriptor(self, descriptor: BleakGATTDescriptor, **_kwargs: object) -> bytearray:
        """Read a descriptor's value."""
        return await self._read(descriptor.handle)

    async def write_gatt_char(self, characteristic: BleakGATTCharacteristic, data: SizedBuffer, response: bool) -> None:
        """Write a characteristic's value."""
        await self._write(characteristic.handle, bytes(data), response=response)

    async def write_gatt_descriptor(self, descriptor: BleakGATTDescriptor, data: SizedBuffer) -> None:
        """Write a descriptor's value."""
        await self._write(descriptor.handle, bytes(data), response=True)

    async def start_notify(
        self, characteristic: BleakGATTCharacteristic, callback: NotifyCallback, **_kwargs: object
    ) -> None:
        """Subscribe; values are given to `callback` in order."""
        link = self._up()
        proxy: CharacteristicProxy[bytes] = characteristic.obj
        if proxy.handle in link.subscriptions:
            raise BleakError(f"{characteristic.uuid} is subscribed to already")

        def received(value: bytes) -> None:
            callback(bytearray(value))

        link.subscriptions[proxy.handle] = received
        try:
            await self._ask(lambda: link.connection.gatt_client.subscribe(proxy, received))
        except BaseException:
            link.subscriptions.pop(proxy.handle, None)
            raise

    async def stop_notify(self, characteristic: BleakGATTCharacteristic) -> None:
        """End a subscription; does nothing where there is none."""
        link = self._up()
        received = link.subscriptions.pop(characteristic.handle, None)
        if received is not None:
            await self._ask(lambda: link.connection.gatt_client.unsubscribe(characteristic.obj, received))

    async def _find(self, timeout_s: float) -> hci.Address:
        """Return the advertiser of our address: only it tells the address's type."""
        found: asyncio.Future[hci.Address] = asyncio.get_running_loop().create_future()

        def heard(advertisement: Advertisement) -> None:
            address = advertisement.address
            if address.to_string(with_type_qualifier=False).upper() == self.address.upper() and not found.done():
                found.set_result(address)

        await self.central.listen(heard)
        try:
            async with asyncio.timeout(timeout_s):
                return await found
        except TimeoutError:
            raise BleakDeviceNotFoundError(self.address, f"{self.address} was not found: it is silent") from None
        finally:
            await self.central.ignore(heard)

    def _adopt(self, connection: Connection) -> _Link:
        if connection.device.connections.get(connection.handle) is not connection:
            # Its end was told before anybody could listen.
            raise BleakError(f"{self.address} did not take the connection")
        link = self._link = _Link(connection)
        connection.once(Connection.EVENT_DISCONNECTION, lambda _reason: self._on_disconnection(link))
        return link

    def _on_disconnection(self, link: _Link) -> None:
        if link.ended.is_set():
            return
        link.ended.set()
        link.requests.abandon()  # those that wait for another's answer would wait for ever
        if self._link is link:
            self._link = None
            self.services = None
        if link.established and self._disconnected_callback is not None:
            # Not from within bumble's event: an error of the callback is not bumble's.
            asyncio.get_running_loop().call_soon(self._disconnected_callback)

    def _up(self) -> _Link:
        if self._link is None:
            raise BleakError("Not connected")
        return self._link

    async def _read(self, handle: int) -> bytearray:
        gatt = self._up().connection.gatt_client
        return bytearray(await self._ask(lambda: gatt.read_value(handle)))

    async def _write(self, handle: int, data: bytes, *, response: bool) -> None:
        gatt = self._up().connection.gatt_client
        await self._ask(lambda: gatt.write_value(handle, data, with_response=response))

    async def _ask(self, request: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Carry an ATT transaction through; BleakError where it fails or the link drops."""
        link = self._up()
        if link.ended.is_set():
            raise BleakError("disconnected")
        try:
            return outcome(await link.requests.run(request(), ATT_TIMEOUT_S))
        except TimeoutError as error:
            await self.disconnect()
            raise BleakError(f"no answer from {self.address}: disconnected") from error


async def _discover(connection: Connection, wanted: set[str] | None) -> BleakGATTServiceCollection:
    """Return all services, or the wanted ones, with their characteristics and descriptors."""
    gatt = connection.gatt_client
    found = BleakGATTServiceCollection()
    for proxy in await gatt.discover_services():
        uuid = uuid_text(proxy.uuid)
        if wanted is None or uuid in wanted:
            service = BleakGATTService(proxy, proxy.handle, uuid)
            found.add_service(service)
            await _discover_service(connection, proxy, service, found)
    return found


async def _discover_service(
    connection: Connection, proxy: ServiceProxy, service: BleakGATTService, found: BleakGATTServiceCollection
) -> None:
    gatt = connection.gatt_client
    for characteristic in await gatt.discover_characteristics([], proxy):
        properties = [name for flag, name in _PROPERTIES if characteristic.properties & flag]
        ours = BleakGATTCharacteristic(
            characteristic,
            characteristic.handle,
            uuid_text(characteristic.uuid),
            properties,
            lambda: connection.att_mtu - 3,
            service,
        )
        found.add_characteristic(ours)
        for descriptor in await gatt.discover_descriptors(characteristic):
            found.add_descriptor(BleakGATTDescriptor(descriptor, descriptor.handle, uuid_text(descriptor.type), ours))
