"""The control point's bytes: requests, answers, and what a host makes of them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import ParameterError, WireError, WireFault
from service.samples import Reply
from service.wearables import bracelet_control as control
from service.wearables.bracelet_control import Answer, Op, Records, Request, Result

u32 = st.integers(0, 2**32 - 1)
records = st.builds(Records, u32, u32, u32)
requests = st.one_of(
    st.sampled_from([Op.START, Op.STOP, Op.EXTENT, Op.ABORT]).map(lambda op: Request(op=op)),
    st.sampled_from([1250, 2500, 5000, 10_000]).map(lambda value: Request(op=Op.RATE, value=value)),
    st.sampled_from([2, 4, 8, 16]).map(lambda value: Request(op=Op.RANGE, value=value)),
    st.integers(1, 253_402_300_799_999).map(lambda value: Request(op=Op.TIME, value=value)),
    st.builds(Records, u32, u32, st.integers(1, 2**32 - 1)).map(lambda asked: Request(op=Op.REPORT, records=asked)),
)


@given(requests)
def test_requests_round_trip_and_fit_the_smallest_mtu(request):
    data = control.encode_request(request)
    assert len(data) <= 20
    assert control.decode_request(data) == request


@given(st.integers(0, 255), st.sampled_from(Result), records)
def test_answers_round_trip_and_fit_the_smallest_mtu(op, result, held):
    told = (op, result) in control._WITH_RECORDS
    answer = Answer(op=op, result=result, records=held if told else None)
    data = control.encode_answer(answer)
    assert len(data) <= 20
    assert control.decode_answer(data) == answer
    assert control.reply(data).boot == (held.boot if told else None)


@given(st.binary(max_size=512))
def test_any_bytes_written_are_a_request_or_are_answered(data):
    try:
        asked = control.decode_request(data)
    except WireError as error:
        assert (data, error.reason) == (b"", WireFault.LENGTH)
        return
    if isinstance(asked, Request):
        assert control.encode_request(asked) == data
    else:
        assert asked.op == data[0]
        assert asked.result in {Result.NOT_SUPPORTED, Result.INVALID_PARAMETER}


@given(st.binary(max_size=512))
def test_any_bytes_indicated_are_an_answer_or_a_wire_error(data):
    try:
        answer = control.decode_answer(data)
    except WireError as error:
        assert error.reason in WireFault
    else:
        assert control.encode_answer(answer) == data


@pytest.mark.parametrize(
    ("data", "answer"),
    [
        ("00", Answer(op=0, result=Result.NOT_SUPPORTED)),
        ("09", Answer(op=9, result=Result.NOT_SUPPORTED)),
        ("80 01 01", Answer(op=0x80, result=Result.NOT_SUPPORTED)),
        ("01 00", Answer(op=Op.START, result=Result.INVALID_PARAMETER)),
        ("03 88", Answer(op=Op.RATE, result=Result.INVALID_PARAMETER)),
        ("03 8913", Answer(op=Op.RATE, result=Result.INVALID_PARAMETER)),
        ("04 03", Answer(op=Op.RANGE, result=Result.INVALID_PARAMETER)),
        ("05 0000000000000000", Answer(op=Op.TIME, result=Result.INVALID_PARAMETER)),
        ("05 ffffffffffffffff", Answer(op=Op.TIME, result=Result.INVALID_PARAMETER)),
        ("06 01000000 00000000 00000000", Answer(op=Op.REPORT, result=Result.INVALID_PARAMETER)),
        ("06 01000000 00000000", Answer(op=Op.REPORT, result=Result.INVALID_PARAMETER)),
    ],
)
def test_what_is_no_request_is_answered_why(data, answer):
    assert control.decode_request(bytes.fromhex(data)) == answer


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("80 01 01", Reply(request="start", accepted=True)),
        ("80 02 01", Reply(request="stop", accepted=True)),
        ("80 05 01", Reply(request="time", accepted=True)),
        (
            "80 06 01 01000000 80000000 2c010000",
            Reply(request="history", accepted=True, boot=1, first=128, samples=300),
        ),
        ("80 06 06 01000000 80000000 00000000", Reply(request="history", accepted=True, boot=1, first=128, samples=0)),
        ("80 07 01 01000000 00000000 64000000", Reply(request="extent", accepted=True, boot=1, first=0, samples=100)),
    ],
)
def test_what_a_host_makes_of_an_answer(data, said):
    assert control.reply(bytes.fromhex(data)) == said


@pytest.mark.parametrize(
    ("data", "request_", "why"),
    [
        ("80 03 05", "rate", "stop it first"),
        ("80 04 03", "range", "does not take"),
        ("80 55 02", "0x55", "no such request"),
        ("80 06 08 01000000 80000000 0a000000", "history", "ask for the rest"),
        ("80 06 04", "history", "could not"),
    ],
)
def test_a_refusal_says_why(data, request_, why):
    said = control.reply(bytes.fromhex(data))
    assert (said.request, said.accepted) == (request_, False)
    assert why in said.why


@pytest.mark.parametrize(
    ("write", "data"),
    [
        (control.start(), "01"),
        (control.stop(), "02"),
        (control.set_rate(12.5), "03 e204"),
        (control.set_range(16), "04 10"),
        (control.set_time(1), "05 0100000000000000"),
        (control.report(1, 2**32 + 5, 9), "06 01000000 05000000 09000000"),
        (control.report_extent(), "07"),
        (control.abort(), "08"),
    ],
)
def test_what_a_host_writes(write, data):
    assert (write.characteristic, write.data) == (control.CONTROL, bytes.fromhex(data))
    assert write.optional == (write == control.start())


@pytest.mark.parametrize(
    "wrong", [lambda: control.set_rate(52), lambda: control.set_range(3), lambda: control.set_time(0)]
)
def test_a_value_that_no_bracelet_takes_is_not_asked_for(wrong):
    with pytest.raises(ParameterError):
        wrong()
