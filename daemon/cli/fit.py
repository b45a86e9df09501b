"""`pzctl fit`: recordings to constants, without a daemon."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...models.errors import PzctlError

if TYPE_CHECKING:
    from ...models.sweep import Sweep


_MEMORY = "@memory"


class UsageError(PzctlError):
    """A command line that does not say what is wanted."""


def parse_recordings(given: list[str]) -> dict[str, list[Path]]:
    """Return the files of each step from `STEP=FILE` words. Raises UsageError."""
    files: dict[str, list[Path]] = {}
    for word in given:
        step, equals, file = word.partition("=")
        if not (step and equals and file):
            raise UsageError(f"{word!r} is not STEP=FILE, for example disk=disk.csv")
        files.setdefault(step, []).append(Path(file))
    return files


def read_steps(given: list[str]) -> "dict[str, tuple[Sweep, ...]]":
    """Read the recordings of `STEP=FILE` words, by step; what is odd about one is said on standard error."""
    sweeps = {step: tuple(map(read_trace, paths)) for step, paths in parse_recordings(given).items()}
    for of_step in sweeps.values():
        for sweep in of_step:
            for note in sweep.notes:
                print(f"note: {sweep.id}: {note}", file=sys.stderr)
    return sweeps


def read_trace(path: Path) -> "Sweep":
    """Read a recording; of `FILE@memory`, the memory trace that a 4294A export may carry. Raises RecordingError."""
    from ...drivers.recordings import RecordingError, read_memory_trace, read_recording

    if not path.name.endswith(_MEMORY):
        return read_recording(path)
    memory = read_memory_trace(path.with_name(path.name.removesuffix(_MEMORY)))
    if memory is None:
        raise RecordingError(f"{path.name.removesuffix(_MEMORY)} carries no memory trace")
    return memory


def fit(
    recordings: Annotated[
        list[str] | None, typer.Argument(metavar="STEP=FILE...", help="Recordings by gluing step.")
    ] = None,
    build: Annotated[Path | None, typer.Option(help="build.toml; only the fitter `bvd` does without.")] = None,
    fitter: Annotated[list[str] | None, typer.Option(help="Fitter, see `pzctl fitters`; may be repeated.")] = None,
    free: Annotated[str | None, typer.Option(help="Constants to free, as disk.c33D,glue1.thickness.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Where the picture goes, .png or .svg.")] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every sample of the journal, or of one FOLDER of sample folders.")
    ] = False,
    dask: Annotated[str | None, typer.Option(help="With --all: on the Dask cluster at tcp://HOST:PORT.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fit complex constants to recordings. Several files of one step are repeats or further segments.

    Example: pzctl fit --build build.toml disk=disk.csv ml1=ml1.csv
    """
    if every or dask or not recordings:
        if not every:
            raise UsageError("--dask needs --all" if dask else "no recording is given; STEP=FILE is needed, or --all")
        if build or picture:
            raise UsageError(f"--{'build' if build else 'picture'} does not go with --all: each sample has its own")
        from .fitall import fit_all

        fit_all(recordings or [], fitter or [], tuple(free.split(",")) if free else None, dask, as_json=as_json)
        return
    from ...fitters.interface import FitTask
    from ...fitters.plugins import DEFAULT, load_fitter
    from ..answers import fit_json
    from ..buildfile import read_build

    known = read_build(build) if build is not None else None
    task = FitTask(known, read_steps(recordings), tuple(free.split(",")) if free else None)
    results = [load_fitter(name).fit(task) for name in fitter or [DEFAULT]]
    if as_json:
        objects = [fit_json(result) for result in results]
        print(json.dumps(objects[0] if len(objects) == 1 else {"fits": objects}))
        if picture is None:
            return
    from ..pictures import fit_picture
    from ..tables import print_fit
    from ..terminal import console

    screen = console(stderr=as_json)
    for result in results:
        if not as_json:
            print_fit(screen, result, known)
        target = picture or Path(f"{result.build}-{'-'.join(result.steps)}-{result.fitter}.png")
        if len(results) > 1 and picture is not None:
            target = picture.with_stem(f"{picture.stem}-{result.fitter}")
        screen.print(f"picture: {fit_picture(result, target)}", highlight=False, soft_wrap=True)
