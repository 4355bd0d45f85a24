"""The page's modules by themselves: the trace, the plot's geometry, waiting, words."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
from browser.scripted import ScriptedServer
from hypothesis import given, settings
from hypothesis import strategies as st
from playwright.sync_api import Browser

Run = Callable[..., Any]

IMPORTS = """
const { Trace } = await import("/web/trace.js");
const { ticks } = await import("/web/axis.js");
const { holes } = await import("/web/plot.js");
const { waitMs } = await import("/web/feed.js");
const { Poll } = await import("/web/poll.js");
const { deviation, duration, localTime, percent, uncertain, zone } = await import("/web/format.js");
"""
FEED = """
const trace = new Trace();
for (const [from_s, values, ms] of a) trace.addSignal({ from_s, rate_hz: 50, values }, ms);
"""


@pytest.fixture(scope="module")
def run(browser: Browser) -> Iterator[Run]:
    """Run a function's body over its argument `a`, with the modules in scope."""
    page = browser.new_page(timezone_id="America/New_York")
    ScriptedServer(page).open()
    yield lambda body, a=None: page.evaluate(f"async (a) => {{ {IMPORTS} {body} }}", a)
    page.close()


@given(cuts=st.sets(st.integers(1, 199)), first=st.integers(0, 100_000))
@settings(max_examples=30, deadline=None)
def test_a_trace_is_the_same_however_the_signal_is_cut(run: Run, cuts: set[int], first: int) -> None:
    values = [float(i) for i in range(200)]
    edges = [0, *sorted(cuts), 200]
    parts = [[(first + i) / 50, values[i:j], 20.0 * j] for i, j in pairwise(edges)]
    got = run(FEED + f"return Array.from({{length: 202}}, (_, i) => trace.valueAt(({first} - 1 + i) / 50));", parts)
    assert got == [None, *values, None]


@given(kept=st.lists(st.booleans(), min_size=3, max_size=30))
@settings(max_examples=30, deadline=None)
def test_missing_messages_are_holes_and_nothing_else_is(run: Run, kept: list[bool]) -> None:
    kept = [True, *kept, True]
    parts = [[i * 0.2, [1.0] * 10, 200.0 * (i + 1)] for i, keep in enumerate(kept) if keep]
    got = run(FEED + f"return holes(trace, 0, {len(kept) * 0.2 - 0.02});", parts)
    covered = {k for a, b in got for k in range(round(a * 50) + 1, round(b * 50))}
    assert covered == {k for i, keep in enumerate(kept) if not keep for k in range(10 * i, 10 * i + 10)}


def test_a_hole_that_reaches_the_edge_counts_once_it_is_a_second_long(run: Run) -> None:
    ends = run(FEED + "return [1.5, 1.9, 2.5].map((s) => holes(trace, 0, s).length);", [[0, [1.0] * 50, 1000]])
    assert ends == [0, 0, 1]


@given(late_ms=st.lists(st.floats(0, 300), min_size=5, max_size=40))
@settings(max_examples=30, deadline=None)
def test_uneven_arrival_never_moves_the_picture_backwards(run: Run, late_ms: list[float]) -> None:
    parts = [[i * 0.1, [1.0] * 5, 100.0 * (i + 1) + late] for i, late in enumerate(late_ms)]
    body = """
    const trace = new Trace(); const edges = []; let next = 0;
    for (let ms = 0; ms < 5000; ms += 16) {
      for (; next < a.length && a[next][2] <= ms; next += 1) {
        trace.addSignal({ from_s: a[next][0], rate_hz: 50, values: a[next][1] }, ms);
      }
      const edge = trace.edge(ms);
      if (edge !== null) edges.push(edge);
    }
    return edges;"""
    edges = run(body, sorted(parts, key=lambda part: part[2]))
    assert all(0 <= later - earlier < 0.1 for earlier, later in pairwise(edges))


def test_the_edge_lies_behind_the_newest_sample_by_the_fixed_delay(run: Run) -> None:
    assert run(FEED + "return trace.edge(2000);", [[10, [1.0] * 50, 1000], [11, [1.0] * 50, 2000]]) == pytest.approx(
        11.6, abs=0.011
    )


def test_device_time_that_starts_again_clears_the_trace(run: Run) -> None:
    parts = [[100, [1.0] * 50, 1000], [0, [2.0] * 50, 2000]]
    assert run(FEED + "return [trace.valueAt(100.5), trace.valueAt(0.5), trace.beginS];", parts) == [None, 2, 0]


def test_a_step_sent_twice_is_marked_once_and_an_unknown_peak_lies_on_the_signal(run: Run) -> None:
    body = (
        FEED
        + """
    const step = { ordinal: 7, device_s: 0.5, peak: null };
    trace.addStep(step, 0); trace.addStep(step, 0);
    return trace.steps.map(({ atS, peak }) => [atS, peak]);"""
    )
    assert run(body, [[0, [1.25] * 50, 1000]]) == [[0.5, 1.25]]


def test_what_left_the_window_long_ago_is_forgotten(run: Run) -> None:
    body = """
    const trace = new Trace();
    for (let s = 0; s < 600; s += 1) {
      trace.addSignal({ from_s: s, rate_hz: 50, values: Array(50).fill(1),
        bands: [{ from_s: s, to_s: s + 1, upper: 1, lower: 0 }] }, s * 1000);
      trace.addStep({ ordinal: s, device_s: s, peak: 1 }, 0);
      trace.addGap({ from_s: s, to_s: s + 1, filled: false });
    }
    return [trace.bands, trace.steps, trace.gaps].map((list) => list.length);"""
    assert all(10 < kept < 40 for kept in run(body))


@given(low=st.floats(-20, 20), span=st.floats(0.6, 40))
@settings(max_examples=60, deadline=None)
def test_ticks_are_few_round_and_inside(run: Run, low: float, span: float) -> None:
    ticks = run("return ticks(a[0], a[1]);", [low, low + span])
    assert 1 <= len(ticks) <= 6
    assert all(low - 1e-6 <= tick <= low + span + 1e-6 for tick in ticks)
    assert all(abs(tick * 10 - round(tick * 10)) < 1e-6 for tick in ticks)


@given(attempt=st.integers(0, 10_000), random=st.floats(0, 1, exclude_max=True))
@settings(max_examples=60, deadline=None)
def test_waits_double_up_to_a_limit_with_jitter(run: Run, attempt: int, random: float) -> None:
    full = min(15_000, 500 * 2 ** min(attempt, 10))
    assert full / 2 <= run("return waitMs(a[0], a[1]);", [attempt, random]) <= full


def test_times_are_local_with_their_zone_and_a_date_where_it_is_not_today(run: Run) -> None:
    body = "return [a[0], a[1]].map((day) => localTime('2026-07-01T12:03:12Z', new Date(day)));"
    today, later = run(body, ["2026-07-01T20:00:00Z", "2026-07-03T20:00:00Z"])
    assert today.startswith("08:03:12 ")
    assert today.endswith(("GMT-4", "EDT"))
    assert later.startswith("1 Jul")
    assert run("return zone(new Date('2026-07-01T12:00:00Z'));") == "America/New_York (GMT-4)"


def test_durations_and_shares_in_words(run: Run) -> None:
    words = run(
        "return [...[-3, 0, 59.9, 60, 3599, 7500].map(duration), percent(0, 0), percent(1, 99), percent(1, 1)];"
    )
    assert [word.replace("\u00a0", " ") for word in words] == [
        "0 s", "0 s", "59 s", "1 min", "59 min", "2 h 5 min", "–", "1.0 %", "50 %",
    ]  # fmt: skip


def test_a_poll_puts_one_question_at_a_time_and_ends(run: Run) -> None:
    body = """
    let [open, most, asked] = [0, 0, 0];
    const pause = (ms) => new Promise((done) => { setTimeout(done, ms); });
    const poll = new Poll(async () => {
      asked += 1;
      open += 1;
      most = Math.max(most, open);
      await pause(20);
      open -= 1;
      return 10_000;
    });
    poll.now();
    poll.now();
    await pause(100);
    const twice = asked;
    poll.stop();
    await pause(30);
    return [most, twice, asked];"""
    assert run(body) == [1, 2, 2]


def test_a_likely_step_goes_where_it_is_counted_or_taken_back(run: Run) -> None:
    body = """
    const { presence } = await import("/web/trace.js");
    const trace = new Trace();
    for (const s of [1, 2, 3]) trace.addTentative({ status: "likely", device_s: s }, 0, "counter");
    trace.addTentative({ status: "likely", device_s: 1.004 }, 0, "counter");
    trace.addTentative({ status: "likely", device_s: 4, passes: false }, 0, "counter");
    trace.addTentative({ status: "retracted", device_s: 2 }, 1000, "counter");
    trace.addStep({ ordinal: 1, counter: "other", device_s: 3, peak: 1 }, 1000, false);
    trace.addStep({ ordinal: 2, counter: "counter", device_s: 1, peak: 1 }, 1000);
    const likely = trace.likely.map((one) => [one.atS, presence(one, 5000)]);
    return [likely, trace.steps.map(({ wasLikely }) => wasLikely)];"""
    assert run(body) == [[[2, 0], [3, 1]], [False, True]]


def test_what_a_trace_carries_is_what_is_drawn(run: Run) -> None:
    body = """
    const trace = new Trace();
    const before = trace.carried(trace.edge(0));
    trace.addSignal({ from_s: 0, rate_hz: 50, values: [1, 1] }, 0);
    const bare = trace.carried(trace.edge(0));
    trace.addSignal({ from_s: 0.04, rate_hz: 50, values: [1], bands: [{ from_s: 0, to_s: 1, upper: 1 }] }, 0);
    return [before, bare, trace.carried(trace.edge(0))].map(({ signal, upper, lower }) => [signal, upper, lower]);"""
    assert run(body) == [[False, False, False], [True, False, False], [True, True, False]]


def test_a_session_begun_anew_begins_its_trace_anew(run: Run) -> None:
    """A service that was restarted counts no reboot, but the bracelet's time may lie before what was drawn."""
    body = """
    const { Devices } = await import("/web/devices.js");
    const devices = new Devices();
    const device = { id: "a", address: "A", reboots: 0, primary: "p", counters: {}, steps: 0, steps_now: 0 };
    const snapshot = (session_since) => ({ type: "snapshot", at: new Date().toISOString(),
      devices: [{ ...device, session_since }] });
    const signal = { type: "signal", device: "a", rate_hz: 50, values: new Array(100).fill(1) };
    const shown = [];
    for (const [since, fromS] of [["t1", 4], ["t1", 6], ["t2", 0]]) {
      devices.apply(snapshot(since), 0);
      devices.apply({ ...signal, from_s: fromS }, 0);
      shown.push(devices.all[0].trace.beginS);
    }
    return shown;"""
    assert run(body) == [4, 4, 0]


def test_a_known_device_under_a_new_address_is_one_card(run: Run) -> None:
    """The card that the new address had for a moment goes; one that only tells the same id stays."""
    body = """
    const { Devices } = await import("/web/devices.js");
    const devices = new Devices();
    const tell = (id, address) => devices.apply({ type: "device", value: { id, address, reboots: 0, steps: 7 } }, 0);
    const shown = () => devices.all.map(({ device }) => [device.id, device.address]);
    tell("a", "A");
    tell("B", "B");
    const before = shown();
    tell("a", "B");
    const moved = shown();
    tell("C", "C");
    tell("a", "B");
    return [before, moved, shown()];"""
    assert run(body) == [[["a", "A"], ["B", "B"]], [["a", "B"]], [["a", "B"], ["C", "C"]]]


@given(value=st.floats(-1e5, 1e5), within=st.floats(1e-6, 1e3))
@settings(max_examples=60, deadline=None)
def test_an_uncertain_number_has_the_digits_that_it_is_known_to(run: Run, value: float, within: float) -> None:
    shown, known = run("return uncertain(a[0], a[1], true);", [value, within])
    assert shown[0] in "+−0"
    assert known[:2] == "±\u00a0"
    number, bound = (float(text.replace(",", "").replace("−", "-")) for text in (shown, known[2:]))
    assert within * (1 - 1e-9) <= bound <= 2 * within
    assert abs(number - value) <= 0.5 * bound + 1e-9 * abs(value)
    assert len(known[2:].replace(",", "").replace(".", "").strip("0")) == 1


def test_a_deviation_is_told_where_it_is_certain(run: Run) -> None:
    told = run("return a.map(([rate, within]) => deviation(rate, 50, within));", [
        [50.0105, 0.0008], [50.0105, 0.0106], [49.0, 0.0008], [50.0105, 0.004],
    ])  # fmt: skip
    assert told == ["+210\u00a0ppm", None, "−20,000\u00a0ppm", "+210\u00a0ppm"]
