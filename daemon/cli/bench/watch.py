"""`pzctl watch`: a live view in the terminal."""

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
    """Show live what the daemon does, until Ctrl-C: progress, sweeps, constants.

    Piped output has one line for each event, without colour. Watching never slows the measurement. Events that were
    missed and are no longer in the journal are reported in one sentence, with --json in a line of kind `missing`.

    Exit status: 130 after Ctrl-C, 2 if no daemon runs or it ends.

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

    def print_header(header: object) -> None:
        print(json.dumps(header), flush=True)

    def report_missing(gap: MissingEvents) -> None:
        print_header({"kind": "missing", **msgspec.to_builtins(gap)})

    for received in lab.listen(missing=report_missing):
        print_header(msgspec.to_builtins(received.event))


def _print_lines(lab: "Client") -> None:
    from ...report.tables.watch_view import line

    for received in lab.listen(missing=lambda gap: print(gap.sentence, flush=True)):
        if (text := line(received)) is not None:
            print(f"{received.event.time[11:19]} {shown(text)}", flush=True)


def _live(lab: "Client", screen: "Console") -> None:
    from rich.live import Live

    from ...report.tables.watch_view import Watched

    watched = Watched()
    with Live(watched.screen(), console=screen, refresh_per_second=8) as live:
        for received in lab.listen(missing=watched.miss):
            watched.hear(received)
            live.update(watched.screen())
