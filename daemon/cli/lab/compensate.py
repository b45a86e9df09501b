"""`pzctl compensate`: measure what the fixture adds, step by step, and keep it."""

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
    file: Annotated[Path, typer.Argument(help="Where the compensation is kept, or was.")],
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of the 4294A; none: that of PZCTL_RESOURCE or config.toml.")
    ] = None,
    standard: Annotated[
        list[str] | None, typer.Option(help="open, short or load, in this order; open and short where none is given.")
    ] = None,
    adapter: Annotated[str, typer.Option(help="OFF (none), M1, M2, APC7 or PROBE.")] = "OFF",
    fixture: Annotated[str, typer.Option(help="What the fixture is called; every sweep says so.")] = "",
    apply: Annotated[bool, typer.Option("--apply", help="Give the instrument what FILE holds.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Measure the fixture open, shorted and, where wanted, with a load; every later sweep is corrected by it.

    Says what to put into the fixture, waits for Enter, and refuses a standard that is not what it should be. FILE keeps
    the arrays; `--apply` gives them back to the same instrument later. Date and fixture are written down, and go with
    every sweep that the daemon takes; with `compensation_days` in config.toml each says where that was too long ago.

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
            "--apply: standards, adapter and fixture are those of the file; leave --standard, --adapter and --fixture "
            "away"
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
    between = analyzer.capabilities.adapters.get(stored.adapter, stored.adapter)
    record = CompensationRecord(between, tuple(stored.arrays), stored.taken, stored.fixture)
    keep_record(record_file(home()), stored.instrument, record)
    if as_json:
        told = {"file": str(file), "standards": list(stored.arrays), "taken": stored.taken, "adapter": stored.adapter}
        print(json.dumps(told | {"measured": not apply, "fixture": stored.fixture}))
        return
    held = ", ".join(stored.arrays)
    screen.print(
        f"{file}: {held}, taken {stored.taken}; the instrument corrects by it", highlight=False, soft_wrap=True
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
        progress.stop()  # a bar and a question do not share a line
        typer.prompt(f"{what} Then press Enter", default="", show_default=False, err=True)
        progress.start()

    def show(step: Step) -> None:
        progress.update(task, completed=step.fraction, description=step.what)

    try:
        return analyzer.compensate(wanted, ask, show, adapter=adapter)
    finally:
        progress.stop()
