"""The command line: one module for each command. Imports stay inside the commands, so that `--help` is quick."""

import inspect
import os
import sys
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from ...models.errors import PzctlError
from . import (
    compensate,
    diagnose,
    doctor,
    effects,
    export,
    fit,
    fitters,
    journal,
    keys,
    materials,
    measure,
    new,
    page,
    prove,
    report,
    samples,
    screenshot,
    service,
    show,
    simulator,
    status,
    watch,
)

app = typer.Typer(
    name="pzctl",
    help="Complex material constants of an ultrasound transducer, layer by layer, right after each gluing step.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.command("measure")(measure.measure)
app.command("fit")(fit.fit)
app.command("diagnose")(diagnose.diagnose)
app.command("status")(status.status)
app.add_typer(journal.app, name="journal")
app.add_typer(keys.app, name="keys")
app.command("samples")(samples.samples)
app.command("daemon")(service.daemon)
app.command("sim")(simulator.sim)
app.command("fitters")(fitters.fitters)
app.command("effects")(effects.effects)
app.command("materials")(materials.materials)
app.command("prove")(prove.prove)
app.command("doctor")(doctor.doctor)
app.command("show")(show.show)
app.command("export")(export.export)
app.command("report")(report.report)
app.command("compensate")(compensate.compensate)
app.command("screenshot")(screenshot.screenshot)
app.command("page")(page.page)
app.command("watch")(watch.watch)
app.command("new")(new.new)


def _with_quiet(work: Callable[..., None]) -> Callable[..., None]:
    """Return a command that knows --quiet besides."""

    @wraps(work)
    def quietly(*words: Any, quiet: bool, **options: Any) -> None:
        from ..terminal import be_quiet

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
        print(f"pzctl: {error}", file=sys.stderr)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        print("pzctl: stopped", file=sys.stderr)
        sys.exit(130)
