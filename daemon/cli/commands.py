"""All commands, grouped for `--help`; each module holds one, which imports what it needs when it runs."""

import inspect
import sys
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from .analysis import compare, diagnose, effects, fit, fitters, materials
from .bench import measure, status, watch
from .bench import new_build as new
from .bench import page_command as page
from .help_text import Command, Group
from .lab import compensate, doctor, screenshot, simulator
from .lab import daemon as service
from .lab import keys_commands as keys
from .proof import prove
from .records import chart, export, samples, show, trend
from .records import journal_commands as journal
from .records import report_command as report

app = typer.Typer(
    name="pzctl",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
_PANELS: dict[str, dict[str, Callable[..., None] | typer.Typer]] = {
    "Measure": {
        "measure": measure.measure,
        "page": page.page,
        "watch": watch.watch,
        "status": status.status,
        "new": new.new,
    },
    "Fit and diagnose": {
        "fit": fit.fit,
        "diagnose": diagnose.diagnose,
        "compare": compare.compare,
        "fitters": fitters.fitters,
        "effects": effects.effects,
        "materials": materials.materials,
        "prove": prove.prove,
    },
    "What was measured": {
        "samples": samples.samples,
        "chart": chart.chart,
        "trend": trend.trend,
        "show": show.show,
        "report": report.report,
        "export": export.export,
        "journal": journal.app,
    },
    "The instrument and the lab": {
        "doctor": doctor.doctor,
        "compensate": compensate.compensate,
        "screenshot": screenshot.screenshot,
        "sim": simulator.sim,
        "daemon": service.daemon,
        "keys": keys.app,
    },
}
_CLASSES = {"compare": compare.ListOptions}
for _panel, _commands in _PANELS.items():
    for _command, _work in _commands.items():
        if isinstance(_work, typer.Typer):
            app.add_typer(_work, name=_command, rich_help_panel=_panel, cls=Group)
        else:
            app.command(_command, rich_help_panel=_panel, cls=_CLASSES.get(_command, Command))(_work)


def _say_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        print(f"pzctl {version('pzctl')}")
        raise typer.Exit


@app.callback()
def pzctl(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Determine the complex material constants of an ultrasound transducer, layer by layer, after each gluing step.

    Begin with `pzctl measure --fit`: it measures and fits a whole transducer on a simulated bench.

    Exit status: 0 done, 1 no result possible, 2 wrong usage, 3 outside a limit, 4 not decided whether inside, 130
    stopped with Ctrl-C.
    """


def _with_quiet(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with the additional option --quiet, and a word on Ctrl-C."""

    @wraps(command)
    def quietly(*words: Any, quiet: bool, **options: Any) -> None:
        from ..report.terminal import be_quiet

        be_quiet(quiet)
        try:
            command(*words, **options)
        except KeyboardInterrupt as stop:  # Typer would end without a word
            print("; ".join(filter(None, ("pzctl: stopped", str(stop)))), file=sys.stderr)
            raise typer.Exit(130) from None

    kind = Annotated[bool, typer.Option("--quiet", "-q", help="On standard error, print only errors and notes.")]
    more = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
    known = inspect.signature(command)
    quietly.__signature__ = known.replace(parameters=[*known.parameters.values(), more])  # type: ignore[attr-defined]
    quietly.__annotations__ = {**command.__annotations__, "quiet": kind}
    return quietly


for _room in (app, journal.app, keys.app):
    for _registered in _room.registered_commands:
        if _registered.callback is not None:
            _registered.callback = _with_quiet(_registered.callback)
        if _room is not app:
            _registered.cls = Command
