"""`pzctl diagnose`: where model and recording differ, and which physical effect the model lacks."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ....models.base.names import as_file_name, shown
from .fit import Accuracy, Columns, read_steps
from .fit_options import UsageError, comma_names

if TYPE_CHECKING:
    from ....fitters.engine.fitted_model import Diagnosable
    from ....fitters.interface import FitTask


def diagnose(
    recordings: Annotated[
        list[str] | None, typer.Argument(metavar="STEP=FILE...", help="Recordings by gluing step.")
    ] = None,
    build: Annotated[Path | None, typer.Option(help="build.toml; only the fitter `bvd` needs none.")] = None,
    fitter: Annotated[
        str,
        typer.Option(
            help="Whose model is diagnosed: mason, stack2d for one of finite diameter, or radial, disk, disk2d, bvd "
            "for what is no stack."
        ),
    ] = "mason",
    effects: Annotated[
        str | None, typer.Option(help="Consider only these effects, for example cable,bond-layer.")
    ] = None,
    unseen: Annotated[
        bool, typer.Option("--unseen", help="Include effects that could be present undetected in the uncertainties.")
    ] = False,
    hold_out: Annotated[
        Literal["bands", "repeats", "overtones", "steps"],
        typer.Option(help="Data to hold out of the fits and to test the findings on."),
    ] = "bands",
    other_sample: Annotated[
        list[Path] | None,
        typer.Option(help="Folder of another sample (build.toml, disk.csv ...) to test the findings on."),
    ] = None,
    accuracy: Accuracy = None,
    columns: Columns = None,
    learn: Annotated[
        bool,
        typer.Option(
            "--learn", help="Look for laws of what the catalogue does not explain; write all found to the build."
        ),
    ] = False,
    picture: Annotated[Path | None, typer.Option(help="File of the picture: .png, .svg or .pdf.")] = None,
    every: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Every sample of the journal, or of one FOLDER of sample folders (then without --all, too).",
        ),
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=64, help="Number of processes; without it, one on each core.")
    ] = None,
    dask: Annotated[str | None, typer.Option(help="With --all: use the Dask cluster at HOST:PORT.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Show where recordings and model differ, which physical effects the model lacks, and what cannot be decided.

    Example: pzctl diagnose --build build.toml disk=disk.csv ml1=ml1.csv
    """
    from ....fitters.diagnosis.diagnose import diagnose as run_diagnosis
    from ....fitters.diagnosis.inference.inflated_uncertainty import widened
    from ....fitters.engine.on_cores import available_cores
    from ....fitters.interface import FitTask
    from ....fitters.plugins import DEFAULT
    from ....fitters.population.joint_diagnosis import HowToDiagnose
    from ....fitters.user_effects import find_any_effect
    from ...files.builds.build_file import read_build
    from ...files.builds.effects_writing import append_effects
    from ...report.pictures.diagnosis_picture import diagnosis_picture
    from ...report.pictures.picture_file import check_picture
    from ...report.tables.diagnosis_output import diagnosis_curves, diagnosis_json, print_constants, print_diagnosis
    from ...report.terminal import console

    chosen = (
        None
        if effects is None
        else tuple(find_any_effect(name).name for name in comma_names("--effects", effects, "cable,bond-layer"))
    )
    every = every or _is_folder(recordings, build)
    if every or dask is not None:
        if fitter != DEFAULT:
            raise UsageError(f"--all diagnoses the model of {DEFAULT}; --fitter does not go with it")
        _check_all(
            every,
            {
                "build": build,
                "picture": picture,
                "other-sample": other_sample,
                "unseen": unseen or None,
                "columns": columns,
            },
        )
        if dask is not None and jobs:
            raise UsageError("--jobs does not go with --dask: its workers are the processes")
        from .diagnose_all import diagnose_all

        how = HowToDiagnose(chosen, hold_out, learn)
        diagnose_all(recordings or [], how, accuracy, dask, jobs, as_json=as_json)
        return
    stated = _of_one_sample(recordings, build, fitter)
    model = _model_of(fitter, learn=learn)
    if picture is not None:
        check_picture(picture)
    device = None if build is None else read_build(build)
    others = {str(folder): _sample_in(folder) for folder in other_sample or ()}
    screen = console(stderr=True)
    task = FitTask(device, read_steps(stated, accuracy, columns))
    with screen.status("diagnosing") as status:
        diagnosis = run_diagnosis(
            task,
            chosen,
            status.update,
            hold_out,
            others,
            learn,
            jobs=jobs or available_cores(),
            fitter=model,
            refuse_impossible=True,
        )
    if unseen:
        diagnosis = widened(diagnosis)
    shown_diagnosis = diagnosis_json(diagnosis)
    if as_json:
        print(json.dumps(shown_diagnosis))
    else:
        print_diagnosis(console(), shown_diagnosis)
        print_constants(console(), shown_diagnosis)
    if build is not None and learn and diagnosis.effects:
        console(stderr=as_json).print(append_effects(build, diagnosis.effects), soft_wrap=True)
    if picture is None and as_json:
        return
    recorded = Path(next(sweep.name for of_step in task.sweeps.values() for sweep in of_step)).stem
    target = picture or Path(f"{as_file_name(device.name if device else recorded)}-diagnosis.png")
    drawn = diagnosis_picture(shown_diagnosis, diagnosis_curves(diagnosis), device, target)
    console(stderr=as_json).print(f"picture: {drawn}", highlight=False, soft_wrap=True)


def _model_of(fitter: str, *, learn: bool) -> "Diagnosable | None":
    """Return the fitter whose model is diagnosed, None for stacks. Raises TaskError, PluginError, UsageError."""
    from ....fitters.diagnosis.diagnose import fitter_to_diagnose

    model = fitter_to_diagnose(fitter)
    if learn and model is not None:
        raise UsageError(f"--learn looks for laws in the layers of a stack, which the model of {fitter} is not")
    return model


def _is_folder(recordings: list[str] | None, build: Path | None) -> bool:
    """Return whether a folder of samples is given, which is diagnosed as with --all."""
    return build is None and len(recordings or ()) == 1 and Path((recordings or [""])[0]).is_dir()


def _of_one_sample(recordings: list[str] | None, build: Path | None, fitter: str) -> list[str]:
    """Return the recordings of one sample. Raises UsageError if they or the build are missing."""
    if not recordings:
        raise UsageError("no recording is given; STEP=FILE is needed, or --all")
    folder = next((one for one in recordings if Path(one).is_dir()), None)
    if folder is not None:
        raise UsageError(f"{folder} is a folder; STEP=FILE is needed, or nothing but one folder of samples")
    if build is None and len(recordings) == 1 and "=" not in recordings[0]:
        raise UsageError(f"{recordings[0]}: no such folder; one of samples is needed, or STEP=FILE")
    if build is None and fitter != "bvd":
        raise UsageError("no build is given; --build is needed, or --fitter bvd for an unknown device")
    return recordings


def _check_all(every: bool, others: "dict[str, object]") -> None:
    """Refuse options that exclude --all, and --dask without it. Raises UsageError."""
    if not every:
        raise UsageError("--dask needs --all")
    for name, value in others.items():
        if value is not None:
            raise UsageError(f"--{name} does not go with --all: each sample has its own")


def _sample_in(folder: Path) -> "FitTask":
    """Return the fit task of a sample's folder; print its notes on standard error. Raises NoSamplesError."""
    from ...samples.sample_selection import NoSamplesError, folder_sample

    sample = folder_sample(folder)
    for note in sample.notes:
        print(shown(f"note: {folder}: {note}"), file=sys.stderr)
    if sample.job is None:
        raise NoSamplesError(str(sample.error))
    return sample.job.task
