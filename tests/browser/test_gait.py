"""Whether somebody walks, on a card: in words with an icon, how sure that is, and what was refused; nothing jumps."""

from typing import Any

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, counting, device
from playwright.sync_api import Locator, Page, expect

pytestmark = pytest.mark.full

WORDS = {
    "rest": "At rest",
    "other": "Moving, not walking",
    "perhaps": "Perhaps walking",
    "walking": "Walking",
}
SIZES = {"phone": (390, 844), "desktop": (1280, 800), "narrow": (320, 640)}


def gait(verdict: str, confidence: float = 0.97) -> dict[str, Any]:
    return {"verdict": verdict, "confidence": confidence, "device_s": 12.3}


def recognising(**changes: Any) -> dict[str, Any]:
    """A device whose primary recognises walking, with double_threshold beside it."""
    counters = {"steplink": 40, "double_threshold": 81}
    return device(primary="steplink", counters=counters, gait=gait("walking"), refused={}) | changes


def heard(**changes: Any) -> dict[str, Any]:
    return {"type": "device", "device": "SL-0001", "at": AT, "value": recognising(**changes)}


def field(page: Page, name: str) -> Locator:
    return page.locator(f'.card [data-f="{name}"]')


def test_each_verdict_has_its_own_word_and_icon_and_says_how_sure_it_is(scripted: Scripted) -> None:
    server = scripted(recognising())
    page = server.open()
    icons = set()
    for confidence, (verdict, word) in enumerate(WORDS.items(), 20):
        spm = 108.4 if verdict == "walking" else None
        server.send(counting(40, 40, spm) | {"gait": gait(verdict, confidence / 100)})
        expect(field(page, "gait")).to_have_text(word)
        expect(field(page, "gait-sure")).to_have_text(f"Walking is {confidence}\u00a0% likely")
        expect(field(page, "cadence")).to_have_text("108" if spm else "–")
        icons.add(icon := field(page, "gait-icon").get_attribute("href") or "")
        assert page.locator(f"symbol{icon}").count() == 1
    assert len(icons) == len(WORDS)


@pytest.mark.parametrize(("confidence", "told"), [(0.0, "under 1"), (0.995, "over 99"), (0.012, "1"), (0.99, "99")])
def test_nothing_is_told_as_certain(scripted: Scripted, confidence: float, told: str) -> None:
    page = scripted(recognising(gait=gait("perhaps", confidence))).open()
    expect(field(page, "gait-sure")).to_have_text(f"Walking is {told}\u00a0% likely")


@pytest.mark.parametrize("size", list(SIZES))
def test_nothing_moves_when_somebody_begins_to_walk_or_is_lost(scripted: Scripted, size: str) -> None:
    width, height = SIZES[size]
    server = scripted(recognising(), viewport={"width": width, "height": height})
    page = server.open()
    expect(field(page, "gait")).to_have_text("Walking")
    places = []
    for verdict, word in WORDS.items():
        server.send(heard(gait=gait(verdict), cadence_spm=None))
        expect(field(page, "gait")).to_have_text(word)
        places.append([page.locator(f".card {where}").bounding_box() for where in (".count", ".gait", ".figure")])
    server.send(heard(gait=None))
    expect(field(page, "gait")).to_have_text("–")
    places.append([page.locator(f".card {where}").bounding_box() for where in (".count", ".gait", ".figure")])
    assert all(place == places[0] for place in places)
    plot = field(page, "canvas").bounding_box()
    assert plot is not None
    assert size == "narrow" or plot["y"] + plot["height"] <= height  # seen without scrolling, as without a gait
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_what_was_refused_is_a_sentence_by_reason(scripted: Scripted) -> None:
    server = scripted(recognising())
    page = server.open()
    expect(field(page, "refused")).to_have_text("No counter beside it counted steps where nobody walks.")
    server.send(heard(refused={"double_threshold": {"rest": 0, "other": 38, "perhaps": 3}}))
    expect(field(page, "refused")).to_have_text(
        "Double threshold counted 41 more: 38 in motion that is not walking, 3 too short or too unsure to be a walk."
    )
    server.send(heard(refused={"double_threshold": {"rest": 1200, "other": 0, "perhaps": 0}}))
    expect(field(page, "refused")).to_have_text("Double threshold counted 1,200 more: 1,200 at rest.")
    server.send(heard(counters={"steplink": 40}))
    expect(field(page, "refused")).to_be_hidden()


def test_of_a_counter_that_recognises_nothing_the_card_says_nothing(scripted: Scripted) -> None:
    server = scripted(device(gait=None, refused={}))
    page = server.open()
    expect(field(page, "steps-now")).to_have_text("42")
    for hidden in ("gait-row", "refused"):
        expect(field(page, hidden)).to_be_hidden()
    server.send(heard())
    expect(field(page, "gait-row")).to_be_visible()
    segment = {"type": "segment", "device": "SL-0001", "ordinal": 2, "at": AT, "primary": "plus_minus", "steps": 41}
    server.send(segment)
    for hidden in ("gait-row", "refused"):
        expect(field(page, hidden)).to_be_hidden()
