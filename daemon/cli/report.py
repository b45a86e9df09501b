"""`pzctl report`: one HTML file that says all there is to say of a sample."""

import json
from pathlib import Path
from typing import Annotated

import typer


def report(
    sample: Annotated[str, typer.Argument(help="Name of a sample, id of a measurement, or its build.toml.")],
    out: Annotated[Path | None, typer.Option(help="The file; SAMPLE.html where not given.")] = None,
    fitter: Annotated[str | None, typer.Option(help="Whose fits; the first that answered where not given.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Write a report of a sample: measured, constants, uncertainties, mismatch, provenance. Needs no daemon.

    The file needs nothing else: pictures are inside. A browser prints it as PDF.

    Exit status: 0 written, 1 nothing was measured or fitted, 2 no such sample.

    Example: pzctl report S4 --out S4.html
    """
    from ..report import report_html
    from ..reported import sample_record
    from ..samples import open_journal
    from ..terminal import console

    if sample.endswith(".toml"):
        from ..buildfile import read_build

        sample = read_build(Path(sample)).name
    journal = open_journal()
    try:
        record = sample_record(journal, sample)
    finally:
        journal.close()
    target = out or Path(f"{record.name.replace('/', '_')}.html")
    _write(target, report_html(record, fitter))
    if as_json:
        print(json.dumps({"sample": record.name, "report": str(target)}))
    else:
        console().print(f"report: {target}", highlight=False, soft_wrap=True, markup=False)


def _write(target: Path, text: str) -> None:
    from ...models.errors import PzctlError

    try:
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise PzctlError(f"{target}: the report cannot be written: {error.strerror or error}") from None
