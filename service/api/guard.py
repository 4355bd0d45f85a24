"""Who may talk to us from a browser: Host and Origin are checked on every request and every WebSocket.

Without this any web page could reach a service on this machine: by a form (foreign Origin) or by a name that it lets
point to 127.0.0.1 (foreign Host). Requests without an Origin come from programs, not from pages, and pass.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

FORBIDDEN = 403
CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
_HEADERS = (
    (b"content-security-policy", CONTENT_SECURITY_POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
)


class Guard:
    """ASGI middleware: refuses foreign hosts and origins, and sets the page's security headers."""

    def __init__(self, app: ASGIApp, hosts: frozenset[str]) -> None:
        self._app = app
        self._hosts = hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        fault = self._fault(Headers(scope=scope), "https" if scope["scheme"] in {"https", "wss"} else "http")
        if fault is None:
            await self._app(scope, receive, _with_headers(send) if scope["type"] == "http" else send)
        elif scope["type"] == "http":
            await JSONResponse({"detail": fault}, status_code=FORBIDDEN)(scope, receive, send)
        else:  # a close before accepting is answered with 403
            await send({"type": "websocket.close", "code": 4403, "reason": fault})

    def _fault(self, headers: Headers, scheme: str) -> str | None:
        host = headers.get("host", "")
        if _name(f"//{host}") not in self._hosts:
            return f"host {host!r} is not this service; use one of {', '.join(sorted(self._hosts))}"
        origin = headers.get("origin")
        if origin is not None and origin != f"{scheme}://{host}":
            return f"origin {origin!r} may not use this service"
        return None


def _name(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None


def _with_headers(send: Send) -> Send:
    async def wrapped(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *_HEADERS]
        await send(message)

    return wrapped
