"""The page's panels without the DOM: choosing counters, calibrations and trials in words and numbers."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from browser.scripted import ScriptedServer
from hypothesis import given, settings
from hypothesis import strategies as st
from playwright.sync_api import Browser

from service.api.views import counter_view
from service.counters import registry

Run = Callable[..., Any]

IMPORTS = """
const lineup = await import("/web/lineup.js");
const calibration = await import("/web/calibration_words.js");
const trial = await import("/web/trial_words.js");
const looks = await import("/web/looks.js");
const primary = await import("/web/primary.js");
"""
COUNTERS = [counter_view(kind).model_dump(mode="json") for kind in registry.COUNTERS.values()]
NAMES = [counter["name"] for counter in COUNTERS]
STANDING = [{"name": "double_threshold", "preset": "tuned", "params": {}}]


@pytest.fixture(scope="module")
def run(browser: Browser) -> Iterator[Run]:
    """Run a function's body over its argument `a`, with the modules in scope."""
    page = browser.new_page()
    ScriptedServer(page).open()
    yield lambda body, a=None: page.evaluate(f"async (a) => {{ {IMPORTS} {body} }}", a)
    page.close()


def test_every_counter_has_a_shape_and_a_colour_of_its_own(run: Run) -> None:
    looks = run("return a.map((name) => looks.look(name));", NAMES)
    assert len({look["path"] for look in looks}) == len({look["colour"] for look in looks}) == len(NAMES)
    assert run("return looks.look('toString').path === looks.look('unheard_of').path;")


ACTIONS = st.lists(st.tuples(st.sampled_from(["tick", "untick", "lead"]), st.sampled_from(NAMES)), max_size=20)


@pytest.mark.full
@given(actions=ACTIONS)
@settings(max_examples=30, deadline=None)
def test_whatever_is_ticked_a_lineup_has_its_primary_first_and_each_counter_once(
    run: Run, actions: list[tuple[str, str]]
) -> None:
    body = """
    let choice = lineup.standing(a.counters, a.before);
    for (const [what, name] of a.actions) {
      choice = what === "lead" ? lineup.led(choice, name) : lineup.ticked(choice, name, what === "tick");
    }
    return [choice, lineup.wanted(choice)];"""
    choice, wanted = run(body, {"counters": COUNTERS, "before": STANDING, "actions": actions})
    names = [one["name"] for one in wanted]
    assert names[0] == choice["primary"]
    assert sorted(names) == sorted({entry["name"] for entry in choice["entries"] if entry["on"]})


@pytest.mark.parametrize(
    ("text", "params"),
    [
        ("7", {"bout": 7}),
        (" 3,5 ", {"bout": 3.5}),
        ("5", {}),
        ("", {}),
        ("many", {"bout": "many"}),
        ("1e1", {"bout": 10}),
    ],
)
def test_what_is_typed_is_an_override_unless_it_is_the_presets_own(run: Run, text: str, params: dict[str, Any]) -> None:
    double_threshold = COUNTERS[NAMES.index("double_threshold")]
    (bout,) = [one for one in double_threshold["parameters"] if one["name"] == "bout"]
    entry = {"preset": "tuned", "params": {"bout": 9}}
    assert run("return lineup.typed(a[0], a[1], a[2]);", [bout, entry, text]) == params


@pytest.mark.parametrize(
    ("sentence", "counter", "named"),
    [
        ("autocorrelation.bout = 99: from 1 to 12 steps", "autocorrelation", True),
        ("autocorrelation.bout = 99: from 1 to 12 steps", "double_threshold", False),
        ("bout = 99: from 1 to 12 steps", "autocorrelation", True),
        ("bouts = 99: from 1 to 12 steps", "autocorrelation", False),
        ("out of order", "autocorrelation", False),
    ],
)
def test_a_refusal_names_a_counters_parameter(run: Run, sentence: str, counter: str, *, named: bool) -> None:
    assert run("return lineup.named(a[0], a[1], 'bout', { params: { bout: 99 } });", [sentence, counter]) is named
    by_full_name = sentence.startswith(f"{counter}.")
    assert run("return lineup.named(a[0], a[1], 'bout', { params: {} });", [sentence, counter]) is by_full_name


@pytest.mark.parametrize(
    ("sentence", "blames"),
    [
        ("steps = 3: from 10 to 1000 steps", True),
        ("body.steps: Input should be greater than or equal to 10", True),
        ("seconds = 9.0: from 10 to 600 s", True),
        ("the device does not stream: connect it first", False),
        ("stepsize = 3", False),
    ],
)
def test_a_refusal_of_a_calibration_may_be_of_what_was_typed(run: Run, sentence: str, *, blames: bool) -> None:
    assert run("return calibration.blamesAmount(a);", sentence) is blames


def said(run: Run, before: list[dict[str, Any]], after: list[dict[str, Any]]) -> str:
    sentence: str = run("return lineup.consequence(a[0], a[1], 1234);", [before, after])
    return sentence


def test_what_a_change_does_is_said_before_it_is_done(run: Run) -> None:
    (double,) = STANDING
    other = {"name": "adaptive_peak", "preset": "tuned", "params": {}}
    assert said(run, [double], [double]) == "Nothing changes yet."
    assert said(run, [double], [double, other]) == "Adaptive peak begins at 0."
    assert said(run, [double, other], [double]) == "Adaptive peak stops."
    goes_on = "and the count goes on from 1,234 steps."
    assert said(run, [double, other], [other, double]) == f"A new segment begins: adaptive peak counts, {goes_on}"
    changed = double | {"params": {"bout": 3}}
    assert said(run, [double], [changed]) == (
        f"A new segment begins: double threshold counts with other parameters, {goes_on}"
    )


COUNTS = """
const { now, confirmed, pending } = primary.counts(a);
return [primary.shownState(a), now, confirmed, pending, primary.spokenCount(a)];"""


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, ["streaming", "0", "0", 0, "0 steps"]),
        ({"counter_faults": {"beside": "why"}}, ["streaming", "0", "0", 0, "0 steps"]),
        ({"counter_faults": {"lead": "why"}}, ["faulted", "–", "–", 0, "not counting"]),
        ({"counter_faults": {"lead": "why"}, "state": "lost"}, ["lost", "–", "–", 0, "not counting"]),
        (
            {"counter_faults": {"lead": "why"}, "steps": 1200, "steps_now": 1203},
            ["faulted", "1,203", "1,200", 3, "1,203 steps"],
        ),
    ],
)
def test_a_primary_that_cannot_count_has_not_counted_nothing(
    run: Run, changes: dict[str, Any], told: list[object]
) -> None:
    assert run(COUNTS, {"primary": "lead", "state": "streaming", "steps": 0, "steps_now": 0} | changes) == told


def test_only_calibrations_that_the_device_can_do_are_offered(run: Run) -> None:
    body = "return calibration.offers(a[0], a[1]).map(({ counter, method }) => `${counter} ${method}`);"
    counters = [
        {"name": "a", "sensors": ["accelerometer"], "calibrations": ["walk", "middle"]},
        {"name": "g", "sensors": ["gyroscope"], "calibrations": ["slowest_walk"]},
        {"name": "none", "sensors": ["accelerometer"]},
    ]
    assert run(body, [counters, {}]) == ["a walk", "a middle", "g slowest_walk"]
    assert run(body, [counters, {"sensors": ["accelerometer"]}]) == ["a walk", "a middle"]
    assert run(body, [counters, {"sensors": None, "counter_faults": {"a": "why"}}]) == ["g slowest_walk"]


@pytest.mark.parametrize(
    ("method", "limit", "amount", "body"),
    [
        ("walk", "steps", "50", {"pace": "slow", "steps": 50}),
        ("walk", "seconds", "30", {"pace": "slow", "seconds": 30}),
        ("middle", "steps", "30", {"seconds": 30}),
        ("slowest_walk", "steps", "20", {"steps": 20}),
        ("slowest_walk", "seconds", " ", {"seconds": None}),
    ],
)
def test_a_calibration_asks_for_steps_or_seconds_as_its_method_takes_them(
    run: Run, method: str, limit: str, amount: str, body: dict[str, Any]
) -> None:
    values = {"limit": limit, "amount": amount, "pace": "slow"}
    asked = run("return calibration.asked(a[0], a[1]);", [{"counter": "c", "method": method}, values])
    assert asked == {"counter": "c", "method": method} | body


def test_progress_follows_what_ends_the_walk(run: Run) -> None:
    body = "const { share, text } = calibration.progress(a); return [share, text.replaceAll('\\u00a0', ' ')];"
    by_steps = {"steps": 23, "seconds": 12.4, "steps_wanted": 50, "seconds_wanted": None}
    by_time = {"steps": 1, "seconds": 45.0, "steps_wanted": None, "seconds_wanted": 30.0}
    assert run(body, by_steps) == [0.46, "23 of 50 steps, 12 s"]
    assert run(body, by_time) == [1, "1 step, 30 of 30 seconds"]


def test_what_ended_stands_together_as_it_can_be_applied(run: Run) -> None:
    kinds = [("a", "walk", "done"), ("a", "middle", "failed"), ("a", "walk", "done"), ("a", "walk", "recording")]
    items = [{"number": i, "counter": c, "method": m, "state": s} for i, (c, m, s) in enumerate(kinds)]
    groups = run("return calibration.ended(a).map(({ items }) => items.map(({ number }) => number));", items)
    assert groups == [[0, 2], [1]]


def row(device: str, percent: float | None, **changes: Any) -> dict[str, Any]:
    return {
        "device": device, "wrist": "left", "counter": "plus_minus", "steps": 98, "steps_now": 98, "error": -2,
        "accuracy_percent": percent, "note": None,
    } | changes  # fmt: skip


def test_a_trials_rows_have_the_papers_columns(run: Run) -> None:
    trial = {
        "number": 3,
        "name": None,
        "true_steps": 100,
        "rows": [row("x", 98.0), row("y", None, error=None, wrist=None)],
    }
    first, second = run("return trial.cells(a, (id) => `name of ${id}`);", trial)
    assert first["accuracy"].replace("\u00a0", " ") == "98.00 %"
    assert (first["device"], first["counter"], first["item"], first["error"]) == (
        "name of x", "plus minus", "Trial 3", "−2",
    )  # fmt: skip
    assert (second["wrist"], second["error"], second["accuracy"]) == ("–", "–", "–")


def test_mean_accuracies_leave_out_what_is_not_known(run: Run) -> None:
    trials = [{"rows": [row("x", 90.0), row("y", 80.0)]}, {"rows": [row("x", 100.0), row("y", None)]}]
    body = "return trial.means(a, (id) => id).map(({ title, text, rows }) => [title, parseFloat(text), rows]);"
    assert run(body, trials) == [["x, left, plus minus", 95, 2], ["y, left, plus minus", 80, 1], ["All rows", 90, 3]]
    assert run(body, [{"rows": [row("x", None)]}]) == []


@pytest.mark.parametrize(
    ("name", "wrist"), [("Left", "left"), ("my right wrist", "right"), ("Brightly", None), (None, None)]
)
def test_a_devices_name_may_tell_its_wrist(run: Run, name: str | None, wrist: str | None) -> None:
    assert run("return trial.wristOf({ name: a });", name) == wrist


@pytest.mark.parametrize(("text", "steps"), [("1,234", 1234), (" 12 ", 12), ("", None), ("ten", "ten")])
def test_true_steps_are_read_as_people_write_them(run: Run, text: str, steps: object) -> None:
    assert run("return trial.trueSteps(a);", text) == steps
