"""Who may see the page: this machine; from anywhere else, who has a token."""

import hmac
import ipaddress
from collections.abc import Awaitable, Callable
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .page_users import PageUser, PageUsers

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


PASSED_ON = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip", "via")
"""Headers that a proxy adds: what comes through one does not come from this machine."""


def user_of(scope: Scope) -> PageUser:
    """Return who asks, as the guard found."""
    found: PageUser = scope["pzctl.user"]
    return found


def shown_token(request: Request) -> str:
    """Return the token that a browser keeps, or that a program sends as a bearer."""
    scheme, _, bearer = request.headers.get("authorization", "").partition(" ")
    return bearer.strip() if scheme.lower() == "bearer" else request.cookies.get(COOKIE, "")


class Guard:
    """Lets through who may: without tokens, requests for this machine by its own name; with some, who shows one.

    A command (POST) needs the right to act. It must besides come from the page itself: another site open in the same
    browser cannot send one.
    """

    def __init__(self, app: ASGIApp, token: str | None, users: PageUsers | None) -> None:
        self._app = app
        self._token = token
        self._users = users

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        user = self._user(shown_token(request))
        refusal = self._refusal(request, user)
        scope["pzctl.user"] = user

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        answer: Callable[[Scope, Receive, Send], Awaitable[None]] = self._app if refusal is None else refusal
        await answer(scope, receive, with_headers)

    def _user(self, token: str) -> PageUser | None:
        """Return whose token this is; without tokens everybody on this machine may act."""
        if self._users is not None:
            return self._users.of_token(token)
        if self._token is None or hmac.compare_digest(token.encode(), self._token.encode()):
            return PageUser(None, "act")
        return None

    def _refusal(self, request: Request, user: PageUser | None) -> Response | None:
        host = request.headers.get("host", "")
        if self._token is None and self._users is None:
            if host.rpartition(":")[0] not in LOCAL_NAMES and host not in LOCAL_NAMES:
                return PlainTextResponse("this page is asked for as http://127.0.0.1, not by another name", 421)
            if any(name in request.headers for name in PASSED_ON):
                return PlainTextResponse("this page is behind a proxy, so it needs --users or --token", 421)
        elif (shown := parse_qs(request.url.query).get("token", [""])[0]) and self._user(shown) is not None:
            welcome = RedirectResponse("/", 303)
            secure = request.url.scheme == "https"
            welcome.set_cookie(COOKIE, shown, httponly=True, samesite="strict", secure=secure)
            return welcome
        if user is None:
            return PlainTextResponse("this page needs a token: open the address that holds yours", 401)
        if request.method == "POST":
            if urlsplit(request.headers.get("origin", "")).netloc != host:
                return PlainTextResponse("commands are taken from the page itself only", 403)
            if user.right != "act":
                return JSONResponse({"error": f"{user.name} may look at everything here, and command nothing"}, 403)
        return None
