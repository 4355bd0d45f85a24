"""A browser for each module of tests, and a fresh page with a scripted server for each test."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from browser.launch import chromium, running_browser
from browser.scripted import ScriptedServer
from conftest import missing
from playwright.sync_api import Browser, BrowserContext

Scripted = Callable[..., ScriptedServer]


# A module, not a session: a running sync Playwright leaves its event loop set, which async tests cannot bear.
@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if chromium() is None:
        missing("no chromium on the PATH")
    with running_browser() as running:
        yield running


@pytest.fixture
def scripted(browser: Browser) -> Iterator[Scripted]:
    """Build a scripted server: `scripted(*devices, **options of the browser's context)`; console errors fail."""
    contexts: list[BrowserContext] = []
    servers: list[ScriptedServer] = []

    def build(*devices: dict[str, Any], **options: Any) -> ScriptedServer:
        context = browser.new_context(**{"timezone_id": "Europe/Zurich", "locale": "en-GB"} | options)
        contexts.append(context)
        servers.append(ScriptedServer(context.new_page(), *devices))
        return servers[-1]

    yield build
    for context in contexts:
        context.close()
    assert [error for server in servers for error in server.errors] == []
