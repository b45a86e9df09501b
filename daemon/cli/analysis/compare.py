"""`pzctl compare`: what changed between two recordings of a device."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....models.base.names import shown
from ..help_text import Command
from .fit import Columns, read_trace
from .fit_options import UsageError

if TYPE_CHECKING:
    from ....models.build import Build
    from ....models.sweep import Sweep

_LISTS = ("--before", "--after")


class ListOptions(Command):
    """A command of which `--before` and `--after` each take all files up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option before each of its files, as the parser requires."""
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
    sample: Annotated[str | None, typer.Option(help="The last two recordings of this sample in the journal.")] = None,
    step: Annotated[
        str | None, typer.Option(help="The gluing step; of a sample, the last measured where none is said.")
    ] = None,
    build: Annotated[
        Path | None, typer.Option(help="build.toml of the device, to name changes inside by layer, bond and face.")
    ] = None,
    columns: Columns = None,
    picture: Annotated[Path | None, typer.Option(help="Where the picture goes, .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Say what changed between two recordings: at the terminals or in the device, by how much, how sure that is.

    Needs no model of the device; with --build, changes inside of it are named and sized. Several files after --before
    and --after are as many devices, in the same order; with --repeats they are repeats of one. One file before and
    several after: each is held against the one.

    Example: pzctl compare before.csv after.csv
    """
    from ...report.pictures.picture_file import check_picture

    files = [*(recordings or []), *(before or []), *(after or [])]
    if sample is not None and files:
        raise UsageError(f"--sample {sample}: give either a sample or files, not both")
    if step is not None and sample is None and build is None:
        raise UsageError(f"--step {step}: of which sample or build? Give --sample NAME or --build FILE as well")
    if picture is not None:
        check_picture(picture)
    known = None if build is None else _step_of(build, step)
    if sample is not None:
        _one(*_from_journal(sample, step), known, picture, as_json)
        return
    sides = _sides(recordings or [], before or [], after or [])
    own, other = (tuple(_read(path, columns) for path in side) for side in sides)
    if repeats or len(own) == len(other) == 1:
        _one(own, other, known, picture, as_json)
    elif build is not None:
        raise UsageError(f"--build {build} describes one device; give two files, or --repeats")
    else:
        _many((own, other), sides[1], picture, as_json)


def _step_of(path: Path, step: str | None) -> "tuple[Build, str]":
    """Return a build and the step of it that was recorded. Raises UsageError if there are several and none is said."""
    from ...files.builds.build_file import read_build

    build = read_build(path)
    names = [one.name for one in build.steps]
    if step is None and len(names) > 1:
        raise UsageError(f"{path} has the steps {', '.join(names)}; say which was recorded with --step STEP")
    return build, step or names[0]


def _one(
    own: "tuple[Sweep, ...]",
    other: "tuple[Sweep, ...]",
    known: "tuple[Build, str] | None",
    picture: Path | None,
    as_json: bool,
) -> None:
    """Compare two sides of one device, and print the result; `known`: its build and the recorded step."""
    from ....fitters.compare.compare import compare as find_out
    from ...report.json_output.comparison_json import comparison_json
    from ...report.pictures.comparison_picture import comparison_picture
    from ...report.tables.comparison_output import print_comparison
    from ...report.terminal import console

    with console(stderr=True).status("comparing"):
        build, step = known or (None, "")
        comparison = find_out(own, other, build, step)
    found = comparison_json(comparison)
    if as_json:
        print(json.dumps(found))
    else:
        print_comparison(console(), found)
    if picture is not None:
        drawn = comparison_picture(found, comparison.curve, picture)
        console(stderr=as_json).print(f"picture: {drawn}", highlight=False, soft_wrap=True)


def _many(
    sides: "tuple[tuple[Sweep, ...], tuple[Sweep, ...]]", files: list[Path], picture: Path | None, as_json: bool
) -> None:
    """Compare several devices, and print their common changes; `files` are those after."""
    from ....fitters.compare.many import compare_many
    from ...report.json_output.comparison_json import many_json
    from ...report.tables.comparison_output import print_many
    from ...report.terminal import console

    if picture is not None:
        raise UsageError(f"--picture {picture}: a picture shows one device; give two files, or --repeats")
    with console(stderr=True).status("comparing") as status:
        together = many_json(compare_many(*sides, status.update), [str(path) for path in files])
    if as_json:
        print(json.dumps(together))
    else:
        print_many(console(), together)


def _from_journal(sample: str, step: str | None) -> "tuple[tuple[Sweep, ...], tuple[Sweep, ...]]":
    """Return the last two recordings of a sample's step: of the last two measurements, or repeats of the last.

    Raises UnknownSampleError.
    """
    from ....models.sweep import Sweep
    from ...samples.sample_record import UnknownSampleError, step_sweeps
    from ...samples.sample_selection import open_journal

    journal = open_journal()
    try:
        found: list[Sweep] = step_sweeps(journal, sample, step)
    finally:
        journal.close()
    if len(found) < 2:
        of = f"step {step!r}" if step else "its last step"
        raise UnknownSampleError(f"sample {sample!r}: {len(found)} recording(s) of {of}; two are needed to compare")
    return (found[-2],), (found[-1],)


def _sides(recordings: list[Path], before: list[Path], after: list[Path]) -> tuple[list[Path], list[Path]]:
    """Return the files of both sides. Raises UsageError if they cannot be assigned."""
    if recordings and (before or after):
        raise UsageError(f"{recordings[0]}: give two files, or --before FILE... --after FILE..., not both")
    if not recordings and not (before and after):
        raise UsageError("nothing to compare: give two files, or --before FILE... --after FILE...")
    if recordings and len(recordings) != 2:
        raise UsageError(
            f"{len(recordings)} file(s) given; two are compared, more of them as --before FILE... --after FILE..."
        )
    return ([recordings[0]], [recordings[1]]) if recordings else (before, after)


def _read(path: Path, columns: str | None) -> "Sweep":
    sweep = read_trace(path, columns)
    for note in sweep.notes:
        print(shown(f"note: {sweep.name}: {note}"), file=sys.stderr)
    return sweep
