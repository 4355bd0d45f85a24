"""The page's panels on the real service: counters chosen, a walk calibrated, two wrists compared."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from browser.commands import running
from browser.test_demo import URL, count, free_port, page, wait_for_steps
from playwright.sync_api import Page, expect

pytestmark = pytest.mark.full

__all__ = ["page"]


@contextmanager
def two_wrists() -> Iterator[str]:
    """Two bracelets and the service in three processes; yields the page's address."""
    air = f"127.0.0.1:{free_port()}"
    left = ("sim", "--air", air, "--id", "left-1", "--name", "Left", "--walk", "normal:600", "--seed", "3")
    right = ("sim", "--air", air, "--id", "right-1", "--name", "Right", "--walk", "normal:600", "--seed", "4")
    with (
        running(*left, says="on the air"),
        running(*right, says="on the air"),
        running("serve", "--air", air, "--port", "0", says=URL) as (_, url),
    ):
        yield url


def test_counters_run_side_by_side_and_another_primary_goes_on_with_the_count(page: Page) -> None:
    with running("demo", "--port", "0", "--walk", "normal:600", says=URL) as (_, url):
        page.goto(url)
        wait_for_steps(page, 3)
        page.get_by_role("button", name="Counters of").click()
        dialog = page.get_by_role("dialog")
        dialog.get_by_role("checkbox", name="plus minus").check()
        dialog.get_by_role("radio", name="primary : adaptive peak").check()
        dialog.get_by_role("button", name="Apply").click()
        expect(dialog).to_be_hidden()
        expect(page.locator(".lane")).to_have_count(4)
        before = count(page)
        assert before >= 3
        wait_for_steps(page, before + 3)
        (device,) = page.request.get(f"{url}api/v1/devices").json()["items"]
        assert device["primary"] == "adaptive_peak"
        expect(page.locator(".lane").first).to_have_text(re.compile(r"adaptive peakprimary\d+"))
        expect(page.locator(".lane[data-counter=plus_minus] b")).not_to_have_text("0")


def test_a_parameter_out_of_range_is_refused_by_the_services_own_sentence(page: Page) -> None:
    with running("demo", "--port", "0", says=URL) as (_, url):
        page.goto(url)
        page.get_by_role("button", name="Counters of").click()
        choice = page.locator(".choice[data-counter=double_threshold]")
        choice.locator("summary").click()
        bout = choice.locator(".param", has=page.locator("code:text-is('bout')")).get_by_role("textbox")
        bout.fill("99")
        page.get_by_role("button", name="Apply").click()
        expect(page.get_by_role("dialog").get_by_role("alert")).to_contain_text("from 2 to 12 peaks")
        expect(bout).to_be_focused()


def test_a_walk_is_calibrated_and_two_wrists_are_compared(page: Page) -> None:
    with two_wrists() as url:
        page.goto(url)
        expect(page.locator(".card[data-state=streaming]")).to_have_count(2, timeout=20_000)
        page.get_by_role("button", name="Calibrate Left").click()
        panel = page.get_by_role("region", name="Calibrations", exact=True)
        panel.get_by_label("How many").fill("10")
        panel.get_by_role("button", name="Start").click()
        expect(panel.get_by_role("progressbar")).to_be_visible()
        expect(panel.get_by_role("status")).to_have_text("Sampling walk, normal: done.", timeout=30_000)
        panel.get_by_role("button", name="Apply to double threshold").click()
        expect(panel.get_by_role("status")).to_contain_text("now uses what was learnt")
        lineup = page.request.get(f"{url}api/v1/devices/left-1/counters").json()["counters"]
        taught = next(one for one in lineup if one["name"] == "double_threshold")
        assert taught["params"]["window_mode"] == "fixed"

        trials = page.locator("#trials")
        trials.locator("summary").click()
        trials.get_by_label("Test item").fill("normal walk")
        trials.get_by_role("button", name="Start the trial").click()
        counts = trials.locator(".versus strong")
        for side in (counts.first, counts.last):
            expect(side).to_have_text(re.compile(r"^([4-9]|\d\d)$"), timeout=20_000)
        trials.get_by_role("button", name="Finish").click()
        field = trials.get_by_label("True steps of normal walk")
        expect(field).to_be_visible(timeout=20_000)
        field.fill("10")
        field.press("Enter")
        expect(trials.locator(".means li")).to_have_count(3)
        table = page.request.get(f"{url}api/v1/trials/table.csv").text()
        assert "left-1" in table
        assert "normal walk" in table
