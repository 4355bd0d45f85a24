"""The guide: the Markdown pages of `service/guide/`, as HTML at `/guide`, for who reads without the source at hand.

A page is named as its file is, with or without `.md`: so the links from one page to another, and to the figures beside
them, are good here as they are on disk.
"""

from __future__ import annotations

import functools
import html
from importlib.resources import files
from typing import Final

from fastapi import FastAPI
from fastapi.responses import HTMLResponse, JSONResponse, Response
from markdown_it import MarkdownIt

_PAGES: Final = files("service") / "guide"
_ENDING: Final = ".md"
_DRAWING: Final = ".svg"
_FRAME: Final = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} – steplink</title>
<link rel="icon" href="/web/icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="/web/guide.css">
</head>
<body>
<nav><a href="/">steplink</a> <a href="/guide">guide</a></nav>
<main>
{body}</main>
</body>
</html>
"""


def add_guide(app: FastAPI) -> None:
    """Add the guide's pages to `app`."""

    @app.get("/guide", include_in_schema=False)
    async def index() -> HTMLResponse:
        return HTMLResponse(_index())

    @app.get("/guide/{name}", include_in_schema=False)
    async def page(name: str) -> Response:
        if name in _drawings():
            return Response((_PAGES / name).read_bytes(), media_type="image/svg+xml")
        known = name.removesuffix(_ENDING)
        if known not in names():
            return JSONResponse({"detail": f"no page {name!r}: GET /guide lists them"}, status_code=404)
        return HTMLResponse(_page(known))


def names() -> list[str]:
    """Return the names of the guide's pages, in order."""
    return sorted(one.name.removesuffix(_ENDING) for one in _PAGES.iterdir() if one.name.endswith(_ENDING))


@functools.cache
def _drawings() -> frozenset[str]:
    """Return the names of the figures."""
    return frozenset(one.name for one in _PAGES.iterdir() if one.name.endswith(_DRAWING))


@functools.cache
def _index() -> str:
    links = "".join(f'<li><a href="/guide/{name}">{html.escape(_title(_text(name)))}</a></li>\n' for name in names())
    return _FRAME.format(title="Guide", body=f"<h1>Guide</h1>\n<ul>\n{links}</ul>\n")


@functools.cache
def _page(name: str) -> str:
    text = _text(name)
    made = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    return _FRAME.format(title=html.escape(_title(text)), body=made)


def _text(name: str) -> str:
    return (_PAGES / f"{name}{_ENDING}").read_text("utf-8")


def _title(text: str) -> str:
    return text.partition("\n")[0].lstrip("# ")
