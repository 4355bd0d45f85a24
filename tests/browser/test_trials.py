"""Comparing two wrists on the page."""

from typing import Any

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, ScriptedServer, device
from playwright.sync_api import Locator, Page, expect

pytestmark = pytest.mark.full

PATH = "api/v1/trials"
RIGHT = {"id": "SL-0002", "name": "Right wrist", "address": "C0:FF:EE:00:00:02"}


def row(side: str, steps: int, **changes: Any) -> dict[str, Any]:
    own = {"device": "SL-0001", "wrist": "left"} if side == "left" else {"device": "SL-0002", "wrist": "right"}
    counts = {"steps": steps, "steps_now": steps + 1, "error": None, "accuracy_percent": None, "note": None}
    return own | {"counter": "double_threshold"} | counts | changes


def trial(number: int, **changes: Any) -> dict[str, Any]:
    """A Trial as the API gives it: walked now, by both wrists, with `changes`."""
    return {
        "number": number, "name": "normal walk", "state": "walking", "began_at": AT, "ended_at": None,
        "true_steps": None, "rows": [row("left", 128), row("right", 131)], "mean": None,
    } | changes  # fmt: skip


def done(number: int, **changes: Any) -> dict[str, Any]:
    rows = [
        row("left", 128, error=-2, accuracy_percent=98.4615),
        row("right", 131, error=1, accuracy_percent=99.2308, note="the device was lost for 3.2 s"),
    ]
    return trial(number, state="done", true_steps=130, rows=rows) | changes


def listing(*items: dict[str, Any]) -> dict[str, Any]:
    return {"items": list(items), "next": None}


def opened(server: ScriptedServer, *items: dict[str, Any]) -> tuple[Page, Locator]:
    """The page and the panel, opened, with these trials on the server; one that runs opens it by itself."""
    server.api[f"GET {PATH}"] = listing(*items)
    page = server.open()
    panel = page.locator("#trials")
    expect(panel).to_be_visible()
    if all(item["state"] == "done" for item in items):
        panel.locator("summary").click()
    expect(panel).to_have_attribute("open", "")
    return page, panel


def test_one_bracelet_alone_has_nothing_to_compare(scripted: Scripted) -> None:
    page = scripted(device()).open()
    expect(page.locator(".card")).to_have_count(1)
    expect(page.locator("#trials")).to_be_hidden()


def test_a_trial_is_begun_with_two_devices_wrists_and_an_item(scripted: Scripted) -> None:
    server = scripted(device(), device(**RIGHT))
    server.api[f"POST {PATH}"] = (201, trial(1))
    _, panel = opened(server)
    panel.get_by_label("First bracelet").select_option("SL-0002")
    panel.get_by_label("Second bracelet").select_option("SL-0001")
    expect(panel.get_by_label("Wrist").first).to_have_value("right")
    expect(panel.get_by_label("Wrist").last).to_have_value("left")
    panel.get_by_label("Wrist").first.select_option("left")
    panel.get_by_label("Wrist").last.select_option("right")
    panel.get_by_label("Test item").fill("fast walk")
    server.api[f"GET {PATH}"] = listing(trial(1, name="fast walk"))
    panel.get_by_role("button", name="Start the trial").click()
    run = panel.get_by_role("region", name="Running trial")
    expect(run.locator(".versus strong")).to_have_text(["129", "132"])
    expect(run).to_contain_text("Left wrist, left")
    expect(panel.get_by_role("button", name="Start the trial")).to_be_hidden()
    body = {"devices": ["SL-0002", "SL-0001"], "wrists": {"SL-0002": "left", "SL-0001": "right"}, "name": "fast walk"}
    assert server.asked == [(f"POST {PATH}", body)]


def test_both_counts_live_beside_each_other_until_it_is_finished(scripted: Scripted) -> None:
    server = scripted(device(), device(**RIGHT))
    server.api[f"POST {PATH}/1/finish"] = trial(1, state="settling")
    _, panel = opened(server, trial(1))
    run = panel.get_by_role("region", name="Running trial")
    expect(run.locator(".versus strong")).to_have_text(["129", "132"])
    rows = [row("left", 140), row("right", 141, note="the device was lost for 2 s")]
    server.api[f"GET {PATH}"] = listing(trial(1, rows=rows))
    expect(run.locator(".versus strong")).to_have_text(["141", "142"])
    expect(run).to_contain_text("the device was lost for 2 s")
    truth = run.get_by_label("True steps")
    truth.fill("-3")
    server.api[f"POST {PATH}/1/finish"] = (422, {"detail": "true_steps = -3: from 0 to 100000 steps"})
    run.get_by_role("button", name="Finish").click()
    expect(truth).to_have_attribute("aria-invalid", "true")
    expect(truth).to_have_value("-3")
    server.api[f"POST {PATH}/1/finish"] = trial(1, state="settling")
    truth.fill("1,140")
    server.api[f"GET {PATH}"] = listing(trial(1, state="settling"))
    run.get_by_role("button", name="Finish").click()
    expect(run.get_by_role("status")).to_have_text("Deciding the last steps…")
    assert [body for _, body in server.asked] == [{"true_steps": -3}, {"true_steps": 1140}]
    server.errors.clear()
    server.api[f"GET {PATH}"] = listing(done(1))
    expect(panel.get_by_role("table")).to_be_visible()
    expect(run).to_have_count(0)


def test_finished_trials_stand_in_the_papers_columns_with_means(scripted: Scripted) -> None:
    _, panel = opened(
        scripted(device(), device(**RIGHT)), done(1), done(2, name="run", true_steps=None, rows=[row("left", 9)])
    )
    heads = panel.get_by_role("columnheader").all_inner_texts()
    assert heads[:8] == ["Device", "Wrist", "Counter", "Test item", "True steps", "Counted", "Error", "Accuracy"]
    second = panel.get_by_role("row", name="Right wrist").first.get_by_role("cell").all_inner_texts()
    assert [text.replace("\u00a0", " ") for text in second[:8]] == [
        "Right wrist", "right", "double threshold", "normal walk", "130", "131", "+1", "99.23 %",
    ]  # fmt: skip
    expect(panel).to_contain_text("the device was lost for 3.2 s")
    expect(panel.locator(".means li").last).to_have_text("All rows98.85\u00a0%2 rows")
    expect(panel.get_by_role("link", name="Download as CSV")).to_have_attribute("href", f"{PATH}/table.csv")


def test_true_steps_may_come_later_and_a_refusal_is_told(scripted: Scripted) -> None:
    server = scripted(device(), device(**RIGHT))
    server.api[f"PATCH {PATH}/1"] = (422, {"detail": "true_steps: a whole number from 0 to 100000"})
    page, panel = opened(server, done(1, true_steps=None))
    field = panel.get_by_label("True steps of normal walk")
    field.fill("many")
    page.keyboard.press("Enter")
    expect(panel.get_by_role("alert")).to_have_text("true_steps: a whole number from 0 to 100000")
    server.api[f"GET {PATH}"] = listing(done(1, true_steps=None), done(2, name="run", rows=[row("left", 9)]))
    expect(panel.get_by_label("True steps of run")).to_be_visible(timeout=10_000)
    expect(field).to_have_value("many")
    expect(field).to_have_attribute("aria-invalid", "true")
    server.api[f"PATCH {PATH}/1"] = done(1)
    server.api[f"GET {PATH}"] = listing(done(1))
    field.fill("130")
    expect(field).not_to_have_attribute("aria-invalid", "true")
    page.keyboard.press("Enter")
    expect(panel.get_by_role("cell", name="98.46")).to_be_visible()
    expect(panel.get_by_role("alert")).to_be_hidden()
    assert [body for _, body in server.asked] == [{"true_steps": "many"}, {"true_steps": 130}]
    server.errors.clear()


def test_what_is_being_typed_is_not_taken_away_by_an_answer(scripted: Scripted) -> None:
    server = scripted(device(), device(**RIGHT))
    _, panel = opened(server, done(1, true_steps=None), trial(2))
    field = panel.get_by_label("True steps of normal walk")
    field.press_sequentially("13")
    server.api[f"GET {PATH}"] = listing(
        done(1, true_steps=None, name="changed"), trial(2, rows=[row("left", 7), row("right", 8)])
    )
    expect(panel.locator(".versus strong")).to_have_text(["8", "9"])
    expect(field).to_have_value("13")
    expect(field).to_be_focused()


def test_deleting_a_trial_takes_two_presses(scripted: Scripted) -> None:
    server = scripted(device(), device(**RIGHT))
    server.api[f"DELETE {PATH}/1"] = (204, None)
    _, panel = opened(server, done(1))
    panel.get_by_role("button", name="Delete normal walk").click()
    assert server.asked == []
    server.api[f"GET {PATH}"] = listing()
    panel.get_by_role("button", name="Press again to delete normal walk").click()
    expect(panel.get_by_role("table")).to_be_hidden()
    assert server.asked == [(f"DELETE {PATH}/1", None)]


@pytest.mark.parametrize("width", [320, 390])
def test_on_a_narrow_screen_a_finished_trials_wrists_stand_side_by_side(scripted: Scripted, width: int) -> None:
    server = scripted(device(), device(**RIGHT), viewport={"width": width, "height": 800})
    _, panel = opened(server, done(1), done(2, name="run"))
    expect(panel.locator("tbody")).to_have_count(2)
    for key in ("device", "steps", "accuracy"):
        boxes = [cell.bounding_box() for cell in panel.locator(f"td[data-key={key}]").all()]
        first, second, below, _ = [box for box in boxes if box]
        assert first["y"] == second["y"] < below["y"]
        assert first["x"] + first["width"] <= second["x"]
    note = panel.get_by_role("cell", name="the device was lost").first.bounding_box()
    right = panel.locator("td[data-key=device]").nth(1).bounding_box()
    assert note is not None
    assert right is not None
    assert note["x"] == right["x"]


@pytest.mark.parametrize("width", [320, 390, 800, 1440])
def test_the_panel_fits_and_its_targets_are_large_enough(scripted: Scripted, width: int) -> None:
    server = scripted(device(), device(**RIGHT), viewport={"width": width, "height": 800})
    page, panel = opened(server, done(1), trial(2))
    expect(panel.locator(".run")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    heights = panel.locator("button, select, summary, input, a").evaluate_all(
        "nodes => nodes.map((node) => node.getBoundingClientRect().height).filter((height) => height > 0)"
    )
    assert len(heights) >= 6
    assert min(heights) >= 44
