"""`pzctl keys`: who may reach the daemon and the live page from other machines, and with which rights."""

import json
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True, help="Manage the keys for access to the daemon and the page from other machines."
)


@app.command("server")
def server(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Make the key of the daemon, which must not have one yet.

    Example: pzctl keys server
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import make_server

    public = make_server(keys_folder(home())).public
    print(json.dumps({"public": public}) if as_json else f"the daemon's public key: {public}")


@app.command("client")
def client(
    name: Annotated[str, typer.Argument(help="Name of the key's owner.")],
    right: Annotated[
        str, typer.Option(help="watch, measure, bench or admin; each includes the ones before it.")
    ] = "watch",
    out: Annotated[Path | None, typer.Option(help="Key file for the client; default: NAME.key.")] = None,
    expires: Annotated[
        datetime | None,
        typer.Option(formats=["%Y-%m-%d"], metavar="YYYY-MM-DD", help="Last day (UTC) on which the key is valid."),
    ] = None,
    analyzer: Annotated[
        list[str] | None, typer.Option(help="Analyzer that the client may use; may be repeated; default: all.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Give a client access and write its key file.

    Example: pzctl keys client ana --right measure, and then in her script connect(..., key="ana.key")
    """
    from ....models.base.errors import PzctlError
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import RIGHTS, Right, make_client, write_secret
    from ...wire.curve_keys import revoke as bar
    from ...wire.frames import to_json
    from ..analysis.fit import UsageError

    by_name: dict[str, Right] = {known: known for known in RIGHTS}
    granted = by_name.get(right)
    if granted is None:
        raise UsageError(f"--right {right}: allowed are {', '.join(RIGHTS)}")
    path = out or Path(f"{name}.key")
    if path.exists():
        raise UsageError(f"--out {path}: this file exists already")
    folder = keys_folder(home())
    key = make_client(folder, name, granted, expires.date() if expires else None, tuple(analyzer) if analyzer else None)
    try:
        write_secret(path, to_json(key))
    except PzctlError:
        bar(folder, name)  # the client never got its key: allow the same name again
        raise
    if as_json:
        print(json.dumps({"name": name, "right": right, "file": str(path)}))
    else:
        print(f"{name} has the right to {right}; pass {path} on over a secure channel, and keep no copy")


@app.command("rotate")
def rotate(
    name: Annotated[str, typer.Argument(help="Name of the key's owner.")],
    days: Annotated[int, typer.Option(min=0, max=365, help="Days for which the old key is still valid.")] = 7,
    out: Annotated[Path | None, typer.Option(help="New key file for the client; default: NAME.new.key.")] = None,
    expires: Annotated[
        datetime | None,
        typer.Option(formats=["%Y-%m-%d"], metavar="YYYY-MM-DD", help="Last day (UTC) on which the new key is valid."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Give a client a new key beside its old one, which expires after some days. A running daemon notices by itself.

    A key that somebody else may know is to be revoked instead: `pzctl keys revoke`, then `pzctl keys client`.

    Example: pzctl keys rotate ana --days 14
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import rotate as rotated
    from ...wire.curve_keys import write_secret
    from ...wire.frames import to_json
    from ..analysis.fit import UsageError

    path = out or Path(f"{name}.new.key")
    if path.exists():
        raise UsageError(f"--out {path}: this file exists already")
    today = datetime.now(UTC).date()
    until = today + timedelta(days=days)
    write_secret(path, b"")  # before anything is changed, so that the new key has a place
    try:
        key = rotated(keys_folder(home()), name, until, today, expires.date() if expires else None)
    except BaseException:
        path.unlink()
        raise
    path.write_bytes(to_json(key))
    if as_json:
        print(json.dumps({"name": name, "file": str(path), "old_until": until.isoformat()}))
    else:
        print(f"pass {path} on to {name} over a secure channel; the old key is valid until {until} at the latest")


@app.command("page")
def page(
    name: Annotated[str, typer.Argument(help="Name of the token's owner.")],
    right: Annotated[
        str, typer.Option(help="read: see everything; act: measure, stop, diagnose, fit as well.")
    ] = "read",
    users: Annotated[Path, typer.Option(help="File of users for `pzctl page --users`.")] = Path("page-users.toml"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Give a user access to the live page; the token is printed once, and only its hash is kept.

    Remove the entry from the file to revoke access; a running page notices by itself.

    Example: pzctl keys page ana --right act
    """
    from ...page.page_users import Right, add_user
    from ..analysis.fit import UsageError

    by_name: dict[str, Right] = {"read": "read", "act": "act"}
    granted = by_name.get(right)
    if granted is None:
        raise UsageError(f"--right {right}: allowed are {', '.join(by_name)}")
    token = add_user(users, name, granted)
    if as_json:
        print(json.dumps({"name": name, "right": right, "users": str(users), "token": token}))
    else:
        print(
            f"{name} has the right to {right}; pass on this end of the address over a secure channel: /?token={token}"
        )


@app.command("list")
def show(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List the clients that have access.

    Example: pzctl keys list
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import clients
    from ...wire.frames import to_json

    valid, faults = clients(keys_folder(home()))
    for fault in faults:
        print(f"no access: {fault}", file=sys.stderr)
    if as_json:
        print(to_json({"clients": valid}).decode())
        return
    for entry in valid:
        until = f"\tuntil {entry.expires}" if entry.expires else ""
        print(f"{entry.name}\t{entry.right}\t{entry.public}{until}")


@app.command("revoke")
def revoke(
    name: Annotated[str, typer.Argument(help="Name of the key's owner.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Revoke a client's access at once; a running daemon notices by itself.

    Example: pzctl keys revoke ana
    """
    from ...files.paths import home, keys_folder
    from ...wire.curve_keys import revoke as bar

    bar(keys_folder(home()), name)
    print(json.dumps({"name": name, "revoked": True}) if as_json else f"{name} no longer has access")
