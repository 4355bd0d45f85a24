"""A bleak 3.1 backend over a bumble device: the service's real BLE code runs on the virtual air.

bleak takes backends as classes (`BleakClient(device, backend=…)`), so `bleak_backends` makes two that know their
central.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from bleak.backends.client import BaseBleakClient
from bleak.backends.scanner import BaseBleakScanner

from device_sim.bleak_client import BumbleClient
from device_sim.bleak_scanner import BumbleScanner
from device_sim.central import Central
from device_sim.controller import Air


@dataclass(frozen=True, slots=True, kw_only=True)
class BleakBackends:
    """What `backend=` takes: `BleakScanner(backend=scanner)`, `BleakClient(device, backend=client)`."""

    scanner: type[BaseBleakScanner]
    client: type[BaseBleakClient]
    central: Central


@asynccontextmanager
async def bleak_backends(air: Air, name: str = "central") -> AsyncIterator[BleakBackends]:
    """Return both classes for a new central on `air`; it opens when first used, and again after the air was lost."""
    async with Central(air, name) as owner:

        class VirtualScanner(BumbleScanner):
            central = owner

        class VirtualClient(BumbleClient):
            central = owner

        yield BleakBackends(scanner=VirtualScanner, client=VirtualClient, central=owner)
