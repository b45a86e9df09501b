"""`pzctl watch`: the live view in a terminal."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import shown

if TYPE_CHECKING:
    from rich.console import Console

    from ...client.client import Client


def watch(
    as_json: Annotated[bool, typer.Option("--json", help="Print each event's header as one line of JSON.")] = False,
) -> None:
    """Show what the daemon does as it happens: progress, sweeps, constants. Until Ctrl-C.

    Where the output is piped, one line for each event, without colour. Never slows the measurement. What was missed
    and is no longer in the journal is said in one sentence, as JSON by a line of kind `missing`.

    Exit status: 130 after Ctrl-C, 2 where no daemon runs or it ends.

    Example: pzctl watch
    """
    from ...client.client import connect
    from ...report.terminal import console

    screen = console()
    with connect() as lab:
        if as_json:
            _print_json(lab)
        elif screen.is_terminal:
            _live(lab, screen)
        else:
            _print_lines(lab)


def _print_json(lab: "Client") -> None:
    import msgspec

    from ...wire.replies import MissingEvents

    def tell(header: object) -> None:
        print(json.dumps(header), flush=True)

    def missing(hole: MissingEvents) -> None:
        tell({"kind": "missing", **msgspec.to_builtins(hole)})

    for heard in lab.listen(missing=missing):
        tell(msgspec.to_builtins(heard.event))


def _print_lines(lab: "Client") -> None:
    from ...report.tables.watch_view import line

    for heard in lab.listen(missing=lambda hole: print(hole.sentence, flush=True)):
        if (text := line(heard)) is not None:
            print(f"{heard.event.time[11:19]} {shown(text)}", flush=True)


def _live(lab: "Client", screen: "Console") -> None:
    from rich.live import Live

    from ...report.tables.watch_view import Watched

    watched = Watched()
    with Live(watched.screen(), console=screen, refresh_per_second=8) as live:
        for heard in lab.listen(missing=watched.miss):
            watched.hear(heard)
            live.update(watched.screen())
