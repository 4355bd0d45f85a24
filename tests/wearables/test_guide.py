"""The guide's worked example is what the codecs say."""

import re
from pathlib import Path

import pytest

from service.samples import Reply
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control

PAGE = (Path(__file__).parents[2] / "service" / "guide" / "bracelet.md").read_text("utf-8")
EXAMPLES = {name: bytes.fromhex(text) for name, text in re.findall(r"```bytes (\w+)\n(.*?)\n```", PAGE)}


def test_every_example_is_checked():
    assert set(EXAMPLES) == {"packet", "request", "answer", "rate"}


def test_the_packet():
    counts = [(0, 0, 4096), (1, -1, 4096)]
    assert wire.encode(wire.DataPacket(boot=1, index=128, tick=2621, counts=counts)) == EXAMPLES["packet"]
    again = wire.DataPacket(boot=1, index=128, tick=2621, counts=counts, history=True)
    assert wire.encode(again)[:1] == b"\x11"


def test_the_request():
    decoder = wire.Bracelet()
    decoder.feed(wire.HISTORY, wire.encode_history(30_000))
    (write,) = decoder.history(1, 300, 300)
    assert write.data == EXAMPLES["request"]


def test_the_answer():
    expected = Reply(request="history", accepted=True, boot=1, first=320, samples=280)
    assert wire.Bracelet().feed(wire.CONTROL, EXAMPLES["answer"]) == expected


def test_the_rate():
    assert control.set_rate(100.0).data == EXAMPLES["rate"]


@pytest.mark.parametrize("op", control.Op)
def test_every_request_is_told_of(op):
    assert re.search(rf"^{op:02x} |`{op:02x}\b", PAGE, re.MULTILINE)
