"""What the page shows of what the feed says."""

import re

import pytest
from browser.conftest import Scripted
from browser.scripted import AT, counting, device, signal, state, step
from playwright.sync_api import Locator, Page, expect


def field(page: Page, name: str) -> Locator:
    return page.locator(f'.card [data-f="{name}"]')


def test_without_a_bracelet_the_page_says_what_to_do(scripted: Scripted) -> None:
    page = scripted().open()
    expect(page.get_by_role("heading", name="No bracelet yet")).to_be_visible()
    expect(page.get_by_role("listitem")).to_have_count(3)
    expect(page.locator("#trouble")).to_be_hidden()


def test_without_a_bracelet_the_page_says_why_bluetooth_fails(scripted: Scripted) -> None:
    server = scripted()
    server.health = {"reason": "no adapter"}
    expect(server.open().locator("#trouble")).to_have_text("Bluetooth does not work on the server: no adapter")


def test_a_newly_seen_device_replaces_the_empty_state(scripted: Scripted) -> None:
    server = scripted()
    page = server.open()
    server.send({"type": "device", "device": "SL-0001", "at": AT, "value": device(state="seen", name=None)})
    expect(page.get_by_role("heading", name="Bracelet", exact=True)).to_be_visible()
    expect(page.locator("#empty")).to_be_hidden()
    expect(field(page, "state")).to_have_text("In range, not connected")


def test_pending_steps_stand_apart_from_confirmed_ones(scripted: Scripted) -> None:
    server = scripted(device(steps=40, steps_now=42))
    page = server.open()
    expect(field(page, "steps-now")).to_have_text("42")
    expect(field(page, "steps")).to_have_text("40")
    expect(field(page, "pending-chip")).to_have_text("+2 pending")
    server.send(counting(42, 42))
    expect(field(page, "steps")).to_have_text("42")
    expect(field(page, "pending-chip")).to_be_hidden()


def test_the_count_now_may_fall(scripted: Scripted) -> None:
    server = scripted(device(steps=40, steps_now=42))
    page = server.open()
    server.send(counting(40, 40, None))
    expect(field(page, "steps-now")).to_have_text("40")
    expect(field(page, "cadence")).to_have_text("–")


def test_a_step_of_the_primary_counter_raises_the_count_and_another_counters_does_not(scripted: Scripted) -> None:
    server = scripted(device(steps=40, steps_now=40, counters={"double_threshold": 7, "adaptive_peak": 39}))
    page = server.open()
    server.send(step(1, 1.0, 999, counter="adaptive_peak"), step(2, 1.0, 8))
    expect(field(page, "steps-now")).to_have_text("41")
    expect(field(page, "steps")).to_have_text("41")
    expect(page.locator(".lane[data-counter=adaptive_peak] b")).to_have_text("999")
    expect(page.locator(".lane[data-counter=double_threshold] b")).to_have_text("8")


def test_battery_packets_and_losses_are_told(scripted: Scripted) -> None:
    page = scripted(device()).open()
    shown = {name: field(page, name).inner_text().replace("\u00a0", " ") for name in (
        "battery", "packets", "packets-more", "lost", "lost-more", "gaps", "gaps-more", "rate", "rate-more",
        "drift", "drift-more", "rssi", "cadence",
    )}  # fmt: skip
    assert shown == {
        "battery": "87 %", "packets": "1,234", "packets-more": "2 bad, 3 repeated, 1 late", "lost": "1.0 %",
        "lost-more": "100 of 10,000", "gaps": "4", "gaps-more": "1 restart", "rate": "50.0105 Hz",
        "rate-more": "± 0.0009, nominal 50, +210 ppm", "drift": "−12 ± 3 ppm",
        "drift-more": "against the server’s", "rssi": "−58 dBm",
        "cadence": "108",
    }  # fmt: skip


def test_samples_at_the_sensors_limit_stand_apart_from_lost_ones(scripted: Scripted) -> None:
    server = scripted(device(samples_saturated=0))
    page = server.open()
    expect(field(page, "limit-row")).to_be_hidden()
    now = device(samples_saturated=64)
    server.send({"type": "device", "device": now["id"], "at": now["since"], "value": now})
    expect(field(page, "limit")).to_have_text("64")
    expect(field(page, "limit-row")).to_contain_text("steps may be missing")
    expect(field(page, "lost-more")).to_have_text("100 of 10,000")


def test_tallies_are_kept_up_to_date_by_the_feed(scripted: Scripted) -> None:
    server = scripted(device(packets=10))
    page = server.open()
    now = device(packets=20, samples_lost=300, steps=50, steps_now=51)
    server.send({"type": "device", "device": now["id"], "at": now["since"], "value": now})
    expect(field(page, "packets")).to_have_text("20")
    expect(field(page, "lost-more")).to_have_text("300 of 10,200")
    expect(field(page, "steps-now")).to_have_text("51")


def test_unknown_values_are_dashes(scripted: Scripted) -> None:
    page = scripted(device(rate_hz=None, measured_rate_hz=None, measured_rate_uncertainty_hz=None,
                           clock_drift_ppm=None, clock_drift_uncertainty_ppm=None, rssi_dbm=None, battery_percent=None,
                           cadence_spm=None, samples=0, samples_lost=0, session_since=None)).open()  # fmt: skip
    for name in ("rate", "drift", "rssi", "cadence", "lost", "session"):
        expect(field(page, name)).to_have_text("–")
    expect(page.locator(".battery")).to_be_hidden()


def test_a_rate_is_told_as_well_as_it_is_known(scripted: Scripted) -> None:
    server = scripted(device(measured_rate_hz=None, measured_rate_uncertainty_hz=None))
    page = server.open()
    expect(field(page, "rate")).to_have_text("50.0\u00a0Hz")
    expect(field(page, "rate-more")).to_have_text("nominal")
    told = [
        (50.0084, 0.02, "50.01", "± 0.02, nominal 50"),
        (49.01, 0.0065, "49.010", "± 0.007, nominal 50, −19,800 ppm"),
        (50.010512, 0.00083, "50.0105", "± 0.0009, nominal 50, +210 ppm"),
    ]
    for rate_hz, known_hz, rate, more in told:
        now = device(measured_rate_hz=rate_hz, measured_rate_uncertainty_hz=known_hz)
        server.send({"type": "device", "device": now["id"], "at": now["since"], "value": now})
        expect(field(page, "rate")).to_have_text(f"{rate}\u00a0Hz")
        expect(field(page, "rate-more")).to_have_text(re.compile(re.escape(more).replace(r"\ ", r"\s")))


def test_how_the_devices_clock_runs_is_told(scripted: Scripted) -> None:
    server = scripted(device(clock_drift_ppm=None, clock_drift_uncertainty_ppm=None))
    page = server.open()
    expect(field(page, "drift-more")).to_have_text("not known yet")
    for ppm, known_ppm, shown in [(-12.34, 2.9, "−12 ± 3"), (151.0, 41.0, "+150 ± 50"), (0.04, 2.0, "0 ± 2")]:
        now = device(clock_drift_ppm=ppm, clock_drift_uncertainty_ppm=known_ppm)
        server.send({"type": "device", "device": now["id"], "at": now["since"], "value": now})
        expect(field(page, "drift")).to_have_text(f"{shown}\u00a0ppm".replace("± ", "±\u00a0"))
        expect(field(page, "drift-more")).to_have_text("against the server’s")


def test_a_lost_bracelet_is_shown_as_lost_since_when_and_comes_back(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.open()
    expect(field(page, "state")).to_have_text("Live")
    server.send(state(1, "lost", "no data for 3 s"))
    expect(field(page, "state")).to_have_text("Lost")
    expect(field(page, "icon")).to_have_attribute("href", "#i-lost")
    expect(field(page, "notice")).to_contain_text(re.compile(r"Contact lost at .*14:03:12 (CEST|GMT\+2).*\(no data"))
    expect(field(page, "cadence")).to_have_text("–")
    server.send(state(2, "streaming"))
    expect(field(page, "state")).to_have_text("Live")
    expect(field(page, "notice")).to_be_hidden()


def test_every_state_has_its_own_word_and_icon(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.open()
    seen = set()
    for ordinal, word in enumerate(("connecting", "lost", "disconnected", "seen", "streaming")):
        server.send(state(ordinal, word))
        expect(page.locator(".card")).to_have_attribute("data-state", word)
        icon = field(page, "icon").get_attribute("href") or ""
        assert page.locator(f"symbol{icon}").count() == 1
        seen.add((field(page, "state").inner_text(), icon))
    assert len({text for text, _ in seen}) == len({icon for _, icon in seen}) == 5


def test_the_button_asks_the_server_and_follows_the_state(scripted: Scripted) -> None:
    server = scripted(device(state="disconnected"))
    page = server.open()
    page.get_by_role("button", name="Connect Left wrist").click()
    server.send(state(1, "streaming"))
    page.get_by_role("button", name="Disconnect Left wrist").click()
    expect(page.get_by_role("button", name="Disconnect Left wrist")).to_have_attribute("aria-disabled", "false")
    assert server.posts == ["api/v1/devices/SL-0001/connect", "api/v1/devices/SL-0001/disconnect"]


def test_a_refused_request_is_told(scripted: Scripted) -> None:
    server = scripted(device(id="C0:FF:EE/1"))
    server.answer = 404
    page = server.open()
    page.get_by_role("button", name="Disconnect").click()
    expect(field(page, "notice")).to_contain_text("The server refused to disconnect: 404")
    assert server.posts == ["api/v1/devices/C0%3AFF%3AEE%2F1/disconnect"]
    assert len(server.errors) == 1
    server.errors.clear()


def test_an_id_that_replaces_an_address_keeps_the_card(scripted: Scripted) -> None:
    address = "C0:FF:EE:00:00:01"
    server = scripted(device(id=address), device(id="SL-0002", address="C0:FF:EE:00:00:02", name="Right"))
    page = server.open()
    page.locator(".card").first.evaluate("card => card.dataset.mark = 'kept'")
    server.send({"type": "device", "device": "SL-0001", "at": AT, "value": device(steps_now=77)}, counting(77, 78))
    expect(field(page, "steps-now").first).to_have_text("78")
    expect(page.locator(".card")).to_have_count(2)
    expect(page.locator(".card").first).to_have_attribute("data-mark", "kept")


def test_what_is_not_understood_is_ignored(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.open()
    server.send("no JSON", "[]", "null", '{"type": 3}', {"type": "weather"}, counting(1, 1) | {"device": "other"})
    server.send({"type": "toString", "device": "SL-0001"}, counting(50, 51))
    expect(field(page, "steps-now")).to_have_text("51")


def test_a_name_is_text_and_never_markup(scripted: Scripted) -> None:
    name = "<img src=x onerror=alert(1)><b>x</b>"
    page = scripted(device(name=name)).open()
    expect(field(page, "name")).to_have_text(name)
    assert page.locator(".card img, .card h2 b").count() == 0


def test_a_reboot_forgets_the_signal_and_keeps_the_count(scripted: Scripted) -> None:
    server = scripted(device())
    page = server.open()
    server.send(signal(500, 5), {"type": "reboot", "device": "SL-0001", "ordinal": 1, "at": AT, "boot": 2})
    server.send(signal(0, 2), counting(44, 44))
    expect(field(page, "steps-now")).to_have_text("44")
    expect(field(page, "gaps-more")).to_have_text("2 restarts")


def test_what_is_awaited_is_told_and_what_the_bracelet_counts_itself(scripted: Scripted) -> None:
    server = scripted(device(samples_awaited=4000, register_steps=1250))
    page = server.open()
    card = page.locator(".card")
    before = card.locator("[data-f=steps-now]").bounding_box()
    expect(card.locator("[data-f=lost-more]")).to_have_text(
        "100 of 10,000; 1\u00a0min 20\u00a0s more are asked for, until then later steps are pending"
    )
    expect(card.locator("[data-f=own]")).to_have_text("1,250")
    server.send({"type": "device", "device": "SL-0001", "at": AT, "value": device()})
    expect(card.locator("[data-f=lost-more]")).to_have_text("100 of 10,000")
    expect(card.locator("[data-f=own-row]")).to_be_hidden()
    assert card.locator("[data-f=steps-now]").bounding_box()["y"] == before["y"]  # nothing jumps
    server.send({"type": "awaited", "device": "SL-0001", "at": AT, "from_s": 1.0, "to_s": 2.0, "samples": 50})
    correction = {"type": "correction", "device": "SL-0001", "at": AT, "ordinal": 7, "boot": 1, "from_s": 1.0}
    server.send(correction | {"to_s": 2.0, "removed": 0, "added": 2})
    assert server.errors == []


@pytest.mark.full
def test_a_disk_that_takes_nothing_is_told(scripted: Scripted) -> None:
    server = scripted(device())
    server.health = {"reason": None, "store_reason": "the disk of s.db is full: free some room"}
    page = server.open()
    trouble = page.locator("#store-trouble")
    expect(trouble).to_have_text(
        "Steps are counted but not stored for now: the disk of s.db is full: free some room", timeout=10_000
    )
    server.health = {"reason": None, "store_reason": None}
    expect(trouble).to_be_hidden(timeout=10_000)
