"""What every wearable family promises: bytes to samples and back, and never a socket.

`handshake` lists, in order, what a host must do after connecting; `feed` turns the bytes of one characteristic, read
or notified, into samples or into what the device said of itself, or raises a WireError; `history` lists the writes
that ask for samples again. The same object serves live data, a replay and the emulator's tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from service.samples import DeviceInfo, RawBlock, Reply


@dataclass(frozen=True, slots=True, kw_only=True)
class Read:
    """Read a characteristic once; the value goes to `feed`. An `optional` one may be missing."""

    characteristic: str
    optional: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Subscribe:
    """Subscribe to a characteristic's notifications; every value goes to `feed`."""

    characteristic: str
    optional: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Write:
    """Write a characteristic, with response. An `optional` one may be missing."""

    characteristic: str
    data: bytes
    optional: bool = False


Action = Read | Subscribe | Write


class Wearable(Protocol):
    """One device family's protocol, sans-I/O."""

    @property
    def services(self) -> Sequence[str]:
        """Advertised service UUIDs (lower case, 128 bit) by which a scan recognises the family."""

    def handshake(self) -> Sequence[Action]:
        """Return what to do after connecting, in order."""

    def feed(self, characteristic: str, data: bytes) -> RawBlock | DeviceInfo | Reply | None:
        """Decode one value; None where it holds nothing for us; WireError where it breaks the format."""

    def history(self, boot: int, first: int, samples: int) -> Sequence[Write]:
        """Return the writes that ask for `samples` samples from `first` (u32) on again; empty where it keeps none."""
