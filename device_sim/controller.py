"""A radio of the virtual air: bumble's virtual controller with what it gets wrong put right, and the link they share.

Found in bumble 0.0.236 and mended here, each where it is mended: a connect that cannot be cancelled, a connection to a
device that has just stopped advertising, a disconnect that never ends because the peer has left, 27-byte packets, and
flow control that ends at the controller, so that a slow host is flooded. What is sent on a link in the moment of its
end is dropped, as on a real radio; bumble does so too, but with a warning for each packet.
"""

from __future__ import annotations

import asyncio
from contextlib import AbstractAsyncContextManager, suppress
from typing import Protocol

from bumble import core, hci, ll
from bumble.controller import Connection, Controller
from bumble.host import Host
from bumble.link import LocalLink
from bumble.transport.common import Transport, TransportLostError

ACL_BYTES = 251
"""Longest packet of Bluetooth 4.2 and later; with bumble's 27 everything takes two to four times as long."""


class Air(Protocol):
    """Where radios are: anything that gives a participant a controller."""

    def attach(self, name: str) -> AbstractAsyncContextManager[Transport]:
        """Return a controller's transport while entered; LinkError (NO_ADAPTER) where there is no air."""


class AirLink(LocalLink):
    """The medium. Radios are found by address, and an advertisement goes only to those that listen.

    Both are for fleets: bumble's link asks every controller for every packet.
    """

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # bumble's
        self._by_address: dict[hci.Address, Controller] = {}

    def on_address_changed(self, controller: Controller) -> None:
        """Note where a radio is found from now on."""
        self._by_address[controller.random_address] = controller

    def radios(self) -> list[Radio]:
        """Return everybody on the air."""
        return [radio for radio in self.controllers if isinstance(radio, Radio)]

    def remove_controller(self, controller: Controller) -> None:
        """Take a radio off the air."""
        self.controllers.discard(controller)
        if self._by_address.get(controller.random_address) is controller:
            del self._by_address[controller.random_address]

    def find_le_controller(self, address: hci.Address) -> Controller | None:
        """Return the radio that has a random address."""
        return self._by_address.get(address)

    def send_advertising_pdu(self, sender_controller: Controller, packet: ll.AdvertisingPdu) -> None:
        """Deliver to who scans or connects, a connection request to who advertises."""
        loop = asyncio.get_running_loop()
        if isinstance(packet, ll.ConnectInd):
            if target := self._by_address.get(packet.advertiser_address):
                loop.call_soon(target.on_ll_advertising_pdu, packet)
            return
        for radio in self.controllers:
            if radio is not sender_controller and (radio.le_scan_enable or radio.pending_le_connection):
                loop.call_soon(radio.on_ll_advertising_pdu, packet)


class AirHost(Host):
    """A host whose answers to a link that has just ended are dropped: their tasks cannot know yet."""

    def send_acl_sdu(self, connection_handle: int, sdu: bytes) -> None:
        """Send where there is a link to send on."""
        if connection_handle in self.connections:
            super().send_acl_sdu(connection_handle, sdu)


class Radio(Controller):
    """One participant's controller. It has a random address only: the link sends from that one."""

    # Without extended advertising the legacy commands are used, of which the virtual controller does more.
    le_features = Controller.le_features & ~(
        hci.LeFeatureMask.LE_EXTENDED_ADVERTISING | hci.LeFeatureMask.LE_PERIODIC_ADVERTISING
    )
    le_acl_data_packet_length = ACL_BYTES

    def __init__(self, name: str, link: AirLink) -> None:
        super().__init__(name, link=link)
        self.air = link
        self.congested = False
        self._withheld: list[tuple[Radio, int]] = []
        self._left = False

    def on_packet(self, packet: bytes) -> None:
        """Take a packet from the host; once off the air a command fails here, instead of waiting for ever."""
        if not self._left:
            super().on_packet(packet)
        elif packet[0] == hci.HCI_COMMAND_PACKET:
            raise TransportLostError("the virtual air is gone")

    def on_hci_le_create_connection_cancel_command(
        self, _command: hci.HCI_LE_Create_Connection_Cancel_Command
    ) -> hci.HCI_StatusReturnParameters:
        """End the pending connection and say so (Core 5.4, Vol 4, Part E, 7.8.13); bumble only answers SUCCESS."""
        if pending := self.pending_le_connection:
            self.pending_le_connection = None
            event = hci.HCI_LE_Connection_Complete_Event(
                status=hci.HCI_ErrorCode.UNKNOWN_CONNECTION_IDENTIFIER_ERROR,
                connection_handle=0,
                role=hci.Role.CENTRAL,
                peer_address_type=pending.peer_address.address_type,
                peer_address=pending.peer_address,
                connection_interval=0,
                peripheral_latency=0,
                supervision_timeout=0,
                central_clock_accuracy=0,
            )
            # After the command's own answer, which is sent when this returns.
            asyncio.get_running_loop().call_soon(self.send_hci_packet, event)
        return hci.HCI_StatusReturnParameters(hci.HCI_ErrorCode.SUCCESS)

    def create_le_connection(self, peer_address: hci.Address) -> None:
        """Connect, then look whether the peer took part: it may have stopped advertising, or taken another."""
        super().create_le_connection(peer_address)
        if connection := self.le_connections.get(peer_address):
            asyncio.get_running_loop().call_soon(self._confirm, connection)

    def on_hci_disconnect_command(self, command: hci.HCI_Disconnect_Command) -> None:
        """Disconnect also where the peer has left the air, and cannot be told."""
        connection = self.find_le_connection_by_handle(command.connection_handle)
        try:
            super().on_hci_disconnect_command(command)
        except core.InvalidArgumentError:
            if connection is not None:
                self.on_le_disconnected(connection, command.reason)

    def on_hci_acl_data_packet(self, packet: hci.HCI_AclDataPacket) -> None:
        """Pass a packet on; where the peer's host is behind, withhold the sender's credit until it has caught up."""
        connection = self.find_le_connection_by_handle(packet.connection_handle)
        if connection is None:
            return  # its end is on its way to the host
        peer = self.air.find_le_controller(connection.peer_address)
        if isinstance(peer, Radio) and peer.congested:
            connection.assembler.feed_packet(packet)
            peer._withheld.append((self, connection.handle))  # noqa: SLF001
        else:
            super().on_hci_acl_data_packet(packet)

    def on_link_acl_data(self, sender_address: hci.Address, transport: core.PhysicalTransport, data: bytes) -> None:
        """Take data from the air; what is late for its link is dropped."""
        if sender_address in self.le_connections:
            super().on_link_acl_data(sender_address, transport, data)

    def on_ll_control_pdu(self, sender_address: hci.Address, packet: ll.ControlPdu) -> None:
        """Take a control packet; where both ends disconnect at once, the other's word comes after the end."""
        if sender_address in self.le_connections:
            super().on_ll_control_pdu(sender_address, packet)

    def set_congested(self, *, congested: bool) -> None:
        """Say whether this radio's host is behind; release what was withheld from its peers when it is not."""
        self.congested = congested
        if congested:
            return
        withheld, self._withheld = self._withheld, []
        for sender, handle in withheld:
            if sender.find_le_connection_by_handle(handle) is not None:
                sender.send_hci_packet(
                    hci.HCI_Number_Of_Completed_Packets_Event(connection_handles=[handle], num_completed_packets=[1])
                )

    def leave(self) -> None:
        """Go off the air: peers see a supervision timeout (0x08), the host a lost transport. Does nothing twice."""
        if self._left:
            return
        self._left = True
        self.le_legacy_advertiser.stop()
        for connection in self.le_connections.values():
            with suppress(core.InvalidArgumentError):
                connection.send_ll_control_pdu(ll.TerminateInd(hci.HCI_ErrorCode.CONNECTION_TIMEOUT_ERROR))
        self.le_connections.clear()
        self.air.remove_controller(self)
        self.set_congested(congested=False)
        if not self.terminated.done():
            self.terminated.set_result(None)
        host, self.host = self.host, None
        report_loss(host)

    def _confirm(self, connection: Connection) -> None:
        peer = self.air.find_le_controller(connection.peer_address)
        joined = peer is not None and connection.self_address in peer.le_connections
        if not joined and self.le_connections.get(connection.peer_address) is connection:
            self.on_le_disconnected(connection, hci.HCI_ErrorCode.CONNECTION_FAILED_TO_BE_ESTABLISHED_ERROR)


def report_loss(sink: object) -> None:
    """Tell a bumble host that its transport is gone, so that its connections end.

    bumble's own report raises where a command was answered in the same turn of the loop, and then ends nothing.
    """
    if not isinstance(sink, Host):
        return
    try:
        sink.on_transport_lost()  # type: ignore[no-untyped-call]  # bumble's
    except asyncio.InvalidStateError:
        sink.emit("flush")
