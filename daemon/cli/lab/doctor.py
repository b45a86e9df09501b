"""`pzctl doctor`: check that everything needed for a measurement works on this machine."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.errors import CannotError

if TYPE_CHECKING:
    from ...server.checkup import Check

_STYLE = {"ok": "green", "note": "yellow", "fault": "bold red"}


class Unwell(CannotError):
    """Something needed for a measurement does not work."""


def doctor(
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of your analyzer; default: PZCTL_RESOURCE.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Look for instruments, report what is missing, and try a measurement on the simulated bench.

    Exit status: 0 everything needed works, 1 something does not.

    Example: pzctl doctor --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    from ...files.config import settings
    from ...report.terminal import console
    from ...server.checkup import checkup

    analyzer = settings({"resource": resource}).get("resource")
    with console(stderr=True).status("checking") as status:
        checks = checkup(analyzer, lambda what: status.update(f"checking {what}"))
    if as_json:
        print(json.dumps({"checks": [asdict(check) for check in checks]}))
    else:
        _print(checks)
    faults = [check.name for check in checks if check.status == "fault"]
    if faults:
        raise Unwell(f"does not work: {', '.join(faults)}")


def _print(checks: "list[Check]") -> None:
    from rich.table import Table
    from rich.text import Text

    from ...report.terminal import console

    table = Table(box=None, show_header=False)
    for whole in (True, True, False):
        table.add_column(no_wrap=whole, overflow="fold")
    for check in checks:
        says = f"{check.says}\n-> {check.remedy}" if check.remedy else check.says
        table.add_row(Text(check.status, _STYLE[check.status]), Text(check.name), Text(says))
    console().print(table)
