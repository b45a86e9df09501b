"""`pzctl samples`: the measurements of each sample, and statistics of the constants over all samples."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....models.base.names import shown
from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from ...journal.journal_reader import JournalMeasurement, JournalReader


def samples(
    constants: Annotated[
        bool, typer.Option("--constants", help="Show statistics of the constants over the samples.")
    ] = False,
    fitter: Annotated[
        str | None, typer.Option(help="With --constants: use this fitter's fits; default: mason.")
    ] = None,
    step: Annotated[str | None, typer.Option(help="With --constants: only fits of this gluing step.")] = None,
    csv: Annotated[
        Path | None, typer.Option(help="With --constants: write them as CSV, one row per sample, step and constant.")
    ] = None,
    parquet: Annotated[Path | None, typer.Option(help="The same as Parquet, with pyarrow.")] = None,
    xlsx: Annotated[Path | None, typer.Option(help="The same as an Excel workbook, with openpyxl.")] = None,
    every: Annotated[
        bool, typer.Option("--every", help="With a file: all measurements, not only the latest of each step.")
    ] = False,
    with_withdrawn: Annotated[
        bool, typer.Option("--with-withdrawn", help="With --constants: include withdrawn measurements.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List the samples of the journal, or with --constants mean and scatter of each constant over their latest fits.

    With --csv, --parquet or --xlsx the constants themselves are written as a flat table, of all fitters unless one is
    named.

    Examples: pzctl samples --constants --step disk

    pzctl samples --constants --xlsx constants.xlsx
    """
    from ...samples.sample_selection import open_journal

    if not constants and (fitter or step):
        raise UsageError(f"--{'fitter' if fitter else 'step'} needs --constants; the list shows all fitters and steps")
    if not constants and with_withdrawn:
        raise UsageError("--with-withdrawn needs --constants; the list shows withdrawn measurements in any case")
    files = {kind: path for kind, path in (("csv", csv), ("parquet", parquet), ("xlsx", xlsx)) if path is not None}
    _check_files(files, constants=constants, every=every)
    journal = open_journal()
    try:
        if files:
            _write(journal, files, (step, fitter), as_json, every=every, with_withdrawn=with_withdrawn)
        elif constants:
            _constants(journal, fitter, step, as_json, with_withdrawn=with_withdrawn)
        else:
            _list(journal, as_json)
    finally:
        journal.close()


def _check_files(files: dict[str, Path], *, constants: bool, every: bool) -> None:
    """Raise UsageError for options of the flat table without the table."""
    if files and not constants:
        raise UsageError(f"--{next(iter(files))} needs --constants: it writes the constants")
    if every and not files:
        raise UsageError("--every needs --csv, --parquet or --xlsx")


def _write(
    journal: "JournalReader",
    files: dict[str, Path],
    chosen: tuple[str | None, str | None],
    as_json: bool,
    *,
    every: bool,
    with_withdrawn: bool,
) -> None:
    from ...report.terminal import console
    from ...samples.constant_table import constants_of

    table = constants_of(journal, None, *chosen, every=every, with_withdrawn=with_withdrawn)
    writers = {"csv": table.write_csv, "parquet": table.write_parquet, "xlsx": table.write_xlsx}
    for kind, path in files.items():
        writers[kind](path)
    if as_json:
        print(json.dumps({"rows": len(table.rows), "files": [str(path) for path in files.values()]}))
        return
    for path in files.values():
        console().print(f"{path}: {len(table.rows)} rows", highlight=False, soft_wrap=True)


def _list(journal: "JournalReader", as_json: bool) -> None:
    by_sample: dict[str, list[JournalMeasurement]] = {}
    for measurement in journal.measurements():
        by_sample.setdefault(measurement.sample.name, []).append(measurement)
    if as_json:
        listed = [
            {"name": name, "measurements": [_plain(journal, measurement) for measurement in of_sample]}
            for name, of_sample in by_sample.items()
        ]
        print(json.dumps({"samples": listed}))
        return
    from rich.box import SIMPLE_HEAD

    from ...report.tables.unbroken_table import Column, UnbrokenTable
    from ...report.terminal import console

    further = Column("fits", prose=True), Column("id", spare=1)
    table = UnbrokenTable("sample", "step", "measured", *further, box=SIMPLE_HEAD)
    for name, of_sample in by_sample.items():
        for k, measured in enumerate(of_sample):
            fits = (
                ", ".join(journal.fitters(measured.id)) if measured.state == "measured" else _state(journal, measured)
            )
            when = f"{measured.time[:10]} {measured.time[11:19]} UTC"
            table.add_row("" if k else shown(name), shown(measured.sample.step), when, shown(fits), measured.id)
        table.add_section()
    console().print(table)


def _state(journal: "JournalReader", measurement: "JournalMeasurement") -> str:
    """Return the state of a measurement that is incomplete or withdrawn, in words."""
    from ...journal.stores.event_rows import WITHDRAWN
    from ...journal.withdrawal import withdrawal_of

    withdrawal = withdrawal_of(journal, measurement.id) if measurement.state == WITHDRAWN else None
    return withdrawal.says if withdrawal else measurement.state


def _plain(journal: "JournalReader", measurement: "JournalMeasurement") -> dict[str, Any]:
    from ...journal.withdrawal import withdrawal_of
    from ...samples.sample_record import noted

    withdrawal = withdrawal_of(journal, measurement.id)
    return {
        "id": measurement.id,
        "step": measurement.sample.step,
        "state": measurement.state,
        "withdrawn": {"by": withdrawal.by, "why": withdrawal.why, "time": withdrawal.time} if withdrawal else None,
        "time": measurement.time,
        "sweeps": list(journal.sweep_ids(measurement.id)),
        "fitters": list(journal.fitters(measurement.id)),
        "metadata": noted(journal, measurement),
    }


def _constants(
    journal: "JournalReader", fitter: str | None, step: str | None, as_json: bool, *, with_withdrawn: bool
) -> None:
    from ....fitters.plugins import DEFAULT
    from ....fitters.population.population_statistics import population
    from ...report.tables.population_table import population_json, print_population
    from ...report.terminal import console
    from ...samples.sample_selection import NoSamplesError, latest_fits, sheets_of

    fitter = fitter or DEFAULT
    fits = latest_fits(journal, fitter, step, with_withdrawn=with_withdrawn)
    if not fits:
        of_step = f" of step {step!r}" if step else ""
        raise NoSamplesError(
            f"the journal in {journal.name} holds no fit{of_step} by {fitter!r}; "
            f"`pzctl fit --all --fitter {fitter}` makes them"
        )
    statistics = population(
        {name: fit.result for name, fit in fits.items()}, sheets_of(fit.build for fit in fits.values())
    )
    if as_json:
        used = {
            name: {"measurement": fit.measurement.id, "time": fit.measurement.time, "steps": list(fit.result.steps)}
            for name, fit in fits.items()
        }
        print(json.dumps({"fitter": fitter, "fits": used} | population_json(statistics)))
    else:
        print_population(console(), statistics)
