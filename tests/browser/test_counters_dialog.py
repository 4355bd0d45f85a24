"""Choosing a device's counters in the page's dialog."""

import pytest
from browser.conftest import Scripted
from browser.scripted import ScriptedServer, device
from playwright.sync_api import Locator, Page, expect

from service.api.views import counter_view
from service.counters import registry

pytestmark = pytest.mark.full

LINEUP = "api/v1/devices/SL-0001/counters"
COUNTERS = {"items": [counter_view(kind).model_dump(mode="json") for kind in registry.COUNTERS.values()], "next": None}
STANDING = {"counters": [{"name": "double_threshold", "preset": "tuned", "params": {"bout": 3}}]}


def serving(server: ScriptedServer) -> ScriptedServer:
    """Let the scripted server answer for counters and take every lineup."""
    server.api |= {"GET api/v1/counters": COUNTERS, f"GET {LINEUP}": STANDING, f"PUT {LINEUP}": STANDING}
    return server


def opened(page: Page) -> Locator:
    """The dialog, opened from the card and filled."""
    page.get_by_role("button", name="Counters of Left wrist").click()
    dialog = page.get_by_role("dialog", name="Counters of Left wrist")
    expect(dialog.locator(".choice")).to_have_count(len(COUNTERS["items"]))
    return dialog


def choice(dialog: Locator, name: str) -> Locator:
    return dialog.locator(f".choice[data-counter={name}]")


def parameter(dialog: Locator, counter: str, name: str) -> Locator:
    """The field of a parameter, its counter's parameters opened."""
    more = choice(dialog, counter).locator("details")
    if not more.evaluate("more => more.open"):
        more.locator("summary").click()
    return more.get_by_label(name, exact=False).and_(dialog.locator(f".param:has(code:text-is('{name}')) > * > *"))


def test_all_counters_are_listed_and_what_stands_is_shown(scripted: Scripted) -> None:
    dialog = opened(serving(scripted(device(counter_faults={"fusion": "fusion needs a gyroscope"}))).open())
    for name in registry.COUNTERS:
        tick = dialog.get_by_role("checkbox", name=name.replace("_", " "), exact=True)
        assert tick.is_checked() == (name == "double_threshold")
        lead = dialog.get_by_role("radio", name=f"primary : {name.replace('_', ' ')}")
        assert lead.is_checked() == (name == "double_threshold")
    expect(parameter(dialog, "double_threshold", "bout")).to_have_value("3")
    expect(choice(dialog, "double_threshold").locator("summary")).to_contain_text("1 changed")
    expect(choice(dialog, "double_threshold").locator("details")).to_contain_text("2 to 12 peaks, paper 2, tuned 5")
    expect(choice(dialog, "fusion")).to_contain_text("fusion needs a gyroscope")
    expect(dialog.locator("[data-f=effect]")).to_have_text("Nothing changes yet.")


def test_what_is_chosen_is_put_and_the_focus_comes_back(scripted: Scripted) -> None:
    server = serving(scripted(device()))
    page = server.open()
    dialog = opened(page)
    choice(dialog, "autocorrelation").get_by_role("radio").check()
    expect(dialog.get_by_role("checkbox", name="autocorrelation")).to_be_checked()
    choice(dialog, "plus_minus").get_by_role("checkbox").check()
    choice(dialog, "plus_minus").get_by_label("Preset").select_option("paper")
    parameter(dialog, "double_threshold", "bout").fill("4")
    parameter(dialog, "double_threshold", "credit").select_option("never")
    expect(dialog.locator("[data-f=effect]")).to_contain_text("A new segment begins: autocorrelation counts")
    dialog.get_by_role("button", name="Apply").click()
    expect(dialog).to_be_hidden()
    expect(page.get_by_role("button", name="Counters of Left wrist")).to_be_focused()
    expect(page.locator("#announce")).to_have_text("The counters were changed.")
    lineup = [
        {"name": "autocorrelation", "preset": "tuned", "params": {}},
        {"name": "double_threshold", "preset": "tuned", "params": {"bout": 4, "credit": "never"}},
        {"name": "plus_minus", "preset": "paper", "params": {}},
    ]
    assert server.asked == [(f"PUT {LINEUP}", {"counters": lineup})]


def test_a_refusal_is_shown_as_the_servers_sentence_and_its_field_is_pointed_at(scripted: Scripted) -> None:
    server = serving(scripted(device()))
    server.api[f"PUT {LINEUP}"] = (422, {"detail": "bout = 99: from 2 to 12 peaks"})
    dialog = opened(server.open())
    bout = parameter(dialog, "double_threshold", "bout")
    bout.fill("99")
    choice(dialog, "double_threshold").locator("summary").click()
    dialog.get_by_role("button", name="Apply").click()
    expect(dialog.get_by_role("alert")).to_have_text("bout = 99: from 2 to 12 peaks")
    expect(bout).to_be_focused()
    expect(bout).to_have_attribute("aria-invalid", "true")
    bout.fill("5")
    bout.blur()
    expect(dialog.get_by_role("alert")).to_be_hidden()
    expect(bout).not_to_have_attribute("aria-invalid", "true")
    server.errors.clear()


def test_the_counter_that_a_refusal_names_is_pointed_at(scripted: Scripted) -> None:
    server = serving(scripted(device()))
    server.api[f"PUT {LINEUP}"] = (422, {"detail": "autocorrelation.bout = 99: from 1 to 12 steps"})
    dialog = opened(server.open())
    dialog.get_by_role("checkbox", name="autocorrelation").check()
    for name in ("double_threshold", "autocorrelation"):
        choice(dialog, name).locator("summary").click()
        parameter(dialog, name, "bout").fill("99")
    dialog.get_by_role("button", name="Apply").click()
    expect(parameter(dialog, "autocorrelation", "bout")).to_be_focused()
    expect(dialog.locator("[aria-invalid]")).to_have_count(1)
    server.errors.clear()


@pytest.mark.parametrize("reached", [True, False])
def test_a_server_that_gives_no_counters_is_told(scripted: Scripted, reached: bool) -> None:
    server = serving(scripted(device()))
    page = server.open()
    if reached:
        server.api["GET api/v1/counters"] = (500, {"detail": "out of order"})
    else:
        page.route("**/api/v1/counters", lambda route: route.abort())
    page.get_by_role("button", name="Counters of Left wrist").click()
    said = "out of order" if reached else "The server did not answer. Try again when it is back."
    expect(page.get_by_role("dialog").get_by_role("alert")).to_have_text(said)
    expect(page.get_by_role("button", name="Apply")).to_be_disabled()
    server.errors.clear()


def test_the_keyboard_opens_chooses_and_closes_the_dialog(scripted: Scripted) -> None:
    server = serving(scripted(device()))
    page = server.open()
    page.get_by_role("button", name="Counters of Left wrist").focus()
    page.keyboard.press("Enter")
    dialog = page.get_by_role("dialog")
    expect(dialog.locator(".choice")).to_have_count(len(registry.COUNTERS))
    dialog.get_by_role("checkbox", name="double threshold").focus()
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowDown")
    expect(dialog.get_by_role("radio", name="primary : autocorrelation")).to_be_checked()
    page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()
    expect(page.get_by_role("button", name="Counters of Left wrist")).to_be_focused()
    assert server.asked == []


@pytest.mark.parametrize("width", [320, 390, 1440])
def test_the_dialog_fits_and_its_targets_are_large_enough(scripted: Scripted, width: int) -> None:
    server = serving(scripted(device(name="A rather long name " * 3), viewport={"width": width, "height": 700}))
    page = server.open()
    page.get_by_role("button", name="Counters of").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.locator(".choice")).to_have_count(len(registry.COUNTERS))
    choice(dialog, "double_threshold").locator("summary").click()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert dialog.locator(".choices").evaluate("list => list.scrollWidth - list.clientWidth") <= 0
    targets = "button, select, summary, .tick, input[type=text]"
    heights = dialog.locator(targets).evaluate_all(
        "nodes => nodes.map((node) => node.getBoundingClientRect().height).filter((height) => height > 0)"
    )
    assert len(heights) > 30
    assert min(heights) >= 44
    apply = dialog.get_by_role("button", name="Apply").bounding_box()
    assert apply is not None
    assert apply["y"] + apply["height"] <= 700
