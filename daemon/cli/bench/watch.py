"""`pzctl watch`: the live view in a terminal."""

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import shown

if TYPE_CHECKING:
    from rich.console import Console

    from ...client.client import Client
    from ...wire.events import ReceivedEvent


def watch(
    as_json: Annotated[bool, typer.Option("--json", help="Print each event's header as one line of JSON.")] = False,
) -> None:
    """Show what the daemon does as it happens: progress, sweeps, constants. Until Ctrl-C.

    Where the output is piped, one line for each event, without colour. Never slows the measurement.

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


def _events(lab: "Client") -> "Iterator[ReceivedEvent]":
    """Yield events for ever. Raises DaemonError where the daemon ends."""
    while True:
        yield from lab.listen(1.0)


def _print_json(lab: "Client") -> None:
    import msgspec

    for heard in _events(lab):
        print(json.dumps(msgspec.to_builtins(heard.event)), flush=True)


def _print_lines(lab: "Client") -> None:
    from ...report.tables.watch_view import line

    for heard in _events(lab):
        if (text := line(heard)) is not None:
            print(f"{heard.event.time[11:19]} {shown(text)}", flush=True)


def _live(lab: "Client", screen: "Console") -> None:
    from rich.live import Live

    from ...report.tables.watch_view import Watched

    watched = Watched()
    with Live(watched.screen(), console=screen, refresh_per_second=8) as live:
        for heard in _events(lab):
            watched.hear(heard)
            live.update(watched.screen())
