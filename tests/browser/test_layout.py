"""How the page fits and reads: widths, themes, keyboard, contrast."""

import re

import pytest
from browser.conftest import Scripted
from browser.scripted import WEB, device, state
from playwright.sync_api import expect

pytestmark = pytest.mark.full

SIZES = {"phone": (390, 844), "narrow": (320, 640), "desktop": (1440, 900)}


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.full)])
@pytest.mark.parametrize("size", list(SIZES))
def test_nothing_scrolls_sideways(scripted: Scripted, size: str, scheme: str) -> None:
    width, height = SIZES[size]
    others = [device(id=f"SL-{i}", address=f"A{i}", name="A rather long name of a bracelet " * 2) for i in range(3)]
    for devices in ([], [device(steps=1_234_567, steps_now=1_234_569)], others):
        server = scripted(*devices, viewport={"width": width, "height": height}, color_scheme=scheme)
        page = server.open()
        expect(page.locator(".card")).to_have_count(len(devices))
        if len(devices) == 1:
            server.send(state(1, "lost", "the adapter said nothing for quite some time"))
            expect(page.locator("[data-f=notice]")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("size", ["phone", "desktop"])
def test_count_and_plot_are_seen_without_scrolling(scripted: Scripted, size: str) -> None:
    width, height = SIZES[size]
    page = scripted(device(), viewport={"width": width, "height": height}).open()
    for selector in (".count", "[data-f=canvas]"):
        box = page.locator(selector).bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= height


def test_digits_have_one_width(scripted: Scripted) -> None:
    server = scripted(device(steps_now=111_111))
    page = server.open()
    widths = []
    for steps in (111_111, 888_888, 404_040):
        page.evaluate("steps => { document.querySelector('[data-f=steps-now]').textContent = steps; }", steps)
        box = page.locator("[data-f=steps-now]").bounding_box()
        widths.append(box and box["width"])
    assert len(set(widths)) == 1


def test_the_keyboard_reaches_every_control_and_focus_is_seen(scripted: Scripted) -> None:
    server = scripted(device(state="seen"))
    page = server.open()
    page.keyboard.press("Tab")
    expect(page.get_by_role("link", name="Skip to the bracelets")).to_be_focused()
    page.keyboard.press("Tab")
    button = page.get_by_role("button", name="Connect Left wrist")
    expect(button).to_be_focused()
    assert button.evaluate("node => parseFloat(getComputedStyle(node).outlineWidth)") >= 2
    page.keyboard.press("Enter")
    expect(button).to_have_attribute("aria-disabled", "false")
    assert server.posts == ["api/v1/devices/SL-0001/connect"]


def test_targets_are_large_enough_to_touch(scripted: Scripted) -> None:
    box = scripted(device()).open().get_by_role("button", name="Disconnect").bounding_box()
    assert box is not None
    assert box["height"] >= 44


def test_a_screen_reader_finds_landmarks_names_and_the_plots_description(scripted: Scripted) -> None:
    page = scripted(device()).open()
    expect(page.get_by_role("main", name="Bracelets")).to_be_visible()
    expect(page.get_by_role("article")).to_have_count(1)
    expect(page.get_by_role("heading", level=2, name="Left wrist")).to_be_visible()
    expect(page.get_by_role("img", name=re.compile("last ten seconds of Left wrist"))).to_be_visible()
    assert page.locator("html").get_attribute("lang") == "en"


def palette(css: str) -> dict[str, str]:
    return dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6});", css))


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_and_curves_stand_out(scheme: str) -> None:
    light, dark = (WEB / "style.css").read_text().split("@media (prefers-color-scheme: dark)")
    colours = palette(light) | (palette(dark) if scheme == "dark" else {})
    text = [("ink", "card"), ("ink-soft", "card"), ("ink-soft", "page"), ("ink-soft", "quiet-soft"), ("good", "card"),
            ("good", "good-soft"), ("bad", "bad-soft"), ("busy", "busy-soft"), ("accent-ink", "accent")]  # fmt: skip
    assert [pair for pair in text if contrast(colours[pair[0]], colours[pair[1]]) < 4.5] == []
    curves = ("signal", "upper", "lower", "step", *(name for name in colours if name.startswith("mark-")))
    assert len(curves) > 6
    assert [name for name in curves if contrast(colours[name], colours["card"]) < 3] == []
