"""The virtual air over loopback TCP: bracelet and service in processes of their own, which may be killed.

Every accepted socket speaks HCI (H4 framing) with a controller of its own. A socket that is lost is a radio that has
left: its peers see a supervision timeout. Bytes that are no HCI close that socket and nothing else. There is no
authentication, so only loopback addresses are served.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from types import TracebackType
from typing import Final, Self, cast

from bumble import core, hci
from bumble.transport.common import BaseSource, PacketParser, Transport, TransportLostError

from device_sim.air import LocalAir, Participants
from device_sim.bleak_backend import BleakBackends
from device_sim.controller import Radio, report_loss
from service.errors import LinkError, LinkFault, ParameterError

MAX_SOCKETS: Final = 256
"""Participants of one air; the next is closed at once."""
BACKLOG_BYTES: Final = 1 << 20
"""What may wait for a participant that does not read; then it is closed. Its peers' data is held back long before."""
OPEN_TIMEOUT_S: Final = 5.0

_log = logging.getLogger(__name__)


def parse_address(address: str) -> tuple[str, int]:
    """Return host and port of "HOST:PORT"; ParameterError where it is none, not loopback, or no port 1…65535."""
    host, _, port = address.rpartition(":")
    host = host.strip("[]")
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
        number = int(port)
    except ValueError:
        raise ParameterError("air", address, "HOST:PORT is wanted, for instance 127.0.0.1:7400") from None
    if not loopback or not 1 <= number <= 0xFFFF:
        raise ParameterError("air", address, "a loopback address and a port 1…65535: the air has no authentication")
    return host, number


class AirServer:
    """Serves a LocalAir on a loopback port while entered; without an address on a free one, which `address` tells."""

    def __init__(self, air: LocalAir, address: str | None = None, *, max_sockets: int = MAX_SOCKETS) -> None:
        self._air = air
        self._host, self._port = ("127.0.0.1", 0) if address is None else parse_address(address)
        self._max_sockets = max_sockets
        self._sockets: set[_RadioSocket] = set()
        self._refused = 0
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> Self:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: _RadioSocket(self), self._host, self._port)
        self._port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._server is not None:
            self._server.close()
            for socket in list(self._sockets):
                socket.abort("the air is closed")
            async with asyncio.timeout(OPEN_TIMEOUT_S):
                await self._server.wait_closed()

    @property
    def address(self) -> str:
        """HOST:PORT, as `RemoteAir` takes it."""
        return f"[{self._host}]:{self._port}" if ":" in self._host else f"{self._host}:{self._port}"

    def statistics(self) -> dict[str, int]:
        """Return how many sockets are open and were refused, and the air's own counts."""
        return {"sockets": len(self._sockets), "refused": self._refused, **self._air.statistics()}

    def admit(self, socket: _RadioSocket) -> Radio | None:
        """Give a new socket its radio; None where there are too many."""
        if len(self._sockets) >= self._max_sockets:
            self._refused += 1
            return None
        self._sockets.add(socket)
        return self._air.admit(f"socket {id(socket):x}")

    def dismiss(self, socket: _RadioSocket) -> None:
        """Forget a closed socket."""
        self._sockets.discard(socket)


class _RadioSocket(asyncio.Protocol):
    """The air's end of one participant's socket: the host of its radio, and where that host's packets come from."""

    def __init__(self, server: AirServer) -> None:
        self._server = server
        self._parser = PacketParser(_Packets(self))
        self._transport: asyncio.Transport | None = None
        self._radio: Radio | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._radio = self._server.admit(self)
        if self._radio is None:
            self.abort("too many participants")
            return
        self._radio.host = self
        self._radio.terminated.add_done_callback(lambda _: self.abort("the radio has left"))

    def connection_lost(self, _error: Exception | None) -> None:
        self._server.dismiss(self)
        if self._radio is not None:
            self._radio.leave()

    def data_received(self, data: bytes) -> None:
        try:
            self._parser.feed_data(data)
        except core.InvalidPacketError as error:
            self.abort(f"no HCI: {error}")

    def pause_writing(self) -> None:
        if self._radio is not None:
            self._radio.set_congested(congested=True)

    def resume_writing(self) -> None:
        if self._radio is not None:
            self._radio.set_congested(congested=False)

    def on_packet(self, packet: bytes) -> None:
        """Send a packet of the radio to its host."""
        if self._transport is None or self._transport.is_closing():
            return
        self._transport.write(packet)
        if self._transport.get_write_buffer_size() > BACKLOG_BYTES:
            self.abort("its host does not read")

    def take(self, packet: bytes) -> None:
        """Give a packet of the host to its radio; whatever is wrong with it is this socket's end only."""
        if self._radio is None or self._transport is None or self._transport.is_closing():
            return
        if packet[0] not in (hci.HCI_COMMAND_PACKET, hci.HCI_ACL_DATA_PACKET):
            self.abort(f"a host sends no packet of type {packet[0]}")
            return
        try:
            self._radio.on_packet(packet)
        except Exception as error:  # bumble parses with struct, enums, asserts …: any of their errors
            self.abort(f"a packet that the controller does not bear: {error!r}")

    def abort(self, why: str) -> None:
        """Close the socket at once."""
        if self._transport is not None and not self._transport.is_closing():
            _log.info("a participant is closed: %s", why)
            self._transport.abort()


class _Packets:
    """What the parser calls: `on_packet` of the socket itself goes the other way."""

    def __init__(self, socket: _RadioSocket) -> None:
        self._socket = socket

    def on_packet(self, packet: bytes) -> None:
        self._socket.take(packet)


class RemoteAir(Participants):
    """An air served by another process (or this one) at a loopback address "HOST:PORT"."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._host, self._port = parse_address(address)

    @asynccontextmanager
    async def attach(self, name: str) -> AsyncIterator[Transport]:  # noqa: ARG002  # a socket needs no name
        """Open a socket and return its transport; LinkError (NO_ADAPTER) where nobody serves the address."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(OPEN_TIMEOUT_S):
                transport, socket = await loop.create_connection(_HostSocket, self._host, self._port)
        except (OSError, TimeoutError) as error:
            why = f"no virtual air at {self.address} ({error}): `steplink sim --air {self.address}` serves one"
            raise LinkError(LinkFault.NO_ADAPTER, why) from error
        try:
            yield Transport(socket, socket)
        finally:
            transport.abort()
            await asyncio.wait({socket.terminated}, timeout=OPEN_TIMEOUT_S)


class _HostSocket(asyncio.Protocol, BaseSource):
    """A host's end of its socket: bumble's source and sink in one."""

    def __init__(self) -> None:
        super().__init__()
        self._parser = PacketParser()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        self._parser.set_packet_sink(self.sink) if self.sink else None
        try:
            self._parser.feed_data(data)
        except core.InvalidPacketError:
            if self._transport is not None:
                self._transport.abort()

    def connection_lost(self, _error: Exception | None) -> None:
        if not self.terminated.done():
            self.terminated.set_result(None)
        report_loss(self.sink)

    def on_packet(self, packet: bytes) -> None:
        """Send a packet to the air; a command that nobody can answer fails here, instead of waiting for ever."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(packet)
        elif packet[0] == hci.HCI_COMMAND_PACKET:
            raise TransportLostError("the virtual air is gone")


def open_air(address: str) -> RemoteAir:
    """Return the air at "HOST:PORT"; nothing is opened before somebody attaches."""
    return RemoteAir(address)


def remote_central(address: str) -> AbstractAsyncContextManager[BleakBackends]:
    """Return bleak's `scanner` and `client` for a host on the air at "HOST:PORT", usable while entered."""
    return RemoteAir(address).central()


@asynccontextmanager
async def hosted_air(address: str) -> AsyncIterator[LocalAir | RemoteAir]:
    """Serve an air at "HOST:PORT" while entered, or join the one that is served there already."""
    async with AsyncExitStack() as stack:
        air = await stack.enter_async_context(LocalAir())
        try:
            await stack.enter_async_context(AirServer(air, address))
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise LinkError(LinkFault.NO_ADAPTER, f"cannot serve an air at {address}: {error}") from error
            yield RemoteAir(address)
        else:
            yield air
