"""Running Speed and Cadence: round trips, the table in bytes, and nothing but a value or a WireError."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import WireError, WireFault
from service.wearables import rsc

u16, u32 = st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)


@given(
    speed=u16,
    cadence=st.integers(0, 255),
    running=st.booleans(),
    stride=st.none() | u16,
    distance=st.none() | u32,
)
def test_round_trip(speed, cadence, running, stride, distance):
    measurement = rsc.Measurement(
        speed_m_s=speed / 256,
        cadence_spm=cadence,
        running=running,
        stride_m=None if stride is None else stride / 100,
        distance_m=None if distance is None else distance / 10,
    )
    data = rsc.encode(measurement)
    assert len(data) <= 20
    assert rsc.decode(data) == measurement
    assert rsc.encode(rsc.decode(data)) == data


def test_the_table_in_bytes():
    everything = rsc.Measurement(speed_m_s=1.5, cadence_spm=110, running=True, stride_m=0.75, distance_m=100.1)
    assert rsc.encode(everything) == bytes.fromhex("07 8001 6e 4b00 e9030000")
    assert rsc.encode(rsc.Measurement(speed_m_s=0.0, cadence_spm=0)) == bytes(4)
    assert rsc.encode_feature(rsc.RUNNING) == b"\4\0"


@given(st.binary(max_size=512))
def test_any_bytes_give_a_value_or_a_wire_error(data):
    for decode, encode in ((rsc.decode, rsc.encode), (rsc.decode_feature, rsc.encode_feature)):
        try:
            said = decode(data)
        except WireError as error:
            assert error.reason in WireFault
        else:
            assert encode(said) == data


@pytest.mark.parametrize("data", ["", "00 0000", "00 0000 00 00", "01 0000 00", "08 0000 00"])
def test_what_is_refused(data):
    with pytest.raises(WireError):
        rsc.decode(bytes.fromhex(data))


def test_a_value_beyond_its_field_is_its_limit():
    assert rsc.decode(rsc.encode(rsc.Measurement(speed_m_s=-1.0, cadence_spm=300))).cadence_spm == 255
