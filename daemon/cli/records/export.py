"""`pzctl export`: recordings of the journal as files for other programs."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import as_file_name
from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ....models.sweep import Sweep
    from ...samples.sample_record import SampleRecord

FORMATS = {"csv": ".csv", "touchstone": ".s1p", "netcdf": ".nc", "hdf5": ".h5", "spice": ".cir", "mason": ".cir"}


def export(
    sample: Annotated[str, typer.Argument(help="Name of a sample, or id of a measurement; see `pzctl samples`.")],
    to: Annotated[Path, typer.Option(help="Folder for the files; made if missing.")] = Path(),
    form: Annotated[
        str, typer.Option("--format", help="csv, touchstone, netcdf, hdf5, spice or mason (circuits).")
    ] = "csv",
    step: Annotated[str | None, typer.Option(help="Only this gluing step.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Write the sweeps of a sample, one file each, with settings and provenance. Needs no daemon.

    Files are called SAMPLE-STEP-SEGMENT; `pzctl fit STEP=FILE ...` reads them back. Sweeps that decided a diagnosis
    are called SAMPLE-STEP-decides-NUMBER; `pzctl diagnose` needs them, too. Two formats are subcircuits for circuit
    simulators: `spice` is the equivalent circuit of each sweep, fitted by `bvd`; `mason` is the fitted stack of
    each step, its layers as lossy transmission lines.

    Example: pzctl export S4 --to data --format netcdf
    """
    from ...report.terminal import console
    from ...samples.sample_record import UnknownSampleError, sample_record
    from ...samples.sample_selection import open_journal

    if form not in FORMATS:
        raise UsageError(f"--format {form}: no such format; allowed are {', '.join(FORMATS)}")
    journal = open_journal()
    try:
        record = sample_record(journal, sample)
    finally:
        journal.close()
    measured = [step_record.measurement.sample.step for step_record in record.steps]
    if step is not None and step not in measured:
        raise UnknownSampleError(
            f"sample {record.name!r}: step {step!r} was not measured; measured: {', '.join(measured)}"
        )
    written = _write(record, step, form, to)
    if as_json:
        print(json.dumps({"sample": record.name, "files": [str(path) for path in written]}))
        return
    for path in written:
        console().print(str(path), highlight=False, soft_wrap=True, markup=False)


def _write(record: "SampleRecord", step: str | None, form: str, folder: Path) -> list[Path]:
    """Write every sweep and return the files. Raises RecordingError."""
    from ....drivers.recordings import RecordingError, write_csv, write_hdf5, write_netcdf, write_touchstone
    from .mason_export import write_mason

    writers: dict[str, Callable[[Sweep, Path], None]] = {
        "csv": write_csv,
        "touchstone": write_touchstone,
        "netcdf": write_netcdf,
        "hdf5": write_hdf5,
        "spice": _write_spice,
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder}: this folder cannot be made: {error.strerror or error}") from None
    files: list[Path] = []
    for step_record in record.steps:
        if step in (None, step_record.measurement.sample.step):
            stem = as_file_name(record.name, step_record.measurement.sample.step)
            if form == "mason":
                files.append(folder / f"{stem}.cir")
                write_mason(record.build, step_record, files[-1])
                continue
            named = {f"{stem}-{k}": sweep for k, sweep in enumerate(step_record.sweeps, start=1)}
            if form != "spice":  # a wide sweep has more resonances than one circuit
                named |= {f"{stem}-decides-{k}": sweep for k, sweep in enumerate(step_record.deciding, start=1)}
            for name, measured in named.items():
                sweep = replace(measured, settings={**step_record.metadata, **measured.settings})
                files.append(folder / f"{name}{FORMATS[form]}")
                writers[form](sweep, files[-1])
    return files


def _write_spice(sweep: "Sweep", path: Path) -> None:
    """Write the equivalent circuit of a sweep. Raises FitError, RecordingError."""
    from ....drivers.recordings.atomic_file import write_whole
    from ....fitters.interface import FitTask
    from ....fitters.layered.bvd import ButterworthVanDyke, circuit_of
    from ....fitters.plugins import run
    from ....models.circuits.spice import spice_subcircuit

    result = run(ButterworthVanDyke(), FitTask(None, {path.stem: (sweep,)}))
    low, high = float(sweep.frequency[0]) / 1e6, float(sweep.frequency[-1]) / 1e6
    comments = (
        f"{path.stem}: Butterworth-Van Dyke circuit, fitted by pzctl from {low:.4g} to {high:.4g} MHz",
        f"relative error of Z there: {result.rms_log_error:.2g} (rms)",
    )
    write_whole(path, spice_subcircuit(circuit_of(result), path.stem, comments).encode())
