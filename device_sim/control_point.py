"""The bracelet's control point without its radio: which requests it carries out, refuses or answers later.

One request at a time: the next is taken when the answer to the one before has been confirmed. A report is answered
when its last sample has been sent; only `abort` is taken meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass

from device_sim.bracelet import Bracelet
from service.errors import WireError
from service.wearables.bracelet_control import (
    Answer,
    AttFault,
    Op,
    Records,
    Request,
    Result,
    decode_request,
)


class RefusedError(Exception):
    """A write that is no request, and has an ATT error for an answer."""

    def __init__(self, fault: AttFault) -> None:
        super().__init__(fault.name)
        self.fault = fault


@dataclass(slots=True)
class _Report:
    """A report that goes on: the records asked for, and what of them is still to be sent."""

    asked: Records
    first: int
    place: int
    end: int


class ControlPoint:
    """Requests of one bracelet; begins stopped, and again with each connection."""

    def __init__(self, bracelet: Bracelet) -> None:
        self.streaming = False
        self._bracelet = bracelet
        self._report: _Report | None = None
        self._unconfirmed = 0

    @property
    def reporting(self) -> bool:
        """Whether samples are to be sent again."""
        return self._report is not None

    def take(self, data: bytes, *, indications: bool, notifications: bool) -> Answer | None:
        """Carry out a request; return the answer to indicate, None where a report has begun.

        `indications` and `notifications` tell whether the host has enabled those of control point and data.
        RefusedError where it is an ATT error.
        """
        if not indications:
            raise RefusedError(AttFault.INDICATIONS_OFF)
        aborts = data[:1] == bytes([Op.ABORT])
        if (self._report or self._unconfirmed) and not aborts:
            raise RefusedError(AttFault.IN_PROGRESS)
        try:
            request = decode_request(data)
        except WireError:
            raise RefusedError(AttFault.INVALID_LENGTH) from None
        if isinstance(request, Request) and request.op is Op.REPORT and not notifications:
            raise RefusedError(AttFault.INDICATIONS_OFF)
        answer = self._carry_out(request) if isinstance(request, Request) else request
        self._unconfirmed += answer is not None
        return answer

    def next_part(self, mtu: int) -> bytes | Answer | None:
        """Return a report's next packet, then its answer, which ends it; None where there is no report."""
        report = self._report
        if report is None:
            return None
        if report.place == report.first:  # where it begins may have been overwritten since it was asked for
            held = self._bracelet.holds(report.asked)
            report.first = report.place = min(max(report.first, held.start), report.end)
        if report.place < report.end:
            packet = self._bracelet.again(report.place, report.end - report.place, mtu)
            if packet is not None:
                data, samples = packet
                report.place += samples
                return data
        self._report = None
        self._unconfirmed += 1
        return self._finished(report)

    def fail_report(self) -> Answer | None:
        """End a report whose packets nobody takes any more; None where there is none."""
        if self._report is None:
            return None
        self._report = None
        self._unconfirmed += 1
        return Answer(op=Op.REPORT, result=Result.FAILED)

    def confirmed(self) -> None:
        """Take note that a host has confirmed an answer."""
        self._unconfirmed = max(0, self._unconfirmed - 1)

    def disconnected(self) -> None:
        """End what belongs to a connection."""
        self.streaming, self._report, self._unconfirmed = False, None, 0

    def _carry_out(self, request: Request) -> Answer | None:
        match request.op:
            case Op.START:
                if not self.streaming:
                    self._bracelet.discard()
                self.streaming = True
            case Op.STOP:
                self.streaming = False
            case Op.RATE | Op.RANGE if self.streaming:
                return Answer(op=request.op, result=Result.NOT_PERMITTED)
            case Op.RATE:
                self._bracelet.set_rate(request.value / 100)
            case Op.RANGE:
                self._bracelet.set_range(request.value)
            case Op.TIME:
                self._bracelet.set_utc(request.value)
            case _:
                return self._records(request)
        return Answer(op=request.op, result=Result.SUCCESS)

    def _records(self, request: Request) -> Answer | None:
        match request.op:
            case Op.REPORT:
                return self._begin_report(request)
            case Op.EXTENT:
                return Answer(op=request.op, result=Result.SUCCESS, records=self._bracelet.held())
        self._report = None
        return Answer(op=request.op, result=Result.SUCCESS)

    def _begin_report(self, request: Request) -> Answer | None:
        asked = request.records
        if asked is None:
            return Answer(op=request.op, result=Result.INVALID_PARAMETER)
        held = self._bracelet.holds(asked)
        if not held:
            return Answer(op=request.op, result=Result.NO_RECORDS, records=asked._replace(samples=0))
        self._report = _Report(asked, held.start, held.start, held.stop)
        return None

    def _finished(self, report: _Report) -> Answer:
        """Return the answer to a report: all that was held has been sent, or was overwritten on the way."""
        sent = Records(report.asked.boot, report.first & 0xFFFFFFFF, report.place - report.first)
        result = Result.SUCCESS if report.place >= report.end else Result.NOT_COMPLETED
        return Answer(op=Op.REPORT, result=result, records=sent)
