"""`pzctl fitters`: list the installed fitters, or run one of them for a daemon on another machine."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer


def fitters(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    run: Annotated[
        str | None, typer.Option(help="Run this fitter for a daemon that runs already, until Ctrl-C.")
    ] = None,
    events: Annotated[str | None, typer.Option(help="With --run: the daemon's events, tcp://HOST:PORT.")] = None,
    requests: Annotated[str | None, typer.Option(help="With --run: the daemon's requests, tcp://HOST:PORT.")] = None,
    key: Annotated[
        Path | None, typer.Option(help="With --run: key file of a client with the right to measure.")
    ] = None,
) -> None:
    """List the installed fitters, broken ones included; or run one for a daemon on another machine.

    Example: pzctl fitters --run mason --events tcp://lab:5470 --requests tcp://lab:5471 --key farm.key
    """
    if run is not None:
        from ...client.location import address
        from ...server.workers.fitter_worker import visit

        visit(run, *address(events, requests, key), lambda says: print(says, file=sys.stderr, flush=True))
        return
    from ....fitters.plugins import list_fitters

    listed = list_fitters()
    if as_json:
        print(json.dumps({"fitters": [asdict(entry) for entry in listed]}))
        return
    from ...report.tables.unbroken_table import Column, UnbrokenTable
    from ...report.terminal import console

    table = UnbrokenTable("fitter", "version", "package", Column("what it does", prose=True))
    for entry in listed:
        table.add_row(entry.name, entry.version, entry.package, entry.summary, style=None if entry.works else "red")
    console().print(table)
