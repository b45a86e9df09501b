"""`pzctl fitters`: what is installed."""

import json
from dataclasses import asdict
from typing import Annotated

import typer


def fitters(as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False) -> None:
    """List the installed fitters, broken ones included."""
    from ...fitters.plugins import list_fitters

    listed = list_fitters()
    if as_json:
        print(json.dumps({"fitters": [asdict(entry) for entry in listed]}))
        return
    from rich.table import Table

    from ..terminal import console

    table = Table("fitter", "version", "package", "what it does")
    for entry in listed:
        table.add_row(entry.name, entry.version, entry.package, entry.summary, style=None if entry.works else "red")
    console().print(table)
