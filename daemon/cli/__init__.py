"""The command line: one module for each command. Imports stay inside the commands, so that `--help` is quick."""

import inspect
import os
import sys
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from ...models.base.errors import PzctlError
from ...models.base.names import shown
from .analysis import compare, diagnose, effects, fit, fitters, materials, prove
from .bench import measure, status, watch
from .bench import new_build as new
from .bench import page_command as page
from .lab import compensate, doctor, screenshot, simulator
from .lab import daemon as service
from .lab import keys_commands as keys
from .records import export, samples, show
from .records import journal_commands as journal
from .records import report_command as report

app = typer.Typer(
    name="pzctl",
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
            app.add_typer(_work, name=_command, rich_help_panel=_panel)
        else:
            app.command(_command, rich_help_panel=_panel, cls=_CLASSES.get(_command))(_work)


def _say_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"pzctl {version('pzctl')}")
        raise typer.Exit


@app.callback()
def pzctl(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version, and exit.")
    ] = False,
) -> None:
    """Complex material constants of an ultrasound transducer, layer by layer, right after each gluing step.

    Begin with `pzctl measure --fit`: the whole story on a simulated bench.

    Exit status: 0 done, 1 the answer is "cannot", 2 wrong usage, 130 stopped with Ctrl-C.
    """


def _with_quiet(work: Callable[..., None]) -> Callable[..., None]:
    """Return a command that knows --quiet besides."""

    @wraps(work)
    def quietly(*words: Any, quiet: bool, **options: Any) -> None:
        from ..report.terminal import be_quiet

        be_quiet(quiet)
        work(*words, **options)

    kind = Annotated[bool, typer.Option("--quiet", "-q", help="Nothing on standard error but errors and notes.")]
    more = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
    known = inspect.signature(work)
    quietly.__signature__ = known.replace(parameters=[*known.parameters.values(), more])  # type: ignore[attr-defined]
    quietly.__annotations__ = {**work.__annotations__, "quiet": kind}
    return quietly


for _room in (app, journal.app, keys.app):
    for _one in _room.registered_commands:
        if _one.callback is not None:
            _one.callback = _with_quiet(_one.callback)


def main() -> None:
    """Run the command line; what is wrong is one sentence on standard error, never a traceback.

    Exit status: 0 done; 1 the answer is "cannot"; 2 wrong usage, or something is wrong that one can put right;
    130 stopped with Ctrl-C.
    """
    # Our matrices are small: threads of the linear algebra would only get in each other's way.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except PzctlError as error:
        print(f"pzctl: {shown(str(error), keep=chr(10))}", file=sys.stderr)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        print("pzctl: stopped", file=sys.stderr)
        sys.exit(130)
