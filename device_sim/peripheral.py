"""One power-on of the bracelet's Bluetooth side: GATT table, advertising, at most one link.

One object is one attachment to an air, never used again. It knows what is said and how; what is measured and when is
`device_sim.gatt`'s.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable, Coroutine
from typing import Any, Final

from bumble import att, data_types, hci
from bumble.core import UUID, AdvertisingData, BaseBumbleError
from bumble.device import Connection, Device, DeviceConfiguration
from bumble.gatt import Characteristic
from bumble.transport.common import Transport

from device_sim.bracelet import Bracelet
from device_sim.control_point import ControlPoint, RefusedError
from device_sim.controller import AirHost
from device_sim.gatt_table import Table
from device_sim.operations import Operations
from service.errors import LinkError, LinkFault, ParameterError
from service.wearables import bracelet as wire
from service.wearables.bracelet_control import Answer, encode_answer

HCI_TIMEOUT_S: Final = 5.0
"""A controller answers in milliseconds; one that does not is gone."""
STALL_S: Final = 5.0
"""A host that takes no packet for so long has lost the link, as by a supervision timeout."""
UNASKED_S: Final = 5.0
"""A host asks for the MTU at once. A link on which nothing is asked for so long has nobody at its other end who wants
it: a foreign or killed host. It is given up, or the bracelet would never advertise again."""
UNSENT_PACKETS: Final = 16
"""Packets the controller may hold before the sender waits for it."""
ADVERTISING_INTERVAL_MS: Final = 31.25
"""50 ms on the air: bumble's controller takes the 0.625 ms units for milliseconds."""
NAME_BYTES: Final = 8
"""What 31 bytes hold beside flags and a 128-bit UUID; the link carries no scan response."""
DEFAULT_MTU: Final = 23


def static_address(device_id: str) -> hci.Address:
    """Return the random static address of a device: always the same for the same id."""
    digest = bytearray(hashlib.sha256(device_id.encode()).digest()[:6])
    digest[5] |= 0xC0
    return hci.Address(bytes(digest), hci.Address.RANDOM_DEVICE_ADDRESS)


def advertisement(name: str) -> bytes:
    """Return flags, service UUID and name in at most 31 bytes."""
    if not 1 <= len(name.encode()) <= NAME_BYTES:
        raise ParameterError("name", name, f"1 to {NAME_BYTES} bytes of UTF-8 fit the advertisement")
    flags = AdvertisingData.Flags.LE_GENERAL_DISCOVERABLE_MODE | AdvertisingData.Flags.BR_EDR_NOT_SUPPORTED
    return bytes(
        AdvertisingData(
            [
                data_types.Flags(flags),
                data_types.CompleteListOf128BitServiceUUIDs([UUID(wire.SERVICE)]),
                data_types.CompleteLocalName(name),
            ]
        )
    )


class Peripheral:
    """A bumble device that serves one bracelet's table.

    `on_asked` is called when a host asks for data, live or from history. While `muted` is set it sends nothing and
    answers nothing; while `away` is set it does not advertise.
    """

    def __init__(
        self,
        transport: Transport,
        bracelet: Bracelet,
        *,
        name: str,
        max_mtu: int,
        encrypted: bool,
        on_asked: Callable[[], None],
    ) -> None:
        config = DeviceConfiguration(
            name=name,
            address=static_address(bracelet.device_id),
            advertising_data=advertisement(name),
            advertising_interval_min=ADVERTISING_INTERVAL_MS,
            advertising_interval_max=ADVERTISING_INTERVAL_MS,
        )
        host = AirHost(transport.source, transport.sink)
        self.device = Device(config=config, host=host)
        self.device.gatt_server.max_mtu = max_mtu
        self.muted = False
        self.away = False
        self.links_made = 0
        self.control = ControlPoint(bracelet)
        self._table = Table(bracelet, self._on_request, encrypted=encrypted)
        self.device.add_services(self._table.services)
        self._operations = Operations(name)
        self._answers = Operations(f"{name} answers")
        self._on_asked = on_asked
        self._has_control = bracelet.control
        self._encrypted = encrypted
        self._subscribed = self._indicated = False
        """Whether the host has enabled the notifications of data, and the indications of the control point."""
        self._link: Connection | None = None
        self._asked = False
        """Whether the host of the present link has asked for anything."""
        self._silent: Connection | None = None
        """A link whose host never asked for anything, to be given up."""
        self._advertising = False
        self._lost = transport.source.terminated
        self._changed = asyncio.Event()
        self._lock = asyncio.Lock()
        self._table.data.on(Characteristic.EVENT_SUBSCRIPTION, self._on_data_subscription)
        self._table.control.on(Characteristic.EVENT_SUBSCRIPTION, self._on_control_subscription)
        self.device.on(Device.EVENT_CONNECTION, self._on_connection)
        self.device.l2cap_channel_manager.register_fixed_channel(att.ATT_CID, self._on_att)

    @property
    def link(self) -> Connection | None:
        """The link to a host, None where there is none."""
        return self._link

    @property
    def mtu(self) -> int:
        """The ATT MTU in force, in bytes."""
        return DEFAULT_MTU if self._link is None else self._link.att_mtu

    @property
    def listening(self) -> bool:
        """Whether a host takes samples as they come."""
        if self._link is None or not self._subscribed or self.muted:
            return False
        if self._encrypted and not self._link.is_encrypted:
            return False
        return self.control.streaming or not self._has_control

    async def start(self) -> None:
        """Power on and advertise; LinkError where the controller does not answer."""
        self._lost.add_done_callback(lambda _: self._changed.set())
        await self._hci(self.device.power_on())
        await self.settle()
        if self._lost.done():
            raise LinkError(LinkFault.NO_ADAPTER, "the air was lost at once: has it too many participants?")

    async def serve(self) -> None:
        """Advertise whenever there is no link, until the air is lost."""
        while not self._lost.done():
            await self._changed.wait()
            self._changed.clear()
            await self._give_up_silent()
            await self.settle()

    async def settle(self) -> None:
        """Begin or end advertising as `away` and the link want it."""
        async with self._lock:
            wanted = not self.away and self._link is None
            if wanted != self._advertising and self.device.powered_on and not self._lost.done():
                self._advertising = wanted
                await self._hci(self.device.start_advertising() if wanted else self.device.stop_advertising())

    async def notify(self, value: bytes) -> bool:
        """Send one live packet; wait while the radio is full. False where nobody took it."""
        return self.listening and await self._send(value)

    async def report(self) -> bool:
        """Send the next packet of a report, or its answer; False where no packet was sent."""
        part = self.control.next_part(self.mtu)
        if isinstance(part, Answer):
            self._answer(part)
        return isinstance(part, bytes) and await self._send(part)

    async def _send(self, value: bytes) -> bool:
        """Notify one value of the data characteristic; wait while the radio is full."""
        link = self._link
        if link is None:
            return False
        await self.device.gatt_server.notify_subscriber(link, self._table.data, value)
        queue = self.device.host.le_acl_packet_queue
        if queue is not None and queue.pending > UNSENT_PACKETS:
            try:
                async with asyncio.timeout(STALL_S):
                    await queue.drain(link.handle)
            except ValueError:  # bumble: no such connection (any more)
                return False
            except TimeoutError:
                await self.drop()
                return False
        return True

    async def notify_battery(self) -> None:
        """Send the battery's charge to whoever subscribed to it."""
        if self._link is not None and not self.muted:
            await self.device.gatt_server.notify_subscriber(self._link, self._table.battery)

    async def notify_register(self) -> None:
        """Send the step register to whoever subscribed to it."""
        if self._link is not None and not self.muted:
            await self.device.gatt_server.notify_subscriber(self._link, self._table.register)

    async def notify_pace(self, value: bytes) -> None:
        """Send running speed and cadence to whoever subscribed to it."""
        if self._link is not None and not self.muted:
            await self.device.gatt_server.notify_subscriber(self._link, self._table.pace, value)

    async def drop(self, reason: int = hci.HCI_ErrorCode.CONNECTION_TIMEOUT_ERROR) -> None:
        """End the link, by default as if it had been out of range; return when it has ended."""
        link = self._link
        if link is None:
            return
        gone = asyncio.Event()
        link.once(Connection.EVENT_DISCONNECTION, lambda _: gone.set())
        await self._hci(
            self.device.send_async_command(
                hci.HCI_Disconnect_Command(connection_handle=link.handle, reason=reason), check_status=False
            )
        )
        await self._hci(gone.wait())

    async def settle_commands(self) -> None:
        """Let the controller answer what it was asked, before it is given back."""
        await self._operations.settle()

    async def close(self) -> None:
        """End what waits for an answer, after the transport is gone."""
        await self._answers.close()
        await self._operations.close()

    async def _hci(self, command: Coroutine[Any, Any, object]) -> None:
        """Carry a command through; LinkError where the controller fails, nothing where the air is lost."""
        try:
            task = await self._operations.run(command, HCI_TIMEOUT_S)
            failed = task.cancelled() or isinstance(task.exception(), BaseBumbleError)
        except TimeoutError:
            failed = True
        if not failed:
            task.result()
        elif not self._lost.done():  # where it is, `serve` ends by itself
            raise LinkError(LinkFault.NO_ADAPTER, "the bracelet's controller does not answer")

    def _on_connection(self, link: Connection) -> None:
        self._link, self._asked = link, False
        self._advertising = False  # a controller stops of itself when it is connected
        self.links_made += 1
        link.once(Connection.EVENT_DISCONNECTION, lambda _: self._on_disconnection(link))
        asyncio.get_running_loop().call_later(UNASKED_S, self._suspect, link)
        self._changed.set()

    def _on_disconnection(self, link: Connection) -> None:
        if self._link is not link:  # one that has been given up, or whose end is told after the next one's beginning
            return
        self._link = None
        self._subscribed = self._indicated = False
        self.control.disconnected()
        self._answers.abandon()
        self._changed.set()

    def _suspect(self, link: Connection) -> None:
        if self._link is link and not self._asked:
            self._silent = link
            self._changed.set()

    async def _give_up_silent(self) -> None:
        link, self._silent = self._silent, None
        if link is None:
            return
        self._on_disconnection(link)
        command = hci.HCI_Disconnect_Command(
            connection_handle=link.handle, reason=hci.HCI_ErrorCode.REMOTE_USER_TERMINATED_CONNECTION_ERROR
        )
        await self._hci(self.device.send_async_command(command, check_status=False))

    # bumble handles a write in a task of its own, which may outlive the link.

    def _on_data_subscription(self, bearer: object, notify: bool, _indicate: bool) -> None:
        if bearer is not self._link:
            return
        self._subscribed = notify
        if not notify and (answer := self.control.fail_report()) is not None:
            self._answer(answer)
        self._tell_asked()

    def _on_control_subscription(self, bearer: object, _notify: bool, indicate: bool) -> None:
        if bearer is self._link:
            self._indicated = indicate

    def _on_request(self, bearer: object, data: bytes) -> None:
        """Take a write of the control point; its answer follows the write's own response."""
        if bearer is not self._link:
            return
        try:
            answer = self.control.take(data, indications=self._indicated, notifications=self._subscribed)
        except RefusedError as error:
            raise att.ATT_Error(att.ErrorCode(error.fault)) from None
        if answer is not None:
            self._answer(answer)
        self._tell_asked()

    def _tell_asked(self) -> None:
        if self.listening or self.control.reporting:
            self._on_asked()

    def _answer(self, answer: Answer) -> None:
        if self._link is not None:
            self._answers.spawn(self._indicate(self._link, encode_answer(answer)))

    async def _indicate(self, link: Connection, value: bytes) -> None:
        """Indicate an answer and wait for its confirmation; a host that gives none has lost the link."""
        try:
            await self.device.gatt_server.indicate_subscriber(link, self._table.control, value)
        except TimeoutError:
            await self.drop()
        if self._link is link:
            self.control.confirmed()

    def _on_att(self, handle: int, pdu: bytes) -> None:
        self._asked = True
        if not self.muted:
            self.device.on_gatt_pdu(handle, pdu)
