"""What every link promises: one connection to one device, whose packets come by iteration.

    async with link:                # connects and does the wearable's handshake; LinkError where that fails
        async for packet in link:   # every value read or notified, in order, stamped on arrival
            ...

Iteration ends by LinkError when the link is lost and never otherwise while the context is open; leaving the context
closes the connection. The object is then done: a new connection is a new link.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from types import TracebackType
from typing import Protocol, Self

from service.samples import Packet
from service.wearables.contract import Write


class Link(Protocol):
    """One connection to one device."""

    @property
    def said(self) -> Sequence[Packet]:
        """What the device said of itself in the handshake, to know it by; iteration yields it too, and first."""

    async def __aenter__(self) -> Self:
        """Connect and do the handshake; LinkError says why it failed."""

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the connection, however far it got."""

    def __aiter__(self) -> AsyncIterator[Packet]:
        """Yield packets until the link is lost."""

    async def request(self, write: Write) -> None:
        """Ask the device for something."""
