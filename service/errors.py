"""Every error steplink raises on purpose; the tree is this page.

    SteplinkError
    ├── ParameterError      a counter's or command's parameter is unknown, wrong, out of range or against another
    ├── RecordingError      a file is no recording: wrong shape, missing columns, NaN, an unknown format
    ├── WireError           bytes from a device that are no valid packet; `reason` says which rule they break
    ├── SnapshotError       a snapshot of another counter, version or parameters
    ├── CounterError        a counter cannot be built: unknown name, or a sensor the device lacks
    ├── LinkError           a link could not be made or was lost; `reason` is a LinkFault
    ├── StoreError          something could not be stored or read; `reason` is a StoreFault
    ├── LearningError       a walk from which a counter's parameters cannot be learnt
    ├── TrainingError       a network that cannot be trained here, or that came to nothing
    ├── NotNowError         what was asked for is possible, but not at this moment
    ├── UnknownDeviceError  no device of that id
    ├── UnknownPersonError  nobody of that name has data
    └── UnknownNumberError  no calibration or trial of that number

Each carries typed fields and a sentence that says what to do. None of them ends a stream: bad input is counted
and skipped, a lost link is made again.
"""

from __future__ import annotations

from enum import StrEnum


class SteplinkError(Exception):
    """Base of every error raised on purpose."""


class ParameterError(SteplinkError):
    """A parameter is unknown, of the wrong type, out of range or in contradiction to another."""

    def __init__(self, name: str, value: object, why: str) -> None:
        super().__init__(f"{name} = {value!r}: {why}")
        self.name = name
        self.value = value
        self.why = why


class RecordingError(SteplinkError):
    """A file that cannot be read as a recording."""

    def __init__(self, path: str, why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.path = path
        self.why = why


class WireFault(StrEnum):
    """Which rule of its format a packet breaks."""

    VERSION = "version"
    LENGTH = "length"
    VALUE = "value"
    CHARACTERISTIC = "characteristic"
    ORDER = "order"


class WireError(SteplinkError):
    """Bytes from a device that are no valid packet."""

    def __init__(self, reason: WireFault, why: str) -> None:
        super().__init__(f"{reason.value}: {why}")
        self.reason = reason
        self.why = why


class SnapshotError(SteplinkError):
    """A snapshot that does not belong to what should restore it."""


class CounterError(SteplinkError):
    """A counter that cannot be built."""


class LinkFault(StrEnum):
    """Why a link could not be made or was lost."""

    NO_ADAPTER = "no_adapter"
    NOT_FOUND = "not_found"
    TIMEOUT = "timeout"
    LOST = "lost"
    SILENT = "silent"
    NOT_OURS = "not_ours"
    TWIN = "twin"
    REFUSED = "refused"


class LinkError(SteplinkError):
    """A link that could not be made or was lost."""

    def __init__(self, reason: LinkFault, why: str) -> None:
        super().__init__(why)
        self.reason = reason
        self.why = why


class StoreFault(StrEnum):
    """Why something could not be stored or read."""

    FULL = "full"
    READ_ONLY = "read_only"
    IO = "io"
    LOCKED = "locked"
    IN_USE = "in_use"
    BUSY = "busy"
    CLOSED = "closed"
    CORRUPT = "corrupt"
    FOREIGN = "foreign"
    NEWER = "newer"
    REFUSED = "refused"
    GONE = "gone"


PASSING_FAULTS = frozenset({StoreFault.FULL, StoreFault.READ_ONLY, StoreFault.IO, StoreFault.LOCKED, StoreFault.BUSY})
"""Faults that end by themselves or by somebody's help outside: the same request may succeed later."""


class StoreError(SteplinkError):
    """Something that could not be stored or read."""

    def __init__(self, reason: StoreFault, why: str) -> None:
        super().__init__(why)
        self.reason = reason
        self.why = why

    @property
    def is_passing(self) -> bool:
        """Whether the same request may succeed later."""
        return self.reason in PASSING_FAULTS


class LearningError(SteplinkError):
    """A walk from which a counter's parameters cannot be learnt; it says how to walk."""


class TrainingError(SteplinkError):
    """A network that cannot be trained here, or whose training came to nothing; it says what to do."""


class NotNowError(SteplinkError):
    """What was asked for is possible, but not at this moment; it says when."""


class UnknownDeviceError(SteplinkError):
    """No device of that id."""

    def __init__(self, device: str) -> None:
        super().__init__(f"no device {device!r}: GET /api/v1/devices lists the known ones")
        self.device = device


class UnknownPersonError(SteplinkError):
    """Nobody of that name has data."""

    def __init__(self, person: str) -> None:
        super().__init__(f"no data of {person!r}: names are told apart by case")
        self.person = person


class UnknownNumberError(SteplinkError):
    """No calibration or trial of that number."""

    def __init__(self, what: str, number: int, where: str) -> None:
        super().__init__(f"no {what} {number}: GET {where} lists them")
        self.what = what
        self.number = number
