"""The guide at /guide: every page, every link, the same security headers, and nothing else of the disk."""

import re

import pytest
from api.standing import standing

from service.api.guide import names


async def get(path):
    async with standing() as lab:
        return await lab.http.get(path)


async def test_the_index_lists_every_page_by_its_title():
    answer = await get("/guide")
    assert answer.status_code == 200
    assert re.findall(r'href="/guide/([^"]+)"', answer.text) == names()
    assert {"calibration", "counters", "papers", "recordings"} <= set(names())
    assert "Calibration and trials" in answer.text


@pytest.mark.parametrize("name", names())
async def test_a_page_is_html_with_the_pages_headers(name):
    answer = await get(f"/guide/{name}")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert "unsafe" not in answer.headers["content-security-policy"]
    assert "<h1>" in answer.text
    assert "<table>" in answer.text
    assert not re.search(r"<script|style=|&lt;table", answer.text)  # the policy would refuse the first two
    assert (await get(f"/guide/{name}.md")).text == answer.text


@pytest.mark.parametrize("name", ["index", *names()])
async def test_every_link_leads_somewhere(name):
    text = (await get("/guide" if name == "index" else f"/guide/{name}")).text
    links = [link for link in re.findall(r'(?:href|src)="([^"]+)"', text) if "://" not in link]
    async with standing() as lab:
        for link in links:
            path = link if link.startswith("/") else f"/guide/{link}"
            assert (await lab.http.get(path)).status_code == 200, link


async def test_a_figure_of_a_page_is_a_drawing_with_the_pages_headers():
    (first, *_) = re.findall(r'<img src="([^"]+)"', (await get("/guide/accuracy")).text)
    answer = await get(f"/guide/{first}")
    assert answer.headers["content-type"] == "image/svg+xml"
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert answer.text.startswith("<svg")


@pytest.mark.parametrize(
    "name",
    [
        "nothing",
        "accuracy_nothing.svg",
        "..%2fapi%2fweb%2ficon.svg",
        "..%2f..%2fpyproject",
        "calibration.md.md",
        "%2e%2e",
        "calibration%00",
    ],
)
async def test_no_other_file_is_served(name):
    answer = await get(f"/guide/{name}")
    assert answer.status_code == 404
    assert answer.json()["detail"]
