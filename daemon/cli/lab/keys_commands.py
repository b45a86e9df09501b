"""`pzctl keys`: who may reach the daemon and the live page from other machines, and what for."""

import json
import sys
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True, help="Keys of those who may reach the daemon, or the page, from other machines."
)


@app.command("server")
def server(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Make the daemon's own key, once.

    Example: pzctl keys server
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import make_server

    public = make_server(keys_folder(home())).public
    print(json.dumps({"public": public}) if as_json else f"the daemon's public key: {public}")


@app.command("client")
def client(
    name: Annotated[str, typer.Argument(help="Whose key it is.")],
    right: Annotated[str, typer.Option(help="watch, measure, bench or admin; each includes those before.")] = "watch",
    out: Annotated[Path | None, typer.Option(help="File for the client to keep; NAME.key unless given.")] = None,
    expires: Annotated[
        datetime | None, typer.Option(formats=["%Y-%m-%d"], help="Last day (UTC) on which the key counts.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Let a client in, and write the key that it needs.

    Example: pzctl keys client ana --right measure, and then in her script connect(..., key="ana.key")
    """
    from ....models.base.errors import PzctlError
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import RIGHTS, Right, make_client, write_secret
    from ...wire.curve_keys import revoke as bar
    from ...wire.frames import to_json
    from ..analysis.fit import UsageError

    by_name: dict[str, Right] = {one: one for one in RIGHTS}
    found = by_name.get(right)
    if found is None:
        raise UsageError(f"--right {right}: allowed are {', '.join(RIGHTS)}")
    path = out or Path(f"{name}.key")
    if path.exists():
        raise UsageError(f"--out {path}: this file is there already")
    folder = keys_folder(home())
    key = make_client(folder, name, found, expires.date() if expires else None)
    try:
        write_secret(path, to_json(key))
    except PzctlError:
        bar(folder, name)  # nobody has the key of this client: it must be possible to make it again
        raise
    if as_json:
        print(json.dumps({"name": name, "right": right, "file": str(path)}))
    else:
        print(f"{name} may {right}; give them {path} over a safe way, and keep no copy")


@app.command("page")
def page(
    name: Annotated[str, typer.Argument(help="Whose token it is.")],
    right: Annotated[
        str, typer.Option(help="read: see everything; act: measure, stop, diagnose, fit as well.")
    ] = "read",
    users: Annotated[Path, typer.Option(help="File that `pzctl page --users` is given.")] = Path("page-users.toml"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Let somebody in to the live page; the token is printed once, and only its hash is kept.

    Remove the entry from the file to bar them; a page that is served need not be told.

    Example: pzctl keys page ana --right act
    """
    from ...page.page_users import Right, add_user
    from ..analysis.fit import UsageError

    by_name: dict[str, Right] = {"read": "read", "act": "act"}
    found = by_name.get(right)
    if found is None:
        raise UsageError(f"--right {right}: allowed are {', '.join(by_name)}")
    token = add_user(users, name, found)
    if as_json:
        print(json.dumps({"name": name, "right": right, "users": str(users), "token": token}))
    else:
        print(f"{name} may {right}; give them the end of their address over a safe way: /?token={token}")


@app.command("list")
def show(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List who may come in.

    Example: pzctl keys list
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import clients
    from ...wire.frames import to_json

    found, faults = clients(keys_folder(home()))
    for fault in faults:
        print(f"not let in: {fault}", file=sys.stderr)
    if as_json:
        print(to_json({"clients": found}).decode())
        return
    for one in found:
        until = f"\tuntil {one.expires}" if one.expires else ""
        print(f"{one.name}\t{one.right}\t{one.public}{until}")


@app.command("revoke")
def revoke(
    name: Annotated[str, typer.Argument(help="Whose key no longer counts.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Bar a client, at once; a running daemon need not be told.

    Example: pzctl keys revoke ana
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import revoke as bar

    bar(keys_folder(home()), name)
    print(json.dumps({"name": name, "revoked": True}) if as_json else f"{name} no longer comes in")
