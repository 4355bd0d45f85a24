"""The page on the real service: steps appear as they happen, and what is lost comes back."""

from collections.abc import Iterator

import pytest
from browser.commands import running
from browser.test_page import field
from browser.test_plot import clusters, columns
from playwright.sync_api import Browser, Page, expect
from processes import free_port

URL = r"http://\S+/"
PICTURE = "document.querySelector('canvas').toDataURL()"


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    yield page
    page.close()


def count(page: Page) -> int:
    return int(field(page, "steps").inner_text().replace(",", ""))


def wait_for_steps(page: Page, steps: int) -> None:
    """Wait until at least `steps` are confirmed on the page."""
    page.wait_for_function(
        "steps => Number(document.querySelector('[data-f=steps]')?.textContent.replace(',', '') ?? 0) >= steps",
        arg=steps,
        timeout=40_000,
    )


@pytest.mark.parametrize(
    ("counter", "colour"), [("steplink", "mark-rose"), pytest.param("double_threshold", "step", marks=pytest.mark.full)]
)
def test_steps_appear_as_they_happen(page: Page, counter: str, colour: str) -> None:
    errors: list[str] = []
    page.on("console", lambda message: errors.extend([message.text] * (message.type == "error")))
    page.on("pageerror", lambda error: errors.append(str(error)))
    with running("demo", "--port", "0", "--counter", counter, says=URL) as (_, url):
        page.goto(url)
        expect(field(page, "state")).to_have_text("Live", timeout=20_000)
        wait_for_steps(page, 3)
        before = page.evaluate(PICTURE)
        wait_for_steps(page, 8)
        assert page.evaluate(PICTURE) != before
        assert len(clusters(columns(page, colour))) >= 5
        assert sum(columns(page, "signal")) > 500
        assert (sum(columns(page, "upper")) > 50) is (counter == "double_threshold"), "steplink has no thresholds"
        shown = count(page)
        (device,) = page.request.get(f"{url}api/v1/devices").json()["items"]
        assert shown <= device["steps"] <= shown + 3
        assert field(page, "name").inner_text() == device["name"]
        assert int(field(page, "packets").inner_text()) >= 10
    assert errors == []


@pytest.mark.full
def test_a_lost_bracelet_is_shown_as_lost_and_comes_back_by_itself(page: Page) -> None:
    air = f"127.0.0.1:{free_port()}"
    sim = running("sim", "--air", air, says="on the air")
    serve = running("serve", "--air", air, "--port", "0", says=URL)
    with sim as (first, _), serve as (_, url):
        page.goto(url)
        wait_for_steps(page, 5)
        first.kill()
        expect(field(page, "state")).to_have_text("Lost", timeout=20_000)
        expect(field(page, "notice")).to_contain_text("Contact lost at")
        before = count(page)
        with running("sim", "--air", air, says="on the air"):
            expect(field(page, "state")).to_have_text("Live", timeout=60_000)
            expect(field(page, "notice")).to_be_hidden()
            wait_for_steps(page, before + 3)
            expect(page.locator(".card")).to_have_count(1)


@pytest.mark.full
def test_a_restarted_service_is_found_again(page: Page) -> None:
    port = str(free_port())
    with running("demo", "--port", port, says=URL) as (_, url):
        page.goto(url)
        wait_for_steps(page, 3)
    expect(page.get_by_role("alert")).to_contain_text("was lost at", timeout=20_000)
    with running("demo", "--port", port, says=URL):
        expect(page.get_by_role("alert")).to_be_hidden(timeout=40_000)
        wait_for_steps(page, 10)  # by then more is drawn than the veil over the last seconds covers
        assert sum(columns(page, "signal")) > 100


@pytest.mark.full
def test_disconnect_and_connect_by_the_button(page: Page) -> None:
    with running("demo", "--port", "0", says=URL) as (_, url):
        page.goto(url)
        wait_for_steps(page, 3)
        page.get_by_role("button", name="Disconnect").click()
        expect(field(page, "state")).to_have_text("Disconnected", timeout=20_000)
        before = count(page)
        page.get_by_role("button", name="Connect", exact=False).click()
        expect(field(page, "state")).to_have_text("Live", timeout=40_000)
        wait_for_steps(page, before + 3)
