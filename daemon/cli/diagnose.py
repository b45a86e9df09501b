"""`pzctl diagnose`: where model and recording differ, and which physics was left out."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from .fit import read_steps
from .wishes import comma_names


def diagnose(
    recordings: Annotated[list[str], typer.Argument(metavar="STEP=FILE...", help="Recordings by gluing step.")],
    build: Annotated[Path, typer.Option(help="build.toml")],
    effects: Annotated[str | None, typer.Option(help="Only these effects, as cable,bond-layer.")] = None,
    unseen: Annotated[
        bool, typer.Option("--unseen", help="Let the uncertainties count what may be there unseen.")
    ] = False,
    hold_out: Annotated[
        Literal["bands", "repeats", "overtones"], typer.Option(help="What takes no part in the fits that prove it.")
    ] = "bands",
    picture: Annotated[Path | None, typer.Option(help="Where the picture goes, .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Say where recordings and model differ, which physics was left out, and what cannot be decided.

    Example: pzctl diagnose --build build.toml disk=disk.csv ml1=ml1.csv
    """
    from ...fitters.diagnosis.diagnose import diagnose as find_out
    from ...fitters.diagnosis.widened import widened
    from ...fitters.interface import FitTask
    from ...models.effects import find_effect
    from ..buildfile import read_build
    from ..diagnoses import diagnosis_curves, diagnosis_json, print_constants, print_diagnosis
    from ..diagnosis_picture import diagnosis_picture
    from ..picturefile import check_picture
    from ..terminal import console

    chosen = (
        None
        if effects is None
        else tuple(find_effect(name).name for name in comma_names("--effects", effects, "cable,bond-layer"))
    )
    if picture is not None:
        check_picture(picture)
    known = read_build(build)
    screen = console(stderr=True)
    task = FitTask(known, read_steps(recordings))
    with screen.status("diagnosing") as status:
        diagnosis = find_out(task, chosen, status.update, hold_out)
    if unseen:
        diagnosis = widened(diagnosis)
    found = diagnosis_json(diagnosis)
    if as_json:
        print(json.dumps(found))
    else:
        print_diagnosis(console(), found)
        if found["findings"] or unseen:
            print_constants(console(), diagnosis)
    if picture is None and as_json:
        return
    target = picture or Path(f"{known.name}-diagnosis.png")
    drawn = diagnosis_picture(found, diagnosis_curves(diagnosis), known, target)
    console(stderr=as_json).print(f"picture: {drawn}", highlight=False, soft_wrap=True)
