"""Bluetooth LE by bleak: find devices, and one connection as a Link.

The platform's own backend is used unless another is given (the virtual radio passes one over bumble). Remedies for
what is known to go wrong stand where they act: notifications are taken by a synchronous callback and stamped at once
(an asynchronous one reorders them); a client is disconnected after an unsolicited drop too, or BlueZ would deliver
every notification once more after each reconnect (bleak #2002); what BlueZ remembers of a device's services is
forgotten where a characteristic is missing. Every wait for the outside world has a bound (`Timeouts`).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from bleak import BleakClient, BleakScanner
from bleak.backends.characteristic import BleakGATTCharacteristic
from bleak.backends.client import BaseBleakClient
from bleak.backends.device import BLEDevice
from bleak.backends.scanner import AdvertisementData, BaseBleakScanner
from bleak.exc import BleakBluetoothNotAvailableError, BleakError, BleakGATTProtocolError
from bleak_retry_connector import (
    BleakClientWithServiceCache,
    clear_cache,
    close_stale_connections_by_address,
    establish_connection,
)

from service.errors import LinkError, LinkFault
from service.samples import Packet
from service.wearables.contract import Action, Read, Subscribe, Write

STALE_TIMEOUT_S = 10.0
"""Bound on closing what an earlier run left connected, of all devices together."""
_WANTS_PAIRING = frozenset({0x05, 0x0F})
"""ATT errors insufficient authentication and insufficient encryption: one pairs, and asks again."""
QUEUE_PACKETS = 4096
"""Packets that may wait: 13 min at five a second. Policy: the newest is dropped, which shows as a gap."""

_ADVICE = (
    ". No usable Bluetooth: is an adapter plugged in and switched on, and does bluetoothd run (Linux)?"
    " `steplink demo` needs none."
)


logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """Bounds on what is waited for."""

    connect_s: float = 20.0
    """Making a connection, discovery included; BlueZ itself may take 10 s to find services."""
    request_s: float = 5.0
    """One read, write or subscription; closing a connection; stopping a scan."""
    silence_s: float = 5.0
    """A link that is up but brings nothing for so long is dropped: no wearable we know pauses longer."""


DEFAULT_TIMEOUTS = Timeouts()


@dataclass(frozen=True, slots=True, kw_only=True)
class Backend:
    """bleak's backend classes; None means the platform's own."""

    scanner: type[BaseBleakScanner] | None = None
    client: type[BaseBleakClient] | None = None
    advice: str = ""
    """Said to whoever has no adapter."""
    clear_cache: Callable[[str], Awaitable[object]] | None = None
    """Forgets what the platform remembers of an address's services."""
    close_stale: Callable[[str], Awaitable[object]] | None = None
    """Ends a connection to an address that an earlier run of the service left open."""

    @property
    def options(self) -> dict[str, Any]:
        """Arguments for BleakScanner."""
        return {"backend": self.scanner} if self.scanner else {}

    @property
    def client_options(self) -> dict[str, Any]:
        """Arguments for BleakClient."""
        return {"backend": self.client} if self.client else {}


PLATFORM = (
    Backend(advice=_ADVICE, clear_cache=clear_cache, close_stale=close_stale_connections_by_address)
    if sys.platform == "linux"
    else Backend(advice=_ADVICE)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One advertisement of a device we could connect to; `handle` is bleak's own, good for the next connection."""

    address: str
    name: str | None
    rssi_dbm: int
    services: tuple[str, ...]
    handle: BLEDevice


@contextlib.asynccontextmanager
async def scanning(
    services: Sequence[str], backend: Backend = PLATFORM, timeouts: Timeouts = DEFAULT_TIMEOUTS
) -> AsyncIterator[AsyncIterator[Sighting]]:
    """Scan for devices that advertise one of `services`; LinkError(NO_ADAPTER) where there is no Bluetooth."""
    heard: asyncio.Queue[Sighting] = asyncio.Queue(maxsize=256)

    def hear(device: BLEDevice, advertisement: AdvertisementData) -> None:
        sighting = Sighting(
            address=device.address,
            name=advertisement.local_name or device.name,
            rssi_dbm=advertisement.rssi,
            services=tuple(advertisement.service_uuids),
            handle=device,
        )
        with contextlib.suppress(asyncio.QueueFull):  # the next advertisement says the same
            heard.put_nowait(sighting)

    async def sightings() -> AsyncIterator[Sighting]:
        while True:
            yield await heard.get()

    scanner = BleakScanner(hear, service_uuids=list(services), **backend.options)
    with _translated("scan", LinkFault.NO_ADAPTER, backend.advice):
        async with asyncio.timeout(timeouts.connect_s):
            await scanner.start()
    try:
        yield sightings()
    finally:
        with contextlib.suppress(BleakError, OSError, EOFError, TimeoutError):
            async with asyncio.timeout(timeouts.request_s):
                await scanner.stop()


async def find(services: Sequence[str], *, for_s: float, backend: Backend = PLATFORM) -> list[Sighting]:
    """Return the devices heard within `for_s` seconds, the newest sighting of each, strongest first."""
    found: dict[str, Sighting] = {}
    async with scanning(services, backend) as sightings:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(for_s):
                async for sighting in sightings:
                    found[sighting.address] = sighting
    return sorted(found.values(), key=lambda sighting: -sighting.rssi_dbm)


async def close_stale(
    addresses: Iterable[str], backend: Backend = PLATFORM, timeout_s: float = STALE_TIMEOUT_S
) -> None:
    """End connections that an earlier run left open; such a device would not advertise. Never raises, and bounded."""
    if backend.close_stale is None:
        return
    try:
        async with asyncio.timeout(timeout_s):
            for address in addresses:
                await backend.close_stale(address)
    except Exception:  # whatever the platform raises: the devices that are free can be connected all the same
        logger.warning("could not look for connections that an earlier run left open", exc_info=True)


class BleLink:
    """One Bluetooth LE connection: connect, handshake, packets; see the contract."""

    def __init__(
        self,
        handle: BLEDevice,
        handshake: Sequence[Action],
        backend: Backend = PLATFORM,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
    ) -> None:
        self.said: list[Packet] = []
        self._handle = handle
        self._handshake = handshake
        self._backend = backend
        self._timeouts = timeouts
        self._client: BleakClient | None = None
        self._packets: asyncio.Queue[Packet] = asyncio.Queue(QUEUE_PACKETS)
        self._arrived = asyncio.Event()
        """Set while packets wait, and for good once the link is lost."""
        self._entered = self._lost = False
        self._dropped = 0

    def diagnostics(self) -> dict[str, object]:
        """Return what a support question needs."""
        client = self._client
        return {
            "address": self._handle.address,
            "connected": client is not None and client.is_connected,
            "mtu": client.mtu_size if client is not None and client.is_connected else None,
            "waiting": self._packets.qsize(),
            "dropped": self._dropped,
        }

    async def __aenter__(self) -> Self:
        """Connect and do the handshake; LinkError says why it failed."""
        if self._entered:
            raise RuntimeError("a link is one connection: make a new one")
        self._entered = True
        try:
            with _translated(f"connect to {self._handle.address}"):
                await self._open()
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the connection, however far it got."""
        await self._close()

    async def __aiter__(self) -> AsyncIterator[Packet]:
        """Yield packets until the link is lost or silent."""
        while True:
            yield await self._next()

    async def request(self, write: Write) -> None:
        """Write a characteristic, with response; LinkError where that fails."""
        with _translated(f"write to {self._handle.address}"):
            await self._do(self._connected(), write)

    async def _open(self) -> None:
        async with asyncio.timeout(self._timeouts.connect_s):
            self._client = await establish_connection(
                BleakClientWithServiceCache if self._backend.client is None else BleakClient,
                self._handle,
                self._handle.name or self._handle.address,
                disconnected_callback=self._on_lost,
                max_attempts=1,  # the supervisor's own loop tries again, from a fresh scan result
                **self._backend.client_options,
            )
        for action in self._handshake:
            await self._do(self._client, action)

    async def _close(self) -> None:
        client, self._client = self._client, None
        if client is None:
            return
        # After an unsolicited drop too: see the module's docstring.
        with contextlib.suppress(BleakError, OSError, EOFError, TimeoutError):
            async with asyncio.timeout(self._timeouts.request_s):
                await client.disconnect()

    async def _do(self, client: BleakClient, action: Action) -> None:
        characteristic = client.services.get_characteristic(action.characteristic)
        if characteristic is None:
            if getattr(action, "optional", False):
                return
            await self._forget_services()
            raise LinkError(LinkFault.NOT_OURS, f"{self._handle.address} has no characteristic {action.characteristic}")
        async with asyncio.timeout(self._timeouts.request_s):
            try:
                await self._carry_out(client, characteristic, action)
            except BleakGATTProtocolError as error:
                if error.code not in _WANTS_PAIRING:
                    raise
                await client.pair()
                await self._carry_out(client, characteristic, action)

    async def _carry_out(self, client: BleakClient, characteristic: BleakGATTCharacteristic, action: Action) -> None:
        match action:
            case Read():
                self.said.append(self._put(action.characteristic, await client.read_gatt_char(characteristic)))
            case Subscribe():
                await client.start_notify(characteristic, self._notified)
            case Write():
                await client.write_gatt_char(characteristic, action.data, response=True)

    async def _forget_services(self) -> None:
        """Have the next connection discover anew: what is missing may be missing in a cache only."""
        if self._backend.clear_cache is None:
            return
        try:
            async with asyncio.timeout(self._timeouts.request_s):
                await self._backend.clear_cache(self._handle.address)
        except Exception:  # whatever the platform raises: the missing characteristic is what is told
            logger.warning("could not forget the services of %s", self._handle.address, exc_info=True)

    def _notified(self, characteristic: BleakGATTCharacteristic, data: bytearray) -> None:
        if self._client is not None:  # a platform may go on calling back after the end
            self._put(characteristic.uuid, data)

    def _put(self, characteristic: str, data: bytearray) -> Packet:
        packet = Packet(characteristic=characteristic, data=bytes(data), at_ns=time.time_ns())
        try:
            self._packets.put_nowait(packet)
            self._arrived.set()
        except asyncio.QueueFull:
            self._dropped += 1
        return packet

    async def _next(self) -> Packet:
        """Return the next packet; what arrived before a loss comes first."""
        if self._packets.empty() and not self._lost:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self._timeouts.silence_s):
                    await self._arrived.wait()
        if not self._packets.empty():
            packet = self._packets.get_nowait()
            if self._packets.empty() and not self._lost:
                self._arrived.clear()
            return packet
        if self._lost:
            raise LinkError(LinkFault.LOST, "the link was lost: out of range, or the device is off")
        raise LinkError(LinkFault.SILENT, f"connected, but nothing came for {self._timeouts.silence_s:g} s")

    def _on_lost(self, _client: BleakClient) -> None:
        self._lost = True
        self._arrived.set()

    def _connected(self) -> BleakClient:
        if self._client is None:
            raise LinkError(LinkFault.LOST, "the link is closed")
        return self._client


@contextlib.contextmanager
def _translated(what: str, otherwise: LinkFault = LinkFault.REFUSED, advice: str = "") -> Iterator[None]:
    """Turn what bleak and the platform raise into a LinkError with a reason."""
    try:
        yield
    except LinkError:
        raise
    except BleakBluetoothNotAvailableError as error:
        raise LinkError(LinkFault.NO_ADAPTER, f"{what}: {error.args[0]}{advice}") from error
    except TimeoutError as error:
        raise LinkError(LinkFault.TIMEOUT, f"{what}: no answer in time") from error
    except (BleakError, OSError, EOFError) as error:
        raise LinkError(otherwise, f"{what}: {str(error) or type(error).__name__}{advice}") from error
