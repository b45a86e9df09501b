"""`pzctl compensate`: measure the fixture's compensation standard by standard, and keep it in a file."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from ..analysis.fit import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from ....drivers.base.analyzer import Analyzer
    from ....drivers.base.compensation import Compensation, Standard


def compensate(
    file: Annotated[Path, typer.Argument(help="File to write the compensation to, or with --apply to read it from.")],
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of the 4294A; default: PZCTL_RESOURCE or config.toml.")
    ] = None,
    standard: Annotated[
        list[str] | None, typer.Option(help="open, short or load, measured in this order; default: open and short.")
    ] = None,
    adapter: Annotated[str, typer.Option(help="OFF (none), M1, M2, APC7 or PROBE.")] = "OFF",
    fixture: Annotated[str, typer.Option(help="Name of the fixture, recorded with every sweep.")] = "",
    apply: Annotated[bool, typer.Option("--apply", help="Load the compensation in FILE into the instrument.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Measure the fixture open, shorted and, if requested, with a load; the instrument then corrects every sweep.

    The command says what to put into the fixture, waits for Enter, and refuses a reading that does not fit the
    standard. FILE keeps the arrays; `--apply` loads them into the same instrument later. Every sweep of the daemon
    records the compensation's date and fixture; with `compensation_days` in config.toml, a sweep under an older
    compensation says so.

    Example: pzctl compensate clips.json --fixture clips-2 --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    from ....drivers.base import compensation_file
    from ...files.compensation_record import CompensationRecord, keep_record
    from ...files.paths import compensation_file as record_file
    from ...files.paths import home
    from ...report.terminal import console
    from .instrument_access import own_analyzer

    if apply and (standard or adapter != "OFF" or fixture):
        raise UsageError(
            "--apply: the file gives standards, adapter and fixture; leave out --standard, --adapter and --fixture"
        )
    wanted = _standards(standard or ["open", "short"])
    screen = console(stderr=True)
    with own_analyzer(resource) as analyzer:
        if apply:
            stored = compensation_file.load(file, analyzer.capabilities)
            analyzer.restore(stored)
        else:
            stored = replace(_measured(analyzer, wanted, adapter, screen), fixture=fixture.strip())
            compensation_file.save(file, stored, analyzer.capabilities.model)
    adapter_name = analyzer.capabilities.adapters.get(stored.adapter, stored.adapter)
    record = CompensationRecord(adapter_name, tuple(stored.arrays), stored.taken, stored.fixture)
    keep_record(record_file(home()), stored.instrument, record)
    if as_json:
        answer = {"file": str(file), "standards": list(stored.arrays), "taken": stored.taken, "adapter": stored.adapter}
        print(json.dumps(answer | {"measured": not apply, "fixture": stored.fixture}))
        return
    arrays = ", ".join(stored.arrays)
    screen.print(
        f"{file}: {arrays}, taken {stored.taken}; the instrument corrects by it", highlight=False, soft_wrap=True
    )


def _standards(names: list[str]) -> "list[Standard]":
    from ....drivers.base.compensation import Standard

    known: tuple[Standard, ...] = get_args(Standard)
    for name in names:
        if name not in known:
            raise UsageError(f"--standard {name}: there are {', '.join(known)}")
    return [name for name in known if name in names]


def _measured(analyzer: "Analyzer", wanted: "list[Standard]", adapter: str, console: "Console") -> "Compensation":
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from ....drivers.base.analyzer import Progress as Step

    adapters = analyzer.capabilities.adapters
    if adapters and adapter not in adapters:
        raise UsageError(f"--adapter {adapter}: there are {', '.join(adapters)}")
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    progress = Progress(*columns, TimeRemainingColumn(), console=console, transient=True)
    task = progress.add_task("", total=1.0)

    def ask(what: str) -> None:
        progress.stop()  # so that the bar does not overwrite the question
        typer.prompt(f"{what} Then press Enter", default="", show_default=False, err=True)
        progress.start()

    def show(step: Step) -> None:
        progress.update(task, completed=step.fraction, description=step.what)

    try:
        return analyzer.compensate(wanted, ask, show, adapter=adapter)
    finally:
        progress.stop()
