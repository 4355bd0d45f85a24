"""A scripted server inside the browser: the page's real files, and a feed that says what a test wants."""

import json
import math
from pathlib import Path
from typing import Any

from playwright.sync_api import ConsoleMessage, Page, Route, WebSocketRoute, expect

import service.api
from service.api.guard import CONTENT_SECURITY_POLICY

WEB = Path(service.api.__file__).parent / "web"
ORIGIN = "http://steplink.test/"
AT = "2026-07-01T12:03:12.000000+00:00"
MIME = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


def device(**changes: Any) -> dict[str, Any]:
    """A Device as the API gives it, with `changes`."""
    return {
        "id": "SL-0001", "name": "Left wrist", "address": "C0:FF:EE:00:00:01", "state": "streaming", "reason": None,
        "since": AT, "session_since": AT, "primary": "double_threshold", "steps": 40, "steps_now": 42,
        "counters": {"double_threshold": 40}, "cadence_spm": 108.4, "battery_percent": 87, "rate_hz": 50.0,
        "measured_rate_hz": 50.0105, "measured_rate_uncertainty_hz": 0.00083, "clock_drift_ppm": -12.34,
        "clock_drift_uncertainty_ppm": 2.9, "rssi_dbm": -58,
        "packets": 1234, "packets_bad": 2, "packets_duplicate": 3, "packets_reordered": 1,
        "samples_awaited": 0, "register_steps": None,
        "samples": 9900, "samples_lost": 100, "gaps": 4, "reboots": 1, "manufacturer": "Maker", "model": "Bracelet",
        "firmware": "1.0",
    } | changes  # fmt: skip


def signal(from_s: float, seconds: float, **changes: Any) -> dict[str, Any]:
    """A signal message: 1 g ± 0.3 g, two swings a second, thresholds at 1 g and 0.8 g once a second."""
    n = round(seconds * 50)
    values = [1 + 0.3 * math.sin(4 * math.pi * (from_s + i / 50)) for i in range(n)]
    bands = [
        {"from_s": from_s + i, "to_s": from_s + i + 1, "upper": 1.0, "lower": 0.8} for i in range(math.floor(seconds))
    ]
    message = {"type": "signal", "device": "SL-0001", "at": AT, "from_s": from_s, "rate_hz": 50}
    return message | {"values": values, "bands": bands} | changes


def step(ordinal: int, device_s: float, steps: int, **changes: Any) -> dict[str, Any]:
    """A step message of the primary counter, its peak at 1.3 g."""
    return {
        "type": "step", "device": "SL-0001", "ordinal": ordinal, "at": AT, "device_s": device_s, "boot": 1,
        "counter": "double_threshold", "steps": steps, "strength": 0.6, "interval_s": 0.5, "peak": 1.3, "valley": 0.7,
        "upper": 1.0, "lower": 0.8,
    } | changes  # fmt: skip


def state(ordinal: int, word: str, reason: str | None = None) -> dict[str, Any]:
    return {"type": "state", "device": "SL-0001", "ordinal": ordinal, "at": AT, "state": word, "reason": reason}


def counting(steps: int, steps_now: int, cadence_spm: float | None = 100.0) -> dict[str, Any]:
    counts = {"steps": steps, "steps_now": steps_now, "cadence_spm": cadence_spm}
    return {"type": "counting", "device": "SL-0001", "at": AT, "now_s": 1.0} | counts


class ScriptedServer:
    """Serves the page to `page`; each connection to the feed begins with a snapshot of `devices`.

    `refusing` makes new connections close at once; `posts` are the paths posted to, answered with `answer`. `api` has
    answers by "METHOD path", each JSON or (status, JSON); `asked` are the requests that it answered, but for GET.
    """

    def __init__(self, page: Page, *devices: dict[str, Any]) -> None:
        self.page = page
        self.devices = list(devices)
        self.refusing = False
        self.answer = 202
        self.health: dict[str, Any] = {"reason": None}
        self.posts: list[str] = []
        self.api: dict[str, Any] = {"GET api/v1/trials": {"items": [], "next": None}}
        self.asked: list[tuple[str, Any]] = []
        self.connections = 0
        self.errors: list[str] = []
        self._socket: WebSocketRoute | None = None
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.route(f"{ORIGIN}**", self._serve)
        page.route_web_socket("**/api/v1/live", self._accept)

    def open(self) -> Page:
        """Open the page and wait for its first snapshot to be shown."""
        self.page.goto(ORIGIN)
        expect(self.page.locator("#server")).to_have_text("Server connected")
        return self.page

    def send(self, *messages: dict[str, Any] | str) -> None:
        """Send messages over the standing connection."""
        assert self._socket is not None
        for message in messages:
            self._socket.send(message if isinstance(message, str) else json.dumps(message))

    def close(self, code: int = 1001) -> None:
        """Close the standing connection."""
        assert self._socket is not None
        self._socket.close(code=code)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def _accept(self, socket: WebSocketRoute) -> None:
        self.connections += 1
        if self.refusing:
            socket.close(code=1013)
            return
        self._socket = socket
        socket.send(json.dumps({"type": "snapshot", "at": AT, "devices": self.devices}))

    def _serve(self, route: Route) -> None:
        path = route.request.url.removeprefix(ORIGIN)
        what = f"{route.request.method} {path}"
        if what in self.api:
            self._answer(route, what)
            return
        if route.request.method == "POST":
            self.posts.append(path)
            route.fulfill(status=self.answer, json={})
            return
        if path == "healthz":
            route.fulfill(json=self.health)
            return
        file = WEB / (path.removeprefix("web/") or "index.html")
        headers = {"content-security-policy": CONTENT_SECURITY_POLICY}
        route.fulfill(body=file.read_bytes(), content_type=MIME[file.suffix], headers=headers)

    def _answer(self, route: Route, what: str) -> None:
        if route.request.method != "GET":
            self.asked.append((what, route.request.post_data_json))
        answer = self.api[what]
        status, value = answer if isinstance(answer, tuple) else (200, answer)
        if value is None:
            route.fulfill(status=status)
        else:
            route.fulfill(status=status, json=value)
