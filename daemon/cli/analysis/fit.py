"""`pzctl fit`: material constants from recordings, without a daemon."""

import json
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import as_file_name, shown
from .fit_options import FitArguments, FitSelection, UsageError, check_options, free_names

if TYPE_CHECKING:
    from collections.abc import Callable

    from ....fitters.interface import FitResult
    from ....models.build import Build
    from ....models.sweep import Sweep


_MEMORY = "@memory"


def parse_recordings(given: list[str]) -> dict[str, list[Path]]:
    """Return the files of each step, read from `STEP=FILE` arguments. Raises UsageError."""
    files: dict[str, list[Path]] = {}
    for word in given:
        step, equals, file = word.partition("=")
        if not (step and equals and file):
            example = f"disk={word}" if word and not equals else "disk=disk.csv"
            raise UsageError(f"{word!r} is not STEP=FILE; say of which step it is the recording, for example {example}")
        if Path(file) in files.get(step, ()):
            raise UsageError(f"{word} is given twice; a repeat is another sweep of the same step, in a file of its own")
        files.setdefault(step, []).append(Path(file))
    return files


Columns = Annotated[
    str | None,
    typer.Option(help="Names of the columns of tables without header row, for example frequency_Hz,R_ohm,X_ohm."),
]
"""The option `--columns` of the commands that read files."""


LEAST_ACCURATE, MOST_ACCURATE = 10.0, 1e-4
"""Per cent of |Z|."""


def _percent(text: str) -> float:
    """Return an accuracy in per cent of |Z|. Raises UsageError."""
    with suppress(ValueError):
        if MOST_ACCURATE <= (value := float(text)) <= LEAST_ACCURATE:
            return value
    allowed = f"a number from {MOST_ACCURATE:g} to {LEAST_ACCURATE:g}, in per cent of |Z|, is allowed"
    raise UsageError(f"--accuracy is {text!r}; {allowed}")


Accuracy = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        parser=_percent,
        help="Accuracy of the analyzer in per cent of |Z|; without it 0.08, as of a 4294A.",
    ),
]
"""The option `--accuracy` of the commands that fit recordings."""


def read_steps(
    given: list[str], accuracy_percent: float | None = None, columns: str | None = None
) -> "dict[str, tuple[Sweep, ...]]":
    """Read the recordings named by `STEP=FILE` arguments, by step; print their notes on standard error.

    `accuracy_percent`: of the analyzer, in per cent of |Z|; None for what the file says or a 4294A's. `columns`: names
    of the columns of tables without header row.
    """
    from ...samples.sample_selection import by_number

    sweeps = {
        step: tuple(read_trace(path, columns) for path in by_number(paths))
        for step, paths in parse_recordings(given).items()
    }
    for of_step in sweeps.values():
        for sweep in of_step:
            for note in sweep.notes:
                print(shown(f"note: {sweep.name}: {note}"), file=sys.stderr)
    if accuracy_percent is None:
        return sweeps
    told = {"accuracy": accuracy_percent / 100}
    return {
        step: tuple(replace(sweep, settings={**sweep.settings, **told}) for sweep in of_step)
        for step, of_step in sweeps.items()
    }


def read_trace(path: Path, columns: str | None = None) -> "Sweep":
    """Read a recording; `FILE@memory` reads the memory trace that a 4294A export may hold. Raises RecordingError."""
    from ....drivers.recordings import RecordingError, read_memory_trace, read_recording

    if not path.name.endswith(_MEMORY):
        return read_recording(path, columns)
    memory = read_memory_trace(path.with_name(path.name.removesuffix(_MEMORY)))
    if memory is None:
        raise RecordingError(f"{path.name.removesuffix(_MEMORY)} carries no memory trace")
    return memory


def fit(
    recordings: Annotated[
        list[str] | None, typer.Argument(metavar="STEP=FILE...", help="Recordings by gluing step.")
    ] = None,
    build: Annotated[Path | None, typer.Option(help="build.toml; only the fitter `bvd` needs none.")] = None,
    fitter: Annotated[list[str] | None, typer.Option(help="Fitter, see `pzctl fitters`; may be repeated.")] = None,
    free: Annotated[str | None, typer.Option(help="Constants to free, for example disk.c33D,glue1.thickness.")] = None,
    hold: Annotated[str | None, typer.Option(help="Constants to hold, for example glue1.z,area.")] = None,
    tie: Annotated[
        list[str] | None,
        typer.Option(help="Two constants to keep equal, for example glue2.z=glue1.z; may be repeated."),
    ] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="NAME=VALUE:UNCERTAINTY in SI units, for example ml1.z=10.3e6:0.5e6.")
    ] = None,
    bound: Annotated[list[str] | None, typer.Option(help="NAME=LOWEST:HIGHEST in SI units.")] = None,
    objective: Annotated[str, typer.Option(help="log (noise-weighted ln Z), thesis (sum |w dZ|^2) or kt2.")] = "log",
    uncertainty: Annotated[str, typer.Option(help="covariance, profile or bootstrap.")] = "covariance",
    sequential: Annotated[
        bool, typer.Option(help="Step by step; each starts from the result of the step before.")
    ] = False,
    freeze: Annotated[
        bool, typer.Option(help="Step by step, with the earlier constants frozen (as in the thesis).")
    ] = False,
    accuracy: Accuracy = None,
    columns: Columns = None,
    limits: Annotated[
        Path | None, typer.Option(help="Specification file to judge by; default: [limits] of the build file.")
    ] = None,
    budget: Annotated[bool, typer.Option(help="Show what contributes to the uncertainties.")] = False,
    picture: Annotated[Path | None, typer.Option(help="File of the picture: .png, .svg or .pdf.")] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Fit every sample of the journal, or of one FOLDER of sample folders.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=64, help="With --all: number of processes; without it, one on each core.")
    ] = None,
    dask: Annotated[str | None, typer.Option(help="With --all: use the Dask cluster at HOST:PORT.")] = None,
    with_withdrawn: Annotated[
        bool, typer.Option("--with-withdrawn", help="With --all: include withdrawn measurements of the journal.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fit complex constants to recordings. Several files of one step are repeats or further segments.

    They are taken in the order of their numbers (disk, disk-2, disk-10), or as given if their names differ in more.

    Exit status with limits: 0 passed, 3 a limit is not kept, 4 the uncertainty is too large to decide.

    Example: pzctl fit --build build.toml disk=disk.csv ml1=ml1.csv
    """
    arguments = FitArguments(hold, tie or (), prior or (), bound or (), objective, uncertainty, sequential, freeze)
    frees = free_names(free)
    wanted = FitSelection(frees, arguments.amendments(frees), arguments.options())
    if every or dask is not None or jobs or with_withdrawn or not recordings:
        of_all = {"--dask": dask, "--jobs": jobs, "--with-withdrawn": with_withdrawn}
        needs_all = next((name for name, value in of_all.items() if value), None)
        if dask is not None and jobs:
            raise UsageError("--jobs does not go with --dask: its workers are the processes")
        _check_all(
            every,
            needs_all,
            {
                "build": build,
                "picture": picture,
                "accuracy": accuracy,
                "budget": budget or None,
                "limits": limits,
                "columns": columns,
            },
        )
        from .fit_all import fit_all

        fit_all(recordings or [], fitter or [], wanted, dask, jobs, as_json=as_json, with_withdrawn=with_withdrawn)
        return
    if picture is not None:
        from ...report.pictures.picture_file import check_picture

        check_picture(picture)
    results, known = _fitted(build, limits, fitter or [], wanted, lambda: read_steps(recordings, accuracy, columns))
    if as_json:
        from ...report.json_output.fit_json import fit_json

        objects = [fit_json(result, known) for result in results]
        print(json.dumps(objects[0] if len(objects) == 1 else {"fits": objects}))
    if picture is not None or not as_json:
        _show(results, known, picture, as_json=as_json, budget=budget)
    _exit_by_verdict(results, known)


def _exit_by_verdict(results: "list[FitResult]", build: "Build | None") -> None:
    """End with the status of the worst verdict, if the build has limits."""
    if build is None or build.specification is None:
        return
    from ....fitters.population.conformity import judged, worst
    from ...report.tables.verdict_table import EXIT_STATUS

    sys.exit(EXIT_STATUS[worst([one.verdict for result in results if (one := judged(result, build))])])


def _check_all(every: bool, needs_all: str | None, others: "dict[str, object]") -> None:
    """Refuse options that exclude --all, and options that need it. Raises UsageError."""
    if not every:
        raise UsageError(
            f"{needs_all} needs --all" if needs_all else "no recording is given; STEP=FILE is needed, or --all"
        )
    for name, value in others.items():
        if value is not None:
            raise UsageError(f"--{name} does not go with --all: each sample has its own")


def _fitted(
    build: Path | None,
    limits: Path | None,
    names: list[str],
    wanted: FitSelection,
    recordings: "Callable[[], dict[str, tuple[Sweep, ...]]]",
) -> "tuple[list[FitResult], Build | None]":
    """Return the result of each fitter, and the build with the amendments. Raises PzctlError."""
    from ....fitters.engine.parameters.overrides import Amendments, amended
    from ....fitters.interface import FitTask
    from ....fitters.plugins import DEFAULT, load_fitter, run
    from ...files.builds.build_file import read_build
    from ...files.builds.limits_table import with_limits
    from ...report.terminal import console

    fitters = [load_fitter(name) for name in dict.fromkeys(names or [DEFAULT])]
    for fitter in fitters:
        check_options(fitter, wanted.options)
    known = read_build(build) if build is not None else None
    if known is not None:
        known = amended(with_limits(known, limits), wanted.amendments)
    elif limits is not None:
        raise UsageError("--limits names layers of a build; give --build as well")
    elif wanted.amendments != Amendments():
        raise UsageError("--hold, --tie, --prior and --bound name constants of a build; give --build as well")
    task = FitTask(known, recordings(), wanted.free, wanted.options)
    results: list[FitResult] = []
    for fitter in fitters:
        with console(stderr=True).status(fitter.name) as status:
            results.append(run(fitter, task, lambda what, of=fitter, on=status: on.update(f"{of.name}: {what}")))
    return results, known


def _show(
    results: "list[FitResult]", known: "Build | None", picture: Path | None, *, as_json: bool, budget: bool
) -> None:
    """Print tables and budgets, and draw the pictures; with `as_json`, draw the pictures only."""
    from ...report.pictures.fit_pictures import fit_picture
    from ...report.tables.budget_table import print_budget
    from ...report.tables.fit_tables import print_fit
    from ...report.terminal import console

    screen = console(stderr=as_json)
    for result in results:
        if not as_json:
            print_fit(screen, result, known)
            if budget:
                print_budget(screen, result)
        device = result.build if known is not None else Path(result.build).stem  # its recording stands for it
        target = picture or Path(f"{as_file_name(device, *result.steps, result.fitter)}.png")
        if len(results) > 1 and picture is not None:
            target = picture.with_stem(f"{picture.stem}-{result.fitter}")
        screen.print(f"picture: {fit_picture(result, target)}", highlight=False, soft_wrap=True)
