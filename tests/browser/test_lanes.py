"""The lanes below the plot: a counter each, marks at its steps, and what is likely."""

from typing import Any

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, ORIGIN, ScriptedServer, device, signal, step
from browser.test_plot import clusters, columns, feed, second_px
from playwright.sync_api import Page, expect

from service.counters import registry

pytestmark = pytest.mark.full

NAMES = list(registry.COUNTERS)
LOOK = {"double_threshold": "step", "adaptive_peak": "mark-amber", "autocorrelation": "mark-sky"}
INK = """([counter, name]) => {
  const canvas = document.querySelector(`.lane[data-counter=${counter}] canvas`);
  const probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = getComputedStyle(canvas).getPropertyValue("--" + name);
  probe.fillRect(0, 0, 1, 1);
  const want = probe.getImageData(0, 0, 1, 1).data;
  const { width, height } = canvas;
  const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
  const columns = new Array(width).fill(0);
  for (let i = 0; i < data.length; i += 4) {
    const near = [0, 1, 2].every((c) => Math.abs(data[i + c] - want[c]) < 24) && data[i + 3] > 150;
    if (near) columns[(i / 4) % width] += 1;
  }
  return columns;
}"""


def ink(page: Page, counter: str) -> list[int]:
    """How many pixels of the counter's colour each column of its lane has."""
    counts: list[int] = page.evaluate(INK, [counter, LOOK[counter]])
    return counts


def standing(scripted: Scripted, *names: str, **changes: Any) -> tuple[ScriptedServer, Page]:
    """A page whose clock stands, with one device that these counters run on, the first as its primary."""
    changes = {"primary": names[0], "counters": dict.fromkeys(names, 40)} | changes
    server = scripted(device(**changes), viewport={"width": 1440, "height": 900})
    server.page.clock.install(time=0)
    server.page.clock.pause_at(1_000)
    server.page.goto(ORIGIN)
    for _ in range(50):
        server.page.clock.run_for(20)
        if server.page.locator(".lane").count() == len(names):
            return server, server.page
    raise AssertionError("no lanes")


def tentative(device_s: float, status: str = "likely") -> dict[str, Any]:
    return {
        "type": "tentative", "device": "SL-0001", "at": AT, "status": status, "device_s": device_s, "boot": 1,
        "at_uncertainty_s": 0.01, "strength": 0.6, "interval_s": 0.5,
    }  # fmt: skip


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
@pytest.mark.parametrize("count", range(1, 8))
def test_each_counter_has_its_lane_with_name_and_count(scripted: Scripted, count: int, size: tuple[int, int]) -> None:
    counters = {name: 40 + i for i, name in enumerate(NAMES[:count])}
    viewport = {"width": size[0], "height": size[1]}
    page = scripted(device(primary=NAMES[count - 1], counters=counters), viewport=viewport).open()
    lanes = page.locator(".lane")
    expect(lanes).to_have_count(count)
    assert lanes.first.inner_text().split() == [*NAMES[count - 1].split("_"), "primary", str(39 + count)]
    for name, steps in counters.items():
        expect(page.locator(f".lane[data-counter={name}] b")).to_have_text(str(steps))
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    box = page.locator("[data-f=canvas]").bounding_box()
    assert box is not None
    assert box["height"] >= 200


def test_marks_of_several_counters_lie_side_by_side_at_their_own_times(scripted: Scripted) -> None:
    server, page = standing(scripted, "double_threshold", "adaptive_peak", "autocorrelation")
    own = {"double_threshold": (3.125, 4.125, 5.125), "adaptive_peak": (3.125, 5.125), "autocorrelation": (4.625,)}
    steps = [(name, at) for name, times in own.items() for at in times]
    feed(server, signal(0, 10), *[step(i, at, 41, counter=name) for i, (name, at) in enumerate(steps)])
    lanes = {name: clusters(ink(page, name)) for name in own}
    assert {name: len(found) for name, found in lanes.items()} == {name: len(times) for name, times in own.items()}
    first = lanes["double_threshold"][0]
    for name, times in own.items():
        assert [first + (at - 3.125) * second_px(page) for at in times] == pytest.approx(lanes[name], abs=2)
    assert clusters(columns(page, "step")) == pytest.approx(lanes["double_threshold"], abs=2)


def test_another_counters_step_is_not_marked_on_the_signal(scripted: Scripted) -> None:
    server, page = standing(scripted, "double_threshold", "adaptive_peak")
    feed(server, signal(0, 10), step(1, 5.125, 41, counter="adaptive_peak"))
    assert len(clusters(ink(page, "adaptive_peak"))) == 1
    assert clusters(columns(page, "mark-amber")) == clusters(columns(page, "step")) == []


def test_another_primary_marks_the_signal_in_its_own_look_and_the_old_marks_stay(scripted: Scripted) -> None:
    server, page = standing(scripted, "double_threshold", "adaptive_peak")
    segment = {"type": "segment", "device": "SL-0001", "ordinal": 2, "at": AT, "primary": "adaptive_peak", "steps": 41}
    feed(server, signal(0, 10), step(1, 4.125, 41), segment, step(3, 6.125, 42, counter="adaptive_peak"))
    assert len(clusters(columns(page, "step"))) == len(clusters(columns(page, "mark-amber"))) == 1
    assert page.locator(".lane").first.get_attribute("data-counter") == "adaptive_peak"


def test_the_axis_says_what_the_primarys_signal_is(scripted: Scripted) -> None:
    for primary, said in (
        ("fusion", "Filtered acceleration, g"),
        ("gyro_zero_crossing", "Filtered turning rate, rad/s"),
    ):
        page = scripted(device(primary=primary, counters={primary: 1})).open()
        expect(page.locator("[data-f=axis]")).to_have_text(said)


def test_a_counter_that_cannot_count_says_why_instead_of_marks(scripted: Scripted) -> None:
    why = "gyro_zero_crossing needs a gyroscope, and the device sends none"
    faults = {"gyro_zero_crossing": why}
    _, page = standing(scripted, "double_threshold", "gyro_zero_crossing", counter_faults=faults)
    lane = page.locator(".lane[data-counter=gyro_zero_crossing]")
    expect(lane).to_contain_text(why)
    expect(lane.locator("canvas")).to_be_hidden()
    expect(lane.locator("b")).to_have_text("")
    expect(page.locator(".lane[data-counter=double_threshold] canvas")).to_be_visible()


def keys(page: Page) -> list[str]:
    return [" ".join(text.split()) for text in page.locator(".key:visible").all_inner_texts()]


def test_the_key_explains_what_the_plot_carries_and_nothing_else(scripted: Scripted) -> None:
    server, page = standing(scripted, "fusion")
    assert keys(page) == []
    feed(server, signal(0, 10, bands=[]))
    assert keys(page) == ["signal", "likely counted step", "no data"]
    feed(server, signal(10, 2))
    assert keys(page) == ["signal", "upper threshold", "lower threshold", "likely counted step", "no data"]
    expect(page.get_by_role("img", name="its thresholds")).to_be_visible()


def test_a_primary_that_cannot_count_shows_dashes_and_says_why_in_sight(scripted: Scripted) -> None:
    why = "the device sends 8 Hz; at least 10 Hz are needed"
    faulted = device(steps=0, steps_now=0, counter_faults={"double_threshold": why})
    server = scripted(faulted, viewport={"width": 390, "height": 844})
    page = server.open()
    for name in ("steps-now", "steps", "cadence"):
        expect(page.locator(f".card [data-f={name}]")).to_have_text("–")
    expect(page.locator("[data-f=state]")).to_have_text("Live, not counting")
    for name in ("notice", "why"):
        expect(page.locator(f"[data-f={name}]")).to_contain_text(why)
    box = page.locator("[data-f=notice]").bounding_box()
    assert box is not None
    assert box["y"] + box["height"] <= 844
    assert keys(page) == []
    assert page.title() == "– steps · steplink"
    able = device(steps=0, steps_now=0)
    server.send({"type": "device", "device": able["id"], "at": AT, "value": able})
    expect(page.locator("[data-f=state]")).to_have_text("Live")
    expect(page.locator("[data-f=steps-now]")).to_have_text("0")
    for name in ("notice", "why"):
        expect(page.locator(f"[data-f={name}]")).to_be_hidden()


def marks(page: Page) -> list[tuple[float, int]]:
    """The primary's marks in its lane: where each is, and how many pixels of its colour it has."""
    found: list[list[tuple[int, int]]] = []
    for x, count in enumerate(ink(page, "double_threshold")):
        if count and found and x - found[-1][-1][0] < 12:
            found[-1].append((x, count))
        elif count:
            found.append([(x, count)])
    return [((run[0][0] + run[-1][0]) / 2, sum(count for _, count in run)) for run in found]


def test_a_likely_step_is_hollow_and_becomes_solid_or_vanishes(scripted: Scripted) -> None:
    server, page = standing(scripted, "double_threshold")
    feed(server, signal(0, 10), step(1, 3.125, 41), tentative(5.125), tentative(7.125))
    (at, solid), (likely_at, likely), (_, other) = marks(page)
    assert likely_at - at == pytest.approx(2 * second_px(page), abs=3)
    assert 0 < likely < solid / 2 > other > 0
    feed(server, step(2, 5.125, 42), tentative(7.125, "retracted"))
    (_, before), (_, now) = marks(page)
    assert now == pytest.approx(before, abs=0.2 * before)
