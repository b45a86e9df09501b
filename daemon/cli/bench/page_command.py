"""`pzctl page`: the live page in a browser."""

import json
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer


def page(
    build: Annotated[Path | None, typer.Option(help="build.toml; without it, the thesis's transducer.")] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but a loopback address needs a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 takes any free one.")] = 8294,
    token: Annotated[
        str | None, typer.Option(help="Token for access; generated if one is needed and not given.")
    ] = None,
    users: Annotated[Path | None, typer.Option(help="File of users, written by `pzctl keys page`.")] = None,
    tls_cert: Annotated[Path | None, typer.Option(help="Certificate (PEM) to serve HTTPS with.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its private key (PEM).")] = None,
    resource: Annotated[str | None, typer.Option(help="VISA resource, if a daemon has to be started.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the address as one JSON object, then serve.")] = False,
) -> None:
    """Serve the live page until Ctrl-C: sweeps as they arrive, fits, the stack, and buttons to measure and fit.

    Uses the running daemon, or starts one, says so and leaves it running. Needs the extra `web` of the package.

    Examples: pzctl page --build S4.toml --resource TCPIP0::192.168.0.17::5025::SOCKET

    pzctl page --host 192.168.0.20 --users page-users.toml --tls-cert lab.pem --tls-key lab.key
    """
    from ...page.page_process import check_installed, listen, serve, tls_context

    check_installed()
    from ...files.builds.build_check import needed_plan
    from ...files.builds.build_file import THESIS_BUILD, read_build
    from ...files.config import options, settings
    from ...page.page_guard import LEAST_TOKEN, is_loopback
    from ...page.page_users import PageUsers, new_token
    from ...report.terminal import console
    from ...server.launch import running, start
    from ..analysis.fit import UsageError

    if token is not None and len(token) < LEAST_TOKEN:
        raise UsageError(f"--token: at least {LEAST_TOKEN} characters are needed; without --token one is generated")
    if token is not None and users is not None:
        raise UsageError("--token: with --users every user has a token already; give one of the two options")
    if (tls_cert is None) != (tls_key is None):
        raise UsageError("--tls-cert and --tls-key belong together: give both, or neither")
    certificate = (tls_cert, tls_key) if tls_cert and tls_key else None
    if certificate:
        tls_context(*certificate)
    page_users = PageUsers(users) if users else None
    device = read_build(build or THESIS_BUILD)
    needed_plan(device, str(build))
    screen = console(stderr=True)
    with listen(host, port, "--host and --port take another") as listener:  # before starting a daemon that stays
        if running() is None:
            screen.print(
                f"no daemon runs: starting one for {resource or 'a simulated 4294A'}; it keeps running", style="dim"
            )
            start(options({"time_scale": 0.02} | settings({"resource": resource})))
        if token is None and page_users is None and not is_loopback(host):
            token = new_token()
        path = f"/?token={quote(token, safe='')}" if token else "/"
        address = f"{'https' if certificate else 'http'}://{host}:{listener.getsockname()[1]}{path}"
        print(json.dumps({"page": address}) if as_json else f"page: {address}", flush=True)
        serve(device, listener, token, users=page_users, certificate=certificate)
