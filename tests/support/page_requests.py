"""Calls the live page's application directly, as a server would; without a socket."""

import asyncio
from typing import Any

from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.page.page_server import page_app
from pzctl.daemon.page.page_users import PageUsers

BUILD = """
name = "B"
diameter_mm = 16
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = 0.5
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
"""


def ask(
    path: str,
    token: str | None = None,
    method: str = "GET",
    body: bytes | None = b"{}",
    users: PageUsers | None = None,
    trusts_proxy: bool = False,
    build: str = BUILD,
    **headers: str,
) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of the answer.

    Without a body, the client never sends one; `trusts_proxy` accepts headers added by a proxy on this machine;
    `build` is the text of a build file.
    """
    where, _, query = path.partition("?")
    given = {"host": "127.0.0.1:8294", **headers}
    scope = {
        "type": "http",
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": where,
        "raw_path": where.encode(),
        "query_string": query.encode(),
        "headers": [(name.encode(), value.encode()) for name, value in given.items()],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 8294),
    }
    parts = [] if body is None else [body[k : k + 10_000] for k in range(0, len(body), 10_000)] or [b""]
    heard: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        if not parts:
            await asyncio.Event().wait()  # the browser stays connected
        part = parts.pop(0)
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: Any) -> None:
        heard.append(dict(message))

    page: Any = page_app(parse_build(build), token, users)
    app = ProxyHeadersMiddleware(page) if trusts_proxy else page  # as uvicorn does by default
    asyncio.run(app(scope, receive, send))
    answer = b"".join(message.get("body", b"") for message in heard)
    return heard[0]["status"], {name.decode(): value.decode() for name, value in heard[0]["headers"]}, answer
