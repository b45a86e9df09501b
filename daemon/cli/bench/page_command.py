"""`pzctl page`: the live page in a browser."""

import json
from pathlib import Path
from typing import Annotated

import typer


def page(
    build: Annotated[Path | None, typer.Option(help="build.toml; without it, the thesis's transducer.")] = None,
    host: Annotated[str, typer.Option(help="Address to listen on; others than loopback need a token.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen on.")] = 8294,
    token: Annotated[str | None, typer.Option(help="Token that lets one in; made up where one is needed.")] = None,
    users: Annotated[Path | None, typer.Option(help="File of the users that `pzctl keys page` lets in.")] = None,
    tls_cert: Annotated[Path | None, typer.Option(help="Certificate (PEM) to serve HTTPS with.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its private key (PEM).")] = None,
    resource: Annotated[str | None, typer.Option(help="VISA resource, where a daemon has to be started.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the address as one JSON object, then serve.")] = False,
) -> None:
    """Serve the live page: sweeps as they arrive, fits, the stack, and the buttons beside the press. Until Ctrl-C.

    Uses the daemon that runs, or starts one and says so; that one stays. Needs the extra `web` of the package.

    Examples: pzctl page --build S4.toml --resource TCPIP0::192.168.0.17::5025::SOCKET

    pzctl page --host 192.168.0.20 --users page-users.toml --tls-cert lab.pem --tls-key lab.key
    """
    from ...page.page_process import check_certificate, check_installed, free_port, serve

    check_installed()
    from ...files.builds.build_file import THESIS_BUILD, read_build
    from ...files.config import options, settings
    from ...page.page_guard import LEAST_TOKEN, is_loopback
    from ...page.page_users import PageUsers, new_token
    from ...report.terminal import console
    from ...server.launch import running, start
    from ..analysis.fit import UsageError

    if token is not None and len(token) < LEAST_TOKEN:
        raise UsageError(f"--token: at least {LEAST_TOKEN} characters are needed; without it one is made up")
    if token is not None and users is not None:
        raise UsageError("--token: with --users everybody has a token of their own; leave one of the two out")
    if (tls_cert is None) != (tls_key is None):
        raise UsageError("--tls-cert and --tls-key belong together: give both, or neither")
    certificate = (tls_cert, tls_key) if tls_cert and tls_key else None
    if certificate:
        check_certificate(*certificate)
    let_in = PageUsers(users) if users else None
    known = read_build(build or THESIS_BUILD)
    screen = console(stderr=True)
    port = free_port(host, port, "--host and --port take another")  # before a daemon is started that stays
    if running() is None:
        screen.print(f"no daemon runs: starting one for {resource or 'a simulated 4294A'}; it stays", style="dim")
        start(options({"time_scale": 0.02} | settings({"resource": resource})))
    if token is None and let_in is None and not is_loopback(host):
        token = new_token()
    end = f"/?token={token}" if token else "/"
    address = f"{'https' if certificate else 'http'}://{host}:{port}{end}"
    print(json.dumps({"page": address}) if as_json else f"page: {address}", flush=True)
    serve(known, host, port, token, users=let_in, certificate=certificate)
