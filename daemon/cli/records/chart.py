"""`pzctl chart`: control charts of a constant over the samples, and the capability of the process."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.names import as_file_name

if TYPE_CHECKING:
    from rich.console import Console

    from ...samples.process_chart import ProcessChart


def chart(
    constant: Annotated[str, typer.Argument(help="Such as disk.c33D or disk.kt; disk.c33D.im: its imaginary part.")],
    step: Annotated[str | None, typer.Option(help="Only fits of this gluing step.")] = None,
    fitter: Annotated[str | None, typer.Option(help="Use this fitter's fits; default: mason.")] = None,
    baseline: Annotated[
        int | None, typer.Option(min=3, help="Number of first samples that set the control limits; default: all.")
    ] = None,
    limits: Annotated[
        Path | None, typer.Option(help="Specification file; default: [limits] of the newest sample's build.")
    ] = None,
    with_withdrawn: Annotated[bool, typer.Option("--with-withdrawn", help="Include withdrawn measurements.")] = False,
    picture: Annotated[Path | None, typer.Option(help="File of the picture: .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Show Shewhart and EWMA charts of a constant over the samples, which samples left them, and Cp, Cpk, Pp, Ppk.

    Exit status: 0 in control, 1 too few samples, 3 a sample left the control limits.

    Example: pzctl chart disk.c33D --step disk --picture c33D.png
    """
    from ....fitters.plugins import DEFAULT
    from ...report.pictures.control_chart_picture import control_chart_figure
    from ...report.pictures.picture_file import check_picture, save_picture
    from ...report.terminal import console
    from ...samples.process_chart import process_chart
    from ...samples.sample_selection import open_journal

    if picture is not None:
        check_picture(picture)
    journal = open_journal()
    try:
        shown = process_chart(
            journal,
            constant,
            fitter=fitter or DEFAULT,
            step=step,
            baseline=baseline,
            limits=limits,
            with_withdrawn=with_withdrawn,
        )
    finally:
        journal.close()
    target = picture or Path(f"{as_file_name('chart', constant)}.png")
    if picture is not None or not as_json:
        save_picture(control_chart_figure(shown.chart, shown.title, shown.unit, shown.limit), target, dpi=110)
    if as_json:
        print(json.dumps(shown.json()))
    else:
        _print(console(), shown)
        console().print(f"picture: {target}", highlight=False, soft_wrap=True)
    if shown.chart.left:
        sys.exit(3)


def _print(screen: "Console", shown: "ProcessChart") -> None:
    from rich.box import SIMPLE_HEAD

    from ....models.base.uncertain_numbers import with_uncertainty
    from ...report.tables.unbroken_table import Column, UnbrokenTable
    from ...report.tables.verdict_table import limits_text

    chart = shown.chart
    unit = "" if shown.unit == "1" else f" {shown.unit}"
    screen.print(
        f"{shown.title}: {len(chart.points)} samples; centre {chart.centre:.5g}{unit}, sigma {chart.sigma:.2g}, "
        f"control limits {limits_text(chart.low, chart.high)}",
        style="bold",
        highlight=False,
    )
    signals = Column("signals", prose=True)
    table = UnbrokenTable("sample", "measured", "value", "EWMA", signals, box=SIMPLE_HEAD)
    for point in chart.points:
        style = "bold red" if point.signals else None
        cells = (with_uncertainty(point.value, point.u), f"{point.ewma:.5g}", "; ".join(point.signals))
        table.add_row(point.sample, f"{point.time[:10]} {point.time[11:16]}", *cells, style=style)
    screen.print(table)
    if chart.capability is not None and shown.limit is not None:
        capable = chart.capability
        both = "" if capable.cp is None or capable.pp is None else f"Cp {capable.cp:.2f}, Pp {capable.pp:.2f}, "
        screen.print(
            f"capability for {limits_text(shown.limit.low, shown.limit.high)}{unit}: {both}Cpk {capable.cpk:.2f} "
            f"(95 %: above {capable.cpk_low:.2f}), Ppk {capable.ppk:.2f}",
            highlight=False,
        )
    for sentence in chart.says:
        screen.print(f"! {sentence}", style="yellow", highlight=False)
