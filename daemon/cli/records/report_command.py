"""`pzctl report`: the complete report of a sample in one HTML or PDF file."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ....models.base.names import as_file_name
from ..analysis.fit import UsageError

KINDS = (".html", ".pdf")
"""Allowed file name extensions."""


def report(
    sample: Annotated[str, typer.Argument(help="Name of a sample, id of a measurement, or its build.toml.")],
    out: Annotated[Path | None, typer.Option(help="The file, .html or .pdf; default: SAMPLE.html.")] = None,
    fitter: Annotated[
        str | None, typer.Option(help="Show this fitter's fits; default: the first fitter that answered.")
    ] = None,
    limits: Annotated[
        Path | None, typer.Option(help="Specification file to judge by; default: [limits] of the sample's build.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Write a report of a sample: recordings, constants, uncertainties, misfit, provenance. Needs no daemon.

    The file holds its pictures and needs no others. A name that ends with .pdf makes a PDF.

    Exit status: 0 written, 1 nothing was measured or fitted, 2 no such sample or kind of file.

    Example: pzctl report S4 --out S4.pdf
    """
    from ...files.builds.limits_table import with_limits
    from ...report.document.html_report import report_html
    from ...report.terminal import console
    from ...samples.sample_record import sample_record
    from ...samples.sample_selection import open_journal

    if sample.endswith(".toml"):
        from ...files.builds.build_file import read_build

        sample = read_build(Path(sample)).name
    if out is not None and out.suffix.lower() not in KINDS:
        raise UsageError(f"--out {out}: the name ends with {out.suffix!r}; allowed are {', '.join(KINDS)}")
    journal = open_journal()
    try:
        record = sample_record(journal, sample)
    finally:
        journal.close()
    if limits is not None:
        record = replace(record, build=with_limits(record.build, limits))
    target = out or Path(f"{as_file_name(record.name)}.html")
    _write(target, report_html(record, fitter))
    if as_json:
        print(json.dumps({"sample": record.name, "report": str(target)}))
    else:
        console().print(f"report: {target}", highlight=False, soft_wrap=True, markup=False)


def _write(target: Path, html: str) -> None:
    from ....models.base.errors import PzctlError

    if target.suffix.lower() == ".pdf":
        from ...report.document.pdf_report import report_pdf

        data = report_pdf(html)
    else:
        data = html.encode()
    try:
        target.write_bytes(data)
    except OSError as error:
        raise PzctlError(f"{target}: the report cannot be written: {error.strerror or error}") from None
