"""Who may see the page: this machine; from anywhere else, who has the token."""

import hmac
import ipaddress
import secrets
from collections.abc import Awaitable, Callable
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "pzctl-token"
LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach what listens on `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


LEAST_TOKEN = 16
"""Characters of a token: fewer can be guessed by trying."""


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(24)


class Guard:
    """Lets through who may: without a token, requests for this machine by its own name; with one, who shows it.

    A command (POST) must besides come from the page itself: another site open in the same browser cannot send one.
    """

    def __init__(self, app: ASGIApp, token: str | None) -> None:
        self._app = app
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(Request(scope))

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        answer: Callable[[Scope, Receive, Send], Awaitable[None]] = self._app if refusal is None else refusal
        await answer(scope, receive, with_headers)

    def _refusal(self, request: Request) -> Response | None:
        host = request.headers.get("host", "")
        if self._token is None and host.rpartition(":")[0] not in LOCAL_NAMES and host not in LOCAL_NAMES:
            return PlainTextResponse("this page is asked for as http://127.0.0.1, not by another name", 421)
        if self._token is not None:
            shown = parse_qs(request.url.query).get("token", [""])[0]
            if shown and hmac.compare_digest(shown.encode(), self._token.encode()):
                welcome = RedirectResponse(request.url.path, 303)
                welcome.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
                return welcome
            if not hmac.compare_digest(_cookie(request).encode(), self._token.encode()):
                return PlainTextResponse("this page needs its token: open the address that `pzctl page` printed", 401)
        if request.method == "POST" and urlsplit(request.headers.get("origin", "")).netloc != host:
            return PlainTextResponse("commands are taken from the page itself only", 403)
        return None


def _cookie(request: Request) -> str:
    """Return the token that the browser keeps."""
    return request.cookies.get(COOKIE, "")
