"""`pzctl doctor`: whether everything that a measurement needs works on this machine."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.errors import CannotError

if TYPE_CHECKING:
    from ...server.checkup import Check

_STYLE = {"ok": "green", "note": "yellow", "fault": "bold red"}


class Unwell(CannotError):
    """Something that a measurement needs does not work."""


def doctor(
    resource: Annotated[str | None, typer.Option(help="Your analyzer, to be asked; else PZCTL_RESOURCE's.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Look for instruments, say what is missing, and rehearse a measurement on the simulated bench.

    Exit status: 0 all that is needed works, 1 something does not.

    Example: pzctl doctor --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    from ...files.config import settings
    from ...report.terminal import console
    from ...server.checkup import checkup

    asked = settings({"resource": resource}).get("resource")
    with console(stderr=True).status("looking") as status:
        found = checkup(asked, lambda what: status.update(f"looking at {what}"))
    if as_json:
        print(json.dumps({"checks": [asdict(check) for check in found]}))
    else:
        _print(found)
    faults = [check.name for check in found if check.status == "fault"]
    if faults:
        raise Unwell(f"does not work: {', '.join(faults)}")


def _print(found: "list[Check]") -> None:
    from rich.table import Table
    from rich.text import Text

    from ...report.terminal import console

    table = Table(box=None, show_header=False)
    for check in found:
        says = f"{check.says}\n-> {check.remedy}" if check.remedy else check.says
        table.add_row(Text(check.status, _STYLE[check.status]), Text(check.name), Text(says))
    console().print(table)
