"""`pzctl compare`: what changed between two recordings of a device."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from ....models.base.names import shown
from .fit import read_trace
from .fit_options import UsageError

if TYPE_CHECKING:
    from ....models.sweep import Sweep

_LISTS = ("--before", "--after")


class ListOptions(TyperCommand):
    """A command of which `--before` and `--after` each take all files up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Say the option before each of its files, as the parser wants it."""
        told: list[str] = []
        current = ""
        for word in args:
            if word.startswith("-"):
                current = word if word in _LISTS else ""
                told += [] if current else [word]
            else:
                told += [current, word] if current else [word]
        return super().parse_args(ctx, told)


def compare(
    recordings: Annotated[
        list[Path] | None, typer.Argument(metavar="BEFORE AFTER", help="Two recordings of one device.")
    ] = None,
    before: Annotated[
        list[Path] | None, typer.Option(metavar="FILE...", help="Recordings of several devices before.")
    ] = None,
    after: Annotated[
        list[Path] | None, typer.Option(metavar="FILE...", help="Recordings of the same devices after, in that order.")
    ] = None,
    repeats: Annotated[bool, typer.Option("--repeats", help="All files of a side are repeats of one device.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Where the picture goes, .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Say what changed between two recordings: at the terminals or in the device, by how much, how sure that is.

    Needs no model of the device.

    Example: pzctl compare before.csv after.csv
    """
    from ....fitters.compare.compare import compare as find_out
    from ...report.json_output.comparison_json import comparison_json
    from ...report.tables.comparison_output import print_comparison
    from ...report.terminal import console

    sides = _sides(recordings or [], before or [], after or [])
    own, other = (tuple(_read(path) for path in side) for side in sides)
    with console(stderr=True).status("comparing"):
        comparison = find_out(own, other)
    found = comparison_json(comparison)
    if as_json:
        print(json.dumps(found))
    else:
        print_comparison(console(), found)


def _sides(recordings: list[Path], before: list[Path], after: list[Path]) -> tuple[list[Path], list[Path]]:
    """Return the files of both sides. Raises UsageError where they are not told apart."""
    if recordings and (before or after):
        raise UsageError(f"{recordings[0]}: give two files, or --before FILE... --after FILE..., not both")
    if not recordings and not (before and after):
        raise UsageError("nothing to compare: give two files, or --before FILE... --after FILE...")
    if recordings and len(recordings) != 2:
        raise UsageError(
            f"{len(recordings)} files given; two are compared, more of them as --before FILE... --after FILE..."
        )
    return ([recordings[0]], [recordings[1]]) if recordings else (before, after)


def _read(path: Path) -> "Sweep":
    sweep = read_trace(path)
    for note in sweep.notes:
        print(shown(f"note: {sweep.id}: {note}"), file=sys.stderr)
    return sweep
