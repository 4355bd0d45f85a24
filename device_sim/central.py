"""The host's side of an air: one bumble device, opened when it is first needed and again after the air was lost.

Every HCI command is carried through (`device_sim.operations`); the central owns those that are unfinished.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from types import TracebackType
from typing import Any, Final, Self, TypeVar

from bleak.exc import (
    BleakBluetoothNotAvailableError,
    BleakBluetoothNotAvailableReason,
    BleakError,
    BleakGATTProtocolError,
)
from bumble import att, hci
from bumble.core import BaseBumbleError
from bumble.device import Advertisement, Connection, Device

from device_sim.controller import Air, AirHost
from device_sim.operations import Operations
from service.errors import LinkError

HCI_TIMEOUT_S: Final = 5.0
"""A controller answers in milliseconds; one that does not is gone."""
CANCEL_TIMEOUT_S: Final = 0.5
"""What a cancelled connect waits for the controller to confirm; milliseconds where it is alive."""

T = TypeVar("T")
Listener = Callable[[Advertisement], None]


class Central:
    """A host on an air while entered; usable by any number of scanners and clients at once."""

    def __init__(self, air: Air, name: str = "central") -> None:
        self._air = air
        self._name = name
        self._device: Device | None = None
        self._lost: asyncio.Future[None] | None = None
        self._attachment = AsyncExitStack()
        self._opening = asyncio.Lock()
        self._connecting = asyncio.Lock()
        self._scanning = asyncio.Lock()
        self._listeners: list[Listener] = []
        self._operations = Operations(name)
        self._closed = False

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closed = True
        self._listeners.clear()
        await self._close()

    def statistics(self) -> dict[str, int]:
        """Return how many scanners, links and unfinished operations there are."""
        links = 0 if self._device is None else len(self._device.connections)
        return {"scanners": len(self._listeners), "links": links, "operations": len(self._operations)}

    async def device(self) -> Device:
        """Return the powered-on device; BleakBluetoothNotAvailableError (a BleakError) where there is no air."""
        async with self._opening:
            if self._device is None or self._device_lost():
                if self._closed:
                    raise _unavailable("this central was closed")
                await self._close()  # what is left of an air that was lost
                try:
                    self._device = await self._open()
                except (LinkError, TimeoutError, BaseBumbleError, asyncio.InvalidStateError) as error:
                    await self._close()
                    raise _unavailable(f"no controller: {error}") from error
            return self._device

    async def connect(self, address: hci.Address) -> Connection:
        """Connect, waiting for ever; when cancelled, the controller's attempt is cancelled too."""
        async with self._connecting:  # a controller makes one connection at a time
            device = await self.device()
            attempt = self._operations.spawn(device.connect(address, timeout=None))
            try:
                await asyncio.wait({attempt})
            except asyncio.CancelledError:
                # Also where the attempt is done: a cancellation may come in the turn in which the link was made.
                attempt.add_done_callback(self._give_up)
                if not attempt.done():
                    await self._abandon(device, attempt)
                raise
            return outcome(attempt)

    async def disconnect(self, connection: Connection) -> None:
        """Ask for the end of a connection; its event tells when it has ended."""
        if connection.device is not self._device or self._device_lost():
            return
        await self._command(_disconnect(connection))

    async def listen(self, listener: Listener) -> None:
        """Call `listener` with every advertisement from now on; after the air was lost, once it is opened again."""
        async with self._scanning:
            self._listeners.append(listener)
            try:
                device = await self.device()
                if not device.is_scanning:
                    await self._command(_scan(device))
            except BaseException:
                self._listeners.remove(listener)
                raise

    async def ignore(self, listener: Listener) -> None:
        """Call `listener` no more; the last one ends the scan."""
        if listener not in self._listeners:
            return
        self._listeners.remove(listener)
        async with self._scanning:
            device = self._device
            if device is None or self._device_lost() or self._listeners or not device.is_scanning:
                return
            try:
                await self._command(device.stop_scanning())
            except BleakError:
                if not self._device_lost():  # where it is, nothing scans any more
                    raise

    async def _open(self) -> Device:
        transport = await self._attachment.enter_async_context(self._air.attach(self._name))
        address = hci.Address.generate_static_address()
        device = Device(name=self._name, address=address, host=AirHost(transport.source, transport.sink))
        async with asyncio.timeout(HCI_TIMEOUT_S):
            await device.power_on()
            if self._listeners:
                await _scan(device)
        device.on(Device.EVENT_ADVERTISEMENT, self._heard)
        self._lost = transport.source.terminated
        return device

    def _device_lost(self) -> bool:
        return self._lost is not None and self._lost.done()

    def _heard(self, advertisement: Advertisement) -> None:
        for listener in tuple(self._listeners):
            listener(advertisement)

    async def _close(self) -> None:
        """Give the controller back, which ends all links, and what still waits for it."""
        if self._device is not None and not self._device_lost():
            await self._operations.settle()
        self._device = self._lost = None
        attachment, self._attachment = self._attachment, AsyncExitStack()
        await attachment.aclose()
        await self._operations.close()

    async def _command(self, command: Coroutine[Any, Any, T]) -> T:
        """Carry an HCI command through, whatever becomes of the caller; BleakError where it fails."""
        try:
            return outcome(await self._operations.run(command, HCI_TIMEOUT_S))
        except TimeoutError as error:
            await self._close()
            raise BleakError(f"{error}: the controller was given up, the next use opens it anew") from error

    async def _abandon(self, device: Device, attempt: asyncio.Task[Connection]) -> None:
        """End an attempt to connect."""
        self._operations.spawn(device.send_sync_command(hci.HCI_LE_Create_Connection_Cancel_Command()))
        await asyncio.wait({attempt}, timeout=CANCEL_TIMEOUT_S)
        if not attempt.done():
            await self._close()

    def _give_up(self, attempt: asyncio.Task[Connection]) -> None:
        """End a connection that was made for nobody: its peer would take no other, nor advertise, for ever."""
        if attempt.cancelled() or attempt.exception() is not None:
            return
        connection = attempt.result()
        if connection.device is self._device and connection.handle in connection.device.connections:
            self._operations.spawn(_disconnect(connection))


def outcome(task: asyncio.Task[T]) -> T:
    """Return a finished bumble operation's result, its error as bleak's own."""
    if task.cancelled():
        raise BleakError("disconnected: bumble gave the operation up with the link")
    error = task.exception()
    if error is None:
        return task.result()
    if isinstance(error, att.ATT_Error):
        raise BleakGATTProtocolError(int(error.error_code)) from error
    if isinstance(error, BaseBumbleError):
        raise BleakError(f"{type(error).__name__}: {error}") from error
    raise error


async def _disconnect(connection: Connection) -> None:
    command = hci.HCI_Disconnect_Command(
        connection_handle=connection.handle, reason=hci.HCI_ErrorCode.REMOTE_USER_TERMINATED_CONNECTION_ERROR
    )
    await connection.device.send_async_command(command, check_status=False)


async def _scan(device: Device) -> None:
    # Active: the virtual controller reports every advertisement twice, and this merges the two.
    await device.start_scanning(active=True, filter_duplicates=False)


def _unavailable(why: str) -> BleakBluetoothNotAvailableError:
    return BleakBluetoothNotAvailableError(why, BleakBluetoothNotAvailableReason.NO_BLUETOOTH)
