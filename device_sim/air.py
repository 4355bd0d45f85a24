"""The virtual air in one process: radios on one link, and the two kinds of participant.

`LocalAir` holds everything in this process; `device_sim.air_tcp` reaches one over loopback TCP. Both give the same
three things: `attach` (a controller for bumble), `bracelet` (a peripheral) and `central` (bleak's classes).
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from types import TracebackType
from typing import Self

from bumble.transport.common import Transport

from device_sim.bleak_backend import BleakBackends, bleak_backends
from device_sim.bracelet import Bracelet
from device_sim.controller import AirLink, Radio
from device_sim.gatt import GattBracelet, Start


class Participants:
    """What every air offers on top of `attach`."""

    def attach(self, name: str) -> AbstractAsyncContextManager[Transport]:
        """See `device_sim.controller.Air`."""
        raise NotImplementedError

    def bracelet(
        self,
        bracelet: Bracelet,
        *,
        name: str = "Steplink",
        speed: float = 1.0,
        start: Start = Start.POWER_ON,
        max_mtu: int = 517,
        encrypted: bool = False,
    ) -> GattBracelet:
        """Return a bracelet that is on this air while entered; parameters as for GattBracelet."""
        return GattBracelet(bracelet, self, name=name, speed=speed, start=start, max_mtu=max_mtu, encrypted=encrypted)

    def central(self, name: str = "central") -> AbstractAsyncContextManager[BleakBackends]:
        """Return bleak's `scanner` and `client` classes for a host on this air, usable while entered."""
        return bleak_backends(self, name)


class LocalAir(Participants):
    """An air in this process; leaving it takes every participant's controller away."""

    def __init__(self) -> None:
        self.link = AirLink()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for radio in self.link.radios():
            radio.leave()

    @asynccontextmanager
    async def attach(self, name: str) -> AsyncIterator[Transport]:
        """Put a controller on the air and return its transport; it leaves on exit."""
        radio = self.admit(name)
        try:
            yield Transport(radio, radio)
        finally:
            radio.leave()

    def admit(self, name: str) -> Radio:
        """Return a new radio on the air; whoever asked for it calls its `leave`."""
        return Radio(name, self.link)

    def statistics(self) -> dict[str, int]:
        """Return how many radios and links there are."""
        links = sum(len(radio.le_connections) for radio in self.link.controllers)
        return {"radios": len(self.link.controllers), "links": links // 2}
