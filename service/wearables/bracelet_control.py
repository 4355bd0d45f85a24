"""The bracelet's control point: what a host asks of it, and its answers, in bytes.

The shape is the Bluetooth SIG's (the Record Access Control Point is the model): a request is written, with response,
and answered by one indication. Both codecs are here: a device reads requests and writes answers, a host the other way.

| request | op | parameters | what it does |
| --- | --- | --- | --- |
| start         | 01 | –                              | samples are notified on `data` from the newest on |
| stop          | 02 | –                              | no more of them; measuring and keeping go on |
| rate          | 03 | u16, samples per second × 100  | 1250, 2500, 5000 or 10000; only while stopped |
| range         | 04 | u8, g                          | 2, 4, 8 or 16 (±); only while stopped |
| set time      | 05 | u64, ms since 1970 UTC         | its own clock is set, which `utc` reads |
| report        | 06 | u32 boot, u32 first, u32 n ≥ 1 | sends again what it holds of the n samples from first on |
| report extent | 07 | –                              | tells which samples it holds |
| abort         | 08 | –                              | ends a report; no answer to the report follows |

| answer | 80 | op of the request, result u8, records |
| --- | --- | --- |
| records | 12 bytes | u32 boot, u32 first, u32 n: of report with 01, 06, 08, of report extent with 01; else none |

| result | meaning |
| --- | --- |
| 01 success | done; of report: all it held was sent, and `records` says which samples those are |
| 02 op not supported | it has no such request |
| 03 invalid parameter | too long, too short, or a value it cannot take |
| 04 operation failed | for a reason of its own |
| 05 not permitted now | rate and range while started |
| 06 no records found | it holds none of them, or they are of another boot; `records` repeats boot and first, n = 0 |
| 08 not completed | samples were overwritten before they could be sent; `records` says what was; ask for the rest |

ATT errors: 0D for a write of no bytes; FD while indications are not enabled; FE, except for abort, while a report goes
on or an answer has not been confirmed. A report whose link ends is over.

**A new numbering.** A changed rate or range starts the boot number, the index and the tick anew, as a reset does, and
empties the history: a sample's number always means one time and one scale. A host then reads boot, scale, rate and
clock again before it writes start. To ask for what is set already changes nothing. Setting the time changes no number
and no tick.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from service.errors import ParameterError, WireError, WireFault
from service.samples import Reply
from service.wearables.bracelet_values import CONTROL, LATEST_UTC_MS
from service.wearables.contract import Write

ANSWER: Final = 0x80
RATES_HZ: Final = (12.5, 25.0, 50.0, 100.0)
RANGES_G: Final = (2, 4, 8, 16)
FULL_SCALE: Final = 32768
"""LSB of a range: ±8 g are 4096 LSB/g."""
U32: Final = 0xFFFFFFFF


class Op(IntEnum):
    """What can be asked."""

    START = 0x01
    STOP = 0x02
    RATE = 0x03
    RANGE = 0x04
    TIME = 0x05
    REPORT = 0x06
    EXTENT = 0x07
    ABORT = 0x08


class Result(IntEnum):
    """How it went; the numbers are the SIG's (Record Access and Fitness Machine Control Points)."""

    SUCCESS = 0x01
    NOT_SUPPORTED = 0x02
    INVALID_PARAMETER = 0x03
    FAILED = 0x04
    NOT_PERMITTED = 0x05
    NO_RECORDS = 0x06
    NOT_COMPLETED = 0x08


class AttFault(IntEnum):
    """ATT errors of a write that is no request at all."""

    INVALID_LENGTH = 0x0D
    INDICATIONS_OFF = 0xFD
    IN_PROGRESS = 0xFE


class Records(NamedTuple):
    """`samples` samples from `first` (u32, wraps) on, of one boot."""

    boot: int
    first: int
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One request; `value` is the rate in Hz × 100, the range in g or the time in ms."""

    op: Op
    value: int = 0
    records: Records | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """One answer; `op` is the request's, which may be none of ours."""

    op: int
    result: Result
    records: Records | None = None


NAMES: Final = {
    Op.START: "start",
    Op.STOP: "stop",
    Op.RATE: "rate",
    Op.RANGE: "range",
    Op.TIME: "time",
    Op.REPORT: "history",
    Op.EXTENT: "extent",
    Op.ABORT: "abort",
}
"""What a Reply calls each request."""
_WHY: Final = {
    Result.SUCCESS: "",
    Result.NOT_SUPPORTED: "the device has no such request",
    Result.INVALID_PARAMETER: "the device does not take this value",
    Result.FAILED: "the device could not do it",
    Result.NOT_PERMITTED: "not while it streams: stop it first",
    Result.NO_RECORDS: "",
    Result.NOT_COMPLETED: "samples were overwritten while they were sent again: ask for the rest",
}
_LAYOUTS: Final = {Op.RATE: "<H", Op.RANGE: "<B", Op.TIME: "<Q", Op.REPORT: "<III"}
"""Parameters of the requests that have any."""
_RECORDS: Final = struct.Struct("<III")
_WITH_RECORDS: Final = {
    (Op.REPORT, Result.SUCCESS),
    (Op.REPORT, Result.NO_RECORDS),
    (Op.REPORT, Result.NOT_COMPLETED),
    (Op.EXTENT, Result.SUCCESS),
}


def encode_request(request: Request) -> bytes:
    """Return the bytes a host writes."""
    layout = _LAYOUTS.get(request.op)
    if layout is None:
        return bytes([request.op])
    return bytes([request.op]) + struct.pack(layout, *(request.records or (request.value,)))


def decode_request(data: bytes) -> Request | Answer:
    """Return what a host asks, or the answer where it is none; WireError (LENGTH) for no bytes."""
    if not data:
        raise WireError(WireFault.LENGTH, "a request of no bytes")
    try:
        op = Op(data[0])
    except ValueError:
        return Answer(op=data[0], result=Result.NOT_SUPPORTED)
    layout = _LAYOUTS.get(op, "<")
    if len(data) - 1 != struct.calcsize(layout):
        return Answer(op=op, result=Result.INVALID_PARAMETER)
    parameters = struct.unpack_from(layout, data, 1)
    if op is Op.REPORT:
        request = Request(op=op, records=Records(*parameters))
    else:
        request = Request(op=op, value=parameters[0] if parameters else 0)
    return request if _takes(request) else Answer(op=op, result=Result.INVALID_PARAMETER)


def encode_answer(answer: Answer) -> bytes:
    """Return the bytes a device indicates."""
    head = bytes([ANSWER, answer.op, answer.result])
    return head if answer.records is None else head + _RECORDS.pack(*answer.records)


def decode_answer(data: bytes) -> Answer:
    """Return a device's answer; WireError where it is none."""
    if len(data) < 3:
        raise WireError(WireFault.LENGTH, f"an answer of {len(data)} bytes; 3 or 15 are valid")
    code, op, number = data[:3]
    if code != ANSWER:
        raise WireError(WireFault.VALUE, f"an answer begins with {ANSWER:#04x}, not {code:#04x}")
    try:
        result = Result(number)
    except ValueError:
        raise WireError(WireFault.VALUE, f"a result of {number:#04x}") from None
    told = (op, result) in _WITH_RECORDS
    if len(data) != 3 + told * _RECORDS.size:
        raise WireError(WireFault.LENGTH, f"{len(data)} bytes of answer {result.name} to request {op:#04x}")
    return Answer(op=op, result=result, records=Records(*_RECORDS.unpack_from(data, 3)) if told else None)


def reply(data: bytes) -> Reply:
    """Return what a device's answer says; WireError where it is none.

    A device that has none of the records asked for has answered, and sent all it had: no samples.
    """
    answer = decode_answer(data)
    try:
        name = NAMES[Op(answer.op)]
    except ValueError:
        name = f"{answer.op:#04x}"
    accepted = answer.result in {Result.SUCCESS, Result.NO_RECORDS}
    if answer.records is None:
        return Reply(request=name, accepted=accepted, why=_WHY[answer.result])
    boot, first, samples = answer.records
    return Reply(request=name, accepted=accepted, why=_WHY[answer.result], boot=boot, first=first, samples=samples)


def start() -> Write:
    """Stream; a device without a control point streams to whoever subscribes."""
    return _write(Request(op=Op.START), optional=True)


def stop() -> Write:
    """Stream no more."""
    return _write(Request(op=Op.STOP))


def set_rate(rate_hz: float) -> Write:
    """Measure at another rate, under a new boot number; stop first."""
    if rate_hz not in RATES_HZ:
        raise ParameterError("rate_hz", rate_hz, f"one of {', '.join(f'{rate:g}' for rate in RATES_HZ)} Hz")
    return _write(Request(op=Op.RATE, value=round(rate_hz * 100)))


def set_range(range_g: int) -> Write:
    """Measure ±`range_g`, under a new boot number; stop first."""
    if range_g not in RANGES_G:
        raise ParameterError("range_g", range_g, f"one of {', '.join(map(str, RANGES_G))} g")
    return _write(Request(op=Op.RANGE, value=range_g))


def set_time(utc_ms: int) -> Write:
    """Set the device's own clock."""
    if not 0 < utc_ms < LATEST_UTC_MS:
        raise ParameterError("utc_ms", utc_ms, "milliseconds since 1970, before the year 10000")
    return _write(Request(op=Op.TIME, value=utc_ms))


def report(boot: int, first: int, samples: int) -> Write:
    """Send samples again."""
    return _write(Request(op=Op.REPORT, records=Records(boot & U32, first & U32, min(samples, U32))))


def report_extent() -> Write:
    """Tell which samples the device holds."""
    return _write(Request(op=Op.EXTENT))


def abort() -> Write:
    """End a report."""
    return _write(Request(op=Op.ABORT))


def _write(request: Request, *, optional: bool = False) -> Write:
    return Write(characteristic=CONTROL, data=encode_request(request), optional=optional)


def _takes(request: Request) -> bool:
    """Return whether a request's value is one that there is."""
    match request.op:
        case Op.RATE:
            return request.value / 100 in RATES_HZ
        case Op.RANGE:
            return request.value in RANGES_G
        case Op.TIME:
            return 0 < request.value < LATEST_UTC_MS
        case Op.REPORT:
            return request.records is not None and request.records.samples > 0
        case _:
            return True
