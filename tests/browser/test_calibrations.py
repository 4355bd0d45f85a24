"""Calibrating a device from its card."""

from typing import Any

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, ScriptedServer, device
from playwright.sync_api import Locator, Page, Route, expect

pytestmark = pytest.mark.full

PATH = "api/v1/devices/SL-0001/calibrations"
COUNTERS = {
    "items": [
        {
            "name": "double_threshold",
            "sensors": ["accelerometer"],
            "parameters": [],
            "calibrations": ["walk", "middle"],
        },
        {"name": "gyro_zero_crossing", "sensors": ["gyroscope"], "parameters": [], "calibrations": ["slowest_walk"]},
    ],
    "next": None,
}


def calibration(number: int, **changes: Any) -> dict[str, Any]:
    """A Calibration as the API gives it: done, of a slow walk, with `changes`."""
    return {
        "number": number, "device": "SL-0001", "counter": "double_threshold", "method": "walk", "pace": "slow",
        "steps_wanted": 50, "seconds_wanted": None, "state": "done", "reason": None, "began_at": AT, "ended_at": AT,
        "steps": 50, "seconds": 31.2, "params": {"window_mode": "fixed", "first_window": 27},
        "detail": "27 samples (0.54 s) a step over 48 steps",
    } | changes  # fmt: skip


def listing(*items: dict[str, Any]) -> dict[str, Any]:
    return {"items": list(items), "next": None}


def opened(server: ScriptedServer, *items: dict[str, Any]) -> tuple[Page, Locator]:
    """The page and the panel, opened, with these calibrations on the server."""
    server.api |= {"GET api/v1/counters": COUNTERS, f"GET {PATH}": listing(*items)}
    page = server.open()
    page.get_by_role("button", name="Calibrate Left wrist").click()
    panel = page.get_by_role("region", name="Calibrations", exact=True)
    expect(panel).to_be_visible()
    return page, panel


def test_a_walk_is_begun_watched_and_its_outcome_is_a_sentence(scripted: Scripted) -> None:
    server = scripted(device())
    _, panel = opened(server)
    recording = calibration(1, pace="fast", state="recording", steps=23, seconds=12.4, params=None, detail=None)
    server.api[f"POST {PATH}"] = (201, recording)
    panel.get_by_label("Pace").select_option("fast")
    panel.get_by_label("How many").fill("60")
    server.api[f"GET {PATH}"] = listing(recording)
    panel.get_by_role("button", name="Start").click()
    expect(panel.get_by_text("23 of 50 steps")).to_be_visible()
    expect(panel.get_by_role("progressbar")).to_have_js_property("value", 0.46)
    expect(panel.get_by_role("button", name="Start")).to_be_hidden()
    body = {"counter": "double_threshold", "method": "walk", "pace": "fast", "steps": 60}
    assert server.asked == [(f"POST {PATH}", body)]
    server.api[f"GET {PATH}"] = listing(calibration(1, pace="fast"))
    expect(panel.get_by_role("status")).to_have_text("Sampling walk, fast: done.")
    expect(panel).to_contain_text("27 samples (0.54 s) a step over 48 steps")


@pytest.mark.parametrize(
    ("button", "request_"), [("Finish early", f"POST {PATH}/4/finish"), ("Cancel", f"DELETE {PATH}/4")]
)
def test_a_recording_can_be_ended_early_or_cancelled(scripted: Scripted, button: str, request_: str) -> None:
    server = scripted(device())
    server.api[request_] = (204, None) if button == "Cancel" else calibration(4)
    _, panel = opened(server, calibration(4, state="recording"))
    panel.get_by_role("button", name=button).click()
    expect(panel.get_by_role("progressbar")).to_be_visible()
    assert [what for what, _ in server.asked] == [request_]


def test_paces_that_are_ticked_are_applied_together(scripted: Scripted) -> None:
    server = scripted(device())
    server.api[f"POST {PATH}/apply"] = {"counters": []}
    other = calibration(4, counter="gyro_zero_crossing", method="slowest_walk", pace=None)
    _, panel = opened(server, calibration(1), calibration(2, pace="normal"), calibration(3, pace="fast"), other)
    walks = panel.get_by_role("region", name="double threshold: sampling walk")
    expect(walks.get_by_role("checkbox")).to_have_count(3)
    walks.get_by_role("checkbox", name="normal").uncheck()
    walks.get_by_role("button", name="Apply to double threshold").click()
    expect(panel.get_by_role("status")).to_contain_text("A new segment begins; the count goes on.")
    assert server.asked == [(f"POST {PATH}/apply", {"numbers": [1, 3]})]
    expect(walks.get_by_role("checkbox", name="normal")).not_to_be_checked()
    for pace in ("slow", "fast"):
        walks.get_by_role("checkbox", name=pace).uncheck()
    walks.get_by_role("button", name="Apply").click()
    expect(panel.get_by_role("alert")).to_have_text("Tick what is to be applied.")
    assert len(server.asked) == 1


def test_a_failure_says_why_and_cannot_be_applied(scripted: Scripted) -> None:
    server = scripted(device())
    why = "no steps were found: walk for the whole time"
    server.api[f"DELETE {PATH}/1"] = (204, None)
    _, panel = opened(server, calibration(1, state="failed", reason=why, params=None, detail=None))
    expect(panel).to_contain_text(f"Failed: {why}")
    expect(panel.get_by_role("button", name="Apply")).to_have_count(0)
    server.api[f"GET {PATH}"] = listing()
    panel.get_by_role("button", name="Forget Sampling walk, slow, number 1").click()
    expect(panel.get_by_text("Failed:")).to_have_count(0)


def test_a_refusal_is_told_as_the_servers_sentence(scripted: Scripted) -> None:
    server = scripted(device(state="lost"))
    server.api[f"POST {PATH}"] = (409, {"detail": "the device does not stream: connect it first"})
    _, panel = opened(server)
    panel.get_by_role("button", name="Start").click()
    expect(panel.get_by_role("alert")).to_have_text("the device does not stream: connect it first")
    server.errors.clear()


def test_the_amount_that_is_refused_is_marked_and_stays(scripted: Scripted) -> None:
    server = scripted(device())
    server.api[f"POST {PATH}"] = (422, {"detail": "steps = 3: from 10 to 1000 steps"})
    _, panel = opened(server)
    amount = panel.get_by_label("How many")
    amount.fill("3")
    panel.get_by_role("button", name="Start").click()
    expect(panel.get_by_role("alert")).to_have_text("steps = 3: from 10 to 1000 steps")
    expect(amount).to_be_focused()
    expect(amount).to_have_attribute("aria-invalid", "true")
    expect(amount).to_have_value("3")
    amount.fill("30")
    expect(amount).not_to_have_attribute("aria-invalid", "true")
    server.errors.clear()


def test_a_server_that_does_not_answer_is_told_until_it_does(scripted: Scripted) -> None:
    server = scripted(device())
    page, panel = opened(server, calibration(1, state="recording"))
    expect(panel.get_by_role("progressbar")).to_be_visible()
    page.route(f"**/{PATH}", lambda route: route.abort())
    expect(panel.get_by_role("alert")).to_have_text("The server did not answer. Try again when it is back.")
    page.unroute(f"**/{PATH}")
    expect(panel.get_by_role("alert")).to_be_hidden(timeout=10_000)
    server.errors.clear()


def test_nothing_can_be_typed_before_the_first_answer(scripted: Scripted) -> None:
    server = scripted(device())
    server.api |= {"GET api/v1/counters": COUNTERS, f"GET {PATH}": listing()}
    page = server.open()
    held: list[Route] = []
    page.route(f"**/{PATH}", lambda route: held.append(route))  # noqa: PLW0108 - Playwright marks the function
    page.get_by_role("button", name="Calibrate Left wrist").click()
    panel = page.get_by_role("region", name="Calibrations", exact=True)
    expect(panel).to_contain_text("Asking what can be calibrated…")
    expect(panel.get_by_label("How many")).to_be_hidden()
    while not held:
        page.wait_for_timeout(20)
    held[0].fulfill(json=listing())
    expect(panel.get_by_label("How many")).to_have_value("50")
    expect(panel.get_by_text("Asking")).to_be_hidden()


@pytest.mark.parametrize(
    ("sensors", "offered"), [(["accelerometer"], 2), (["accelerometer", "gyroscope"], 3), (None, 3)]
)
def test_only_what_the_device_can_do_is_offered(scripted: Scripted, sensors: list[str] | None, offered: int) -> None:
    _, panel = opened(scripted(device(sensors=sensors)))
    expect(panel.get_by_label("Calibration", exact=True).locator("option")).to_have_count(offered)
    panel.get_by_label("Calibration", exact=True).select_option("Middle of a recording")
    expect(panel.get_by_label("Pace")).to_be_hidden()
    expect(panel.get_by_label("Steps or seconds").locator("option")).to_have_text(["seconds"])
    expect(panel).to_contain_text("10 to 600 seconds")


def test_nothing_is_offered_where_no_counter_can_be_calibrated(scripted: Scripted) -> None:
    _, panel = opened(scripted(device(sensors=[])))
    expect(panel).to_contain_text("No counter can be calibrated on this bracelet.")
    expect(panel.get_by_role("button", name="Start")).to_be_hidden()


@pytest.mark.parametrize("width", [320, 1440])
def test_the_panel_fits_and_is_closed_by_its_button(scripted: Scripted, width: int) -> None:
    server = scripted(device(), viewport={"width": width, "height": 700})
    page, panel = opened(server, calibration(1), calibration(2, state="recording"))
    expect(panel.get_by_role("progressbar")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    button = page.get_by_role("button", name="Calibrate Left wrist")
    expect(button).to_have_attribute("aria-expanded", "true")
    button.click()
    expect(panel).to_be_hidden()
    expect(button).to_have_attribute("aria-expanded", "false")
