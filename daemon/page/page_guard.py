"""Access to the page: programs on this machine, and users with a token from anywhere."""

import hmac
import ipaddress
from collections.abc import Awaitable, Callable
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
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
    """Return whether a server on `host` can be reached from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


LEAST_TOKEN = 16
"""Smallest number of characters of a token, so that it cannot be guessed."""


PASSED_ON = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-real-ip", "via")
"""Headers that a proxy adds, which show that a request may come from another machine."""


def user_of(scope: Scope) -> PageUser:
    """Return the user of a request, as determined by the guard."""
    user: PageUser = scope["pzctl.user"]
    return user


def shown_token(request: Request) -> str:
    """Return the token in a browser's cookie or in a program's `Authorization: Bearer` header."""
    return _bearer(request) or request.cookies.get(COOKIE, "")


def _bearer(request: Request) -> str:
    """Return the token in the header of a program's request, which no other site can make a browser send."""
    scheme, _, bearer = request.headers.get("authorization", "").partition(" ")
    return bearer.strip() if scheme.lower() == "bearer" else ""


def _site(origin: str) -> str | None:
    """Return host and port of an `Origin` header; None if it is no address."""
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return None


class Guard:
    """Checks the access of every request.

    Without tokens, only requests to a loopback name of this machine pass; otherwise a request needs a token. A command
    (POST) also needs the right to act, and must come from the page itself or show its token in a header, so that
    another site in the same browser cannot send one.
    """

    def __init__(self, app: ASGIApp, token: str | None, users: PageUsers | None) -> None:
        self._app = app
        self._token = token
        self._users = users

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on to the application, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        user = self._user(shown_token(request))
        refusal = self._refusal(request, user)
        scope["pzctl.user"] = user
        scope["headers"] = [header for header in scope["headers"] if header[0] != b"range"]  # files are sent as a whole

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        answer: Callable[[Scope, Receive, Send], Awaitable[None]] = self._app if refusal is None else refusal
        await answer(scope, receive, with_headers)

    def _user(self, token: str) -> PageUser | None:
        """Return the user of a token, or None if it is not valid; without tokens everybody may act."""
        if self._users is not None:
            return self._users.of_token(token)
        if self._token is None or hmac.compare_digest(token.encode(), self._token.encode()):
            return PageUser(None, "act")
        return None

    def _refusal(self, request: Request, user: PageUser | None) -> Response | None:
        host = request.headers.get("host", "")
        if self._token is None and self._users is None:
            if host.rpartition(":")[0] not in LOCAL_NAMES and host not in LOCAL_NAMES:
                return JSONResponse({"error": "open this page as http://127.0.0.1, not by another name"}, 421)
            if any(name in request.headers for name in PASSED_ON):
                return JSONResponse({"error": "this page is behind a proxy, so it needs --users or --token"}, 421)
        elif (shown := parse_qs(request.url.query).get("token", [""])[0]) and self._user(shown) is not None:
            welcome = RedirectResponse("/", 303)
            secure = request.url.scheme == "https"
            welcome.set_cookie(COOKIE, shown, httponly=True, samesite="strict", secure=secure)
            return welcome
        if user is None:
            return JSONResponse({"error": "this page needs a token: open the address that holds yours"}, 401)
        if request.method == "POST":
            has_tokens = self._token is not None or self._users is not None
            if _site(request.headers.get("origin", "")) != host and not (has_tokens and _bearer(request)):
                says = "commands are accepted from the page itself, or with the header `Authorization: Bearer TOKEN`"
                return JSONResponse({"error": says}, 403)
            if user.right != "act":
                return JSONResponse({"error": f"{user.name} has the right to read only, so commands are refused"}, 403)
        return None
