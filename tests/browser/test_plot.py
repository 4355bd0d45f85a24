"""What the plot draws, told by the colours of its pixels."""

from itertools import pairwise
from typing import Any

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, ORIGIN, ScriptedServer, counting, device, signal, step
from playwright.sync_api import Page, expect

pytestmark = pytest.mark.full

LEFT, RIGHT, TOP, BOTTOM = 40, 14, 24, 26
"""The plot's margins in px, where its axes are written (PAD in plot.js)."""
HATCHED = 10
"""A column with so many pixels of the gap's colour is hatched; a veiled curve's edge has a few like it."""

COLUMNS = """([name, highest]) => {
  const [LEFT, RIGHT, TOP, BOTTOM] = [40, 14, 24, 26];
  const canvas = document.querySelector("canvas");
  const context = canvas.getContext("2d");
  const probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = getComputedStyle(canvas).getPropertyValue("--" + name);
  probe.fillRect(0, 0, 1, 1);
  const want = probe.getImageData(0, 0, 1, 1).data;
  const { width, height } = canvas;
  const { data } = context.getImageData(0, 0, width, height);
  const columns = new Array(width).fill(highest ? height : 0);
  for (let i = 0; i < data.length; i += 4) {
    const [x, y] = [(i / 4) % width, Math.floor(i / 4 / width)];
    if (x < LEFT || x > width - RIGHT || y < TOP || y >= height - BOTTOM) continue;
    const near = [0, 1, 2].every((c) => Math.abs(data[i + c] - want[c]) < 12) && data[i + 3] > 150;
    if (near) columns[x] = highest ? Math.min(columns[x], y) : columns[x] + 1;
  }
  return columns;
}"""


def columns(page: Page, colour: str) -> list[int]:
    """How many pixels of the theme's `colour` each column of the plot has."""
    counts: list[int] = page.evaluate(COLUMNS, [colour, False])
    return counts


def highest(page: Page, colour: str) -> list[int]:
    """The uppermost row of each column that has the theme's `colour`; the canvas's height where none has."""
    rows: list[int] = page.evaluate(COLUMNS, [colour, True])
    return rows


def second_px(page: Page) -> float:
    """The width of one second."""
    width: float = page.locator("[data-f=canvas]").evaluate("canvas => canvas.clientWidth")
    return (width - LEFT - RIGHT) / 10


def clusters(counts: list[int]) -> list[float]:
    """The centres of runs of columns that have at least four pixels of the colour: the discs of the marks."""
    found: list[list[int]] = []
    for x, count in enumerate(counts):
        if count < 4:
            continue
        if found and x - found[-1][-1] <= 2:
            found[-1].append(x)
        else:
            found.append([x])
    return [sum(run) / len(run) for run in found]


def still(scripted: Scripted, **options: Any) -> tuple[ScriptedServer, Page]:
    """A page whose clock stands, with one streaming device."""
    server = scripted(device(), **options)
    server.page.clock.install(time=0)
    server.page.clock.pause_at(1_000)
    server.page.goto(ORIGIN)
    for _ in range(50):
        server.page.clock.run_for(20)
        if server.page.locator(".card").count():
            return server, server.page
    raise AssertionError("no card")


def feed(server: ScriptedServer, *messages: dict[str, Any]) -> None:
    """Send `messages` and let the clock run until a count sent after them is shown: then all have arrived."""
    server.send(*messages, counting(999, 999))
    for _ in range(200):
        server.page.clock.run_for(20)
        if server.page.locator("[data-f=steps-now]").inner_text() == "999":
            break
    else:
        raise AssertionError("the count that was sent is not shown")
    server.page.clock.run_for(1_000)


def test_before_the_first_sample_nothing_is_drawn_but_axes(scripted: Scripted) -> None:
    server, page = still(scripted)
    feed(server)
    assert sum(columns(page, "signal")) == sum(columns(page, "step")) == 0
    assert sum(columns(page, "grid")) > 100


def test_a_step_before_the_first_sample_is_not_marked(scripted: Scripted) -> None:
    server, page = still(scripted)
    feed(server, signal(20, 5), step(1, 19.125, 40), step(2, 21.125, 41))
    assert len(clusters(columns(page, "step"))) == 1


def test_signal_thresholds_and_marks_are_drawn_and_the_marks_lie_on_the_steps(scripted: Scripted) -> None:
    server, page = still(scripted)
    feed(server, signal(0, 10), *[step(i, 3.125 + i, 40 + i) for i in range(5)])
    assert sum(columns(page, "signal")) > 1_000
    assert sum(columns(page, "upper")) > 100
    assert sum(columns(page, "lower")) > 50
    marks = clusters(columns(page, "step"))
    assert len(marks) == 5
    assert [b - a for a, b in pairwise(marks)] == pytest.approx([second_px(page)] * 4, abs=1.5)


def test_marks_lie_on_the_peaks_of_the_signal(scripted: Scripted) -> None:
    server, page = still(scripted)
    feed(server, signal(0, 10))
    before = highest(page, "signal")
    top = min(before)
    peaks = clusters([4 * (row <= top + 2) for row in before])
    feed(server, *[step(i, 0.125 + i / 2, 40 + i) for i in range(20)])
    later_px = second_px(page) * 1.02
    marks = clusters(columns(page, "step"))
    discs = highest(page, "step")
    for peak in (x - later_px for x in peaks if 60 + later_px < x < peaks[-1]):
        nearest = min(marks, key=lambda mark: abs(mark - peak))
        assert nearest == pytest.approx(peak, abs=5)
        assert discs[round(nearest)] == pytest.approx(top - 4, abs=3)


def test_the_signal_moves_left_as_time_goes_on(scripted: Scripted) -> None:
    server, page = still(scripted)
    feed(server, signal(0, 10), step(1, 8.125, 41))
    before = clusters(columns(page, "step"))
    page.clock.run_for(2_000)
    after = clusters(columns(page, "step"))
    assert len(before) == len(after) == 1
    assert before[0] - after[0] == pytest.approx(2 * second_px(page), abs=3)


@pytest.mark.parametrize("told", [True, False])
def test_a_gap_is_hatched_and_carries_no_signal(scripted: Scripted, told: bool) -> None:
    server, page = still(scripted)
    gap = {"from_s": 4, "to_s": 6, "samples": 100, "filled": False}
    note = {"type": "gap", "device": "SL-0001", "ordinal": 1, "at": AT} | gap
    feed(server, signal(0, 4), *([note] if told else []), signal(6, 4))
    hatched = [x for x, count in enumerate(columns(page, "gap")) if count >= HATCHED]
    waves = columns(page, "signal")
    assert hatched[-1] - hatched[0] == pytest.approx(2 * second_px(page), abs=4)
    assert sum(waves[hatched[0] + 3 : hatched[-1] - 3]) == 0
    assert sum(waves[: hatched[0]]) > 300 < sum(waves[hatched[-1] :])


def test_a_filled_gap_is_no_gap(scripted: Scripted) -> None:
    server, page = still(scripted)
    gap = {"from_s": 4, "to_s": 4.4, "samples": 20, "filled": True}
    feed(server, signal(0, 10), {"type": "gap", "device": "SL-0001", "ordinal": 1, "at": AT} | gap)
    assert sum(columns(page, "signal")) > 1_000
    assert max(columns(page, "gap")) < HATCHED


def test_the_plot_is_sharp_on_a_dense_screen(scripted: Scripted) -> None:
    server, page = still(scripted, device_scale_factor=3, viewport={"width": 390, "height": 844})
    feed(server)
    sizes = page.locator("[data-f=canvas]").evaluate("c => [c.width / c.clientWidth, c.height / c.clientHeight]")
    assert sizes == pytest.approx([3, 3], rel=0.01)


def test_colours_follow_the_theme_while_the_page_is_open(scripted: Scripted) -> None:
    server, page = still(scripted, color_scheme="light")
    feed(server, signal(0, 10))
    page.emulate_media(color_scheme="dark")
    expect(page.locator("body")).to_have_css("background-color", "rgb(13, 20, 27)")
    page.clock.run_for(1_000)
    assert sum(columns(page, "signal")) > 1_000


def test_with_reduced_motion_the_plot_stands_still_within_a_second(scripted: Scripted) -> None:
    shots = {}
    for motion in ("reduce", "no-preference"):
        server, page = still(scripted, reduced_motion=motion)
        feed(server, signal(0, 10))
        pictures = set()
        for _ in range(20):
            page.clock.run_for(100)
            pictures.add(page.evaluate("document.querySelector('canvas').toDataURL()"))
        shots[motion] = len(pictures)
    assert shots["reduce"] <= 3
    assert shots["no-preference"] == 20
