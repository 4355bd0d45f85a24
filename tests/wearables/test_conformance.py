"""Every wearable through the conformance suite."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wearables import conformance as suite

pytestmark = pytest.mark.parametrize("case", suite.WEARABLES.values(), ids=suite.WEARABLES)


@pytest.mark.parametrize(
    "check", [suite.check_services, suite.check_handshake, suite.check_data, suite.check_foreign, suite.check_history]
)
def test_the_contract(case, check):
    check(case)


@given(data=st.data())
def test_any_bytes(case, data):
    characteristics = [action.characteristic for action in case.make().handshake()]
    suite.check_any_bytes(case, data.draw(st.sampled_from(characteristics)), data.draw(st.binary(max_size=512)))
