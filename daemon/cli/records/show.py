"""`pzctl show`: the results of one sample as tables and pictures."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....models.base.names import as_file_name, shown

if TYPE_CHECKING:
    from rich.console import Console

    from ....models.build import Build
    from ...samples.sample_record import SampleRecord, StepRecord


def show(
    sample: Annotated[str, typer.Argument(help="Name of a sample, or id of a measurement; see `pzctl samples`.")],
    step: Annotated[str | None, typer.Option(help="Only this gluing step.")] = None,
    fitter: Annotated[str | None, typer.Option(help="Only fits of this fitter.")] = None,
    pictures: Annotated[Path | None, typer.Option(help="Folder for pictures, one for each fit.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Show the latest fits and diagnoses of a sample from the journal. Needs no daemon.

    Exit status: 0 shown, 1 nothing was measured yet, 2 no such sample.

    Example: pzctl show S4 --step ml1 --pictures .
    """
    from ...report.terminal import console
    from ...samples.sample_record import UnknownSampleError, sample_record
    from ...samples.sample_selection import open_journal

    journal = open_journal()
    try:
        record = sample_record(journal, sample)
    finally:
        journal.close()
    steps = [step_record for step_record in record.steps if step in (None, step_record.measurement.sample.step)]
    if not steps:
        measured = ", ".join(step_record.measurement.sample.step for step_record in record.steps)
        raise UnknownSampleError(f"sample {record.name!r}: step {step!r} was not measured; measured: {measured}")
    fitters = dict.fromkeys(fit.fitter for step_record in steps for fit in step_record.fits)
    if fitter is not None and fitters and fitter not in fitters:
        raise UnknownSampleError(
            f"sample {record.name!r}: there is no fit by {fitter!r}; fitted by {', '.join(fitters)}"
        )
    screen = console(stderr=as_json)
    plain: list[dict[str, Any]] = []
    for step_record in steps:
        drawings = _pictures(record, step_record, fitter, pictures)
        plain.append(_plain(step_record, record.build, fitter, drawings))
        if not as_json:
            _print(screen, record, step_record, fitter)
        for path in drawings.values():
            screen.print(f"picture: {path}", highlight=False, soft_wrap=True)
    if as_json:
        print(json.dumps({"sample": record.name, "steps": plain, "withdrawn": list(record.withdrawn)}))
        return
    for says in record.withdrawn:
        screen.print(f"! {shown(says)}", style="yellow", highlight=False, markup=False)


def _pictures(
    record: "SampleRecord", step_record: "StepRecord", fitter: str | None, folder: Path | None
) -> dict[str, Path]:
    from ...report.pictures.fit_pictures import fit_picture

    if folder is None:
        return {}
    return {
        fit.fitter: fit_picture(
            fit, folder / f"{as_file_name(record.name, step_record.measurement.sample.step, fit.fitter)}.png"
        )
        for fit in step_record.fits
        if fitter in (None, fit.fitter)
    }


def _plain(step_record: "StepRecord", build: "Build", fitter: str | None, drawings: dict[str, Path]) -> dict[str, Any]:
    from ...report.json_output.fit_json import fit_json

    fits = [fit_json(fit, build) for fit in step_record.fits if fitter in (None, fit.fitter)]
    for fit in fits:
        fit["picture"] = str(drawings[fit["fitter"]]) if fit["fitter"] in drawings else None
    return {
        "step": step_record.measurement.sample.step,
        "measurement": step_record.measurement.id,
        "time": step_record.measurement.time,
        "metadata": dict(step_record.metadata),
        "sweeps": [sweep.id for sweep in step_record.sweeps],
        "fits": fits,
        "refusals": list(step_record.refusals),
        "diagnosis": step_record.diagnosis.diagnosis if step_record.diagnosis else None,
    }


def _print(screen: "Console", record: "SampleRecord", step_record: "StepRecord", fitter: str | None) -> None:
    from ...report.tables.diagnosis_output import constant_rows, constants_table
    from ...report.tables.fit_tables import print_fit

    points = sum(sweep.frequency.size for sweep in step_record.sweeps)
    when = step_record.measurement.time[:19].replace("T", " ")
    screen.print(
        f"{shown(record.name)}, step {shown(step_record.measurement.sample.step)}: "
        f"{points} points in {len(step_record.sweeps)} sweep(s), {when} UTC",
        style="bold cyan",
        highlight=False,
    )
    if step_record.metadata:
        screen.print(", ".join(f"{key} {value}" for key, value in step_record.metadata.items()), highlight=False)
    fits = [fit for fit in step_record.fits if fitter in (None, fit.fitter)]
    for fit in fits:
        print_fit(screen, fit, record.build)
    for refusal in step_record.refusals:
        screen.print(f"! {refusal}", style="yellow", highlight=False, markup=False)
    if not fits and not step_record.refusals:
        screen.print("no fit yet; `pzctl fit --all` makes them", highlight=False)
    if step_record.diagnosis is not None:
        diagnosis = step_record.diagnosis.diagnosis
        for sentence in diagnosis.get("says", ()):
            screen.print(f"- {sentence}", highlight=False, markup=False)
        if diagnosis.get("findings") and len(constant_rows(diagnosis)) > 1:
            screen.print(constants_table(diagnosis))
