"""The page's connection to the server: lost, made again, and told. Time is the browser's fake clock."""

import pytest
from browser.conftest import Scripted
from browser.scripted import ORIGIN, counting, device
from browser.test_page import field
from playwright.sync_api import Page, expect

pytestmark = pytest.mark.full

LONGEST_WAIT_MS = 15_000


def until_shown(page: Page, selector: str, text: str) -> None:
    """Let the fake clock run frame by frame until `selector` shows `text`."""
    for _ in range(100):
        page.clock.run_for(20)
        if text in page.locator(selector).inner_text():
            return
    raise AssertionError(page.locator(selector).inner_text())


def test_a_lost_server_is_told_and_comes_back_with_a_fresh_snapshot(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.open()
    server.devices = [device(steps=60, steps_now=61)]
    server.refusing = True
    server.close()
    expect(page.get_by_role("alert")).to_contain_text("The connection to the server was lost at")
    expect(field(page, "state")).to_have_text("Not up to date")
    server.refusing = False
    page.get_by_role("button", name="Try now").click()
    expect(page.get_by_role("alert")).to_be_hidden()
    expect(field(page, "steps-now")).to_have_text("61")
    expect(field(page, "state")).to_have_text("Live")


@pytest.mark.parametrize("told", ["message", "close code"])
def test_a_client_that_was_too_slow_subscribes_again(scripted: Scripted, told: str) -> None:
    server = scripted(device())
    page = server.open()
    server.devices = [device(steps_now=70)]
    if told == "message":
        server.send({"type": "lagging", "detail": "slow"})
    else:
        server.close(4408)
    expect(field(page, "steps-now")).to_have_text("70")
    assert server.connections == 2


def test_attempts_grow_rarer_and_never_end(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.page
    page.clock.install(time=0)
    page.clock.pause_at(1_000)
    page.goto(ORIGIN)
    until_shown(page, "#server", "Server connected")
    server.refusing = True
    server.close()
    until_shown(page, "#server", "Server not reached")
    attempts = []
    for _ in range(6):
        before = server.connections
        for _ in range(20):
            page.clock.fast_forward(1_000)
        attempts.append(server.connections - before)
    assert attempts[0] >= 4
    assert all(1 <= few <= 3 for few in attempts[2:])
    server.refusing = False
    page.clock.run_for(LONGEST_WAIT_MS)
    until_shown(page, "#server", "Server connected")


def test_a_device_that_is_gone_from_the_new_snapshot_is_gone_from_the_page(scripted: Scripted) -> None:
    server = scripted(device(), device(id="SL-0002", address="C0:FF:EE:00:00:02"))
    page = server.open()
    expect(page.locator(".card")).to_have_count(2)
    server.devices = [device(id="SL-0002", address="C0:FF:EE:00:00:02")]
    server.close()
    expect(page.locator(".card")).to_have_count(1)
    expect(field(page, "model")).to_contain_text("SL-0002")


def test_counts_are_announced_at_a_limited_rate(scripted: Scripted) -> None:
    server = scripted(device(steps_now=42))
    page = server.page
    page.clock.install(time=0)
    page.clock.pause_at(1_000)
    page.goto(ORIGIN)
    until_shown(page, "#server", "Server connected")
    page.evaluate("""() => {
      window.heard = [];
      const live = document.getElementById("announce");
      new MutationObserver(() => window.heard.push(live.textContent)).observe(live, { childList: true });
    }""")
    for steps in range(43, 73):
        server.send(counting(steps, steps))
        until_shown(page, ".card [data-f=steps-now]", str(steps))
        page.clock.run_for(1_000)
    heard = page.evaluate("window.heard")
    assert 2 <= len(heard) <= 5
    assert all(text.startswith("Left wrist: ") and text.endswith(" steps") for text in heard)
