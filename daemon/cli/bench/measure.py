"""`pzctl measure`: sweep each gluing step and, with --fit, print its constants at once."""

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....models.base.names import as_file_name
from ..analysis.fit import UsageError
from .note_options import NoteOptions, decimal
from .plan_check import check_plan
from .preparation import bring_to_step, check_refused, reached_steps
from .repeats import Pause, duration

if TYPE_CHECKING:
    from rich.console import Console

    from ....fitters.interface import FitResult
    from ....models.build import Build
    from ....models.sweep_plan import SweepPlan
    from ...client.client import Client
    from ...client.location import Location
    from ...client.result_waiter import Measurement
    from ...files.measurement_queue import QueuedStep
    from ...wire.events import ProgressEvent
    from ...wire.replies import AnalyzerState
    from .deciding_sweep import Diagnoser

_STORY_TIME_SCALE = 0.02
"""The simulated measurement runs fifty times faster than a real 4294A, which needs over four minutes per step."""


@dataclass
class Report:
    """The object that `--json` prints at the end."""

    build: str
    measurements: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    fits: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    diagnoses: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    refused: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    """The steps to which the simulated bench could not bring its device: `step`, and `says` why."""
    queue: str | None = None
    """Name of the queue; `build` is then the first sample."""
    truth: dict[str, Any] | None = None
    """The true constants of a simulated device; None for a real one."""


def measure(
    build: Annotated[Path | None, typer.Option(help="build.toml; without it, the thesis's transducer.")] = None,
    step: Annotated[str | None, typer.Option(help="One gluing step; without it, all of them in order.")] = None,
    sample: Annotated[str | None, typer.Option(help="Name of the sample, if one build serves many.")] = None,
    repeat: Annotated[int, typer.Option(min=1, max=100_000, help="Measure the step so many times.")] = 1,
    every: Annotated[
        str, typer.Option(metavar="TIME", help="With --repeat: from start to start, for example 30s, 10min or 2h.")
    ] = "0s",
    queue: Annotated[
        Path | None,
        typer.Option(help="Queue file: several samples and steps after each other; what is measured is skipped."),
    ] = None,
    fit: Annotated[bool, typer.Option("--fit", help="Fit after each step and print the constants.")] = False,
    fitter: Annotated[list[str] | None, typer.Option(help="Fitter to wait for; may be repeated.")] = None,
    resource: Annotated[str | None, typer.Option(help="VISA resource of the analyzer; none: a simulated one.")] = None,
    analyzer: Annotated[
        str | None, typer.Option(help="Name of the analyzer, if the daemon has several; default: the first.")
    ] = None,
    time_scale: Annotated[
        float | None, typer.Option(help="Speed of a simulated 4294A started here; 0.02 unless it is configured.")
    ] = None,
    adaptive: Annotated[
        bool, typer.Option("--adaptive", help="Find the resonances first, then measure around them, in the same time.")
    ] = False,
    diagnose: Annotated[
        bool, typer.Option("--diagnose", help="Diagnose each step, and propose sweeps that would decide.")
    ] = False,
    limits: Annotated[
        Path | None, typer.Option(help="Specification file to judge by; default: [limits] of the build file.")
    ] = None,
    operator: Annotated[str | None, typer.Option(help="Who measures; kept with the measurement.")] = None,
    temperature: Annotated[
        float | None, typer.Option(parser=decimal, metavar="CELSIUS", help="Temperature of the sample.")
    ] = None,
    mass: Annotated[
        str | None, typer.Option(metavar="GRAMS:U", help="Mass from the balance; with --step. Decides the density.")
    ] = None,
    batch: Annotated[str | None, typer.Option(help="Batch or lot.")] = None,
    barcode: Annotated[str | None, typer.Option(help="Barcode or serial number.")] = None,
    note: Annotated[
        list[str] | None, typer.Option(metavar="KEY=VALUE", help="Anything else to keep; may be repeated.")
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="With --diagnose: make the proposed sweeps without asking.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Measure a transducer step by step. Uses the running daemon, or starts one and says so.

    Without options it measures the whole transducer on a simulated bench: disk, first and second matching layer. For
    the settings of a daemon started here a flag precedes the environment (PZCTL_RESOURCE ...), which precedes
    config.toml.

    Exit status with --fit and limits: 0 passed, 3 a limit is not kept, 4 too uncertain to decide.

    Example: pzctl measure --build S4.toml --step ml1 --fit --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    from ...files.builds.build_check import needed_plan
    from ...report.terminal import console

    notes = NoteOptions(operator, temperature, mass, batch, barcode, note or ())
    notes.check(step)  # before anything is started
    wanted = tuple(fitter or (["mason"] if fit else []))
    screen = console(stderr=as_json)
    if queue is not None:
        given = {"--build": build, "--step": step, "--sample": sample, "--repeat": repeat > 1, "--every": every != "0s"}
        given |= {"--mass": mass, "--adaptive": adaptive, "--diagnose": diagnose}
        report = _by_queue(queue, limits, given, notes, (resource, analyzer, wanted, time_scale), screen)
        if as_json:
            print(json.dumps(asdict(report)))
        _exit_by_verdict(report)
        return
    device = _device(build, limits, sample)
    names = _steps(device, step, repeat)
    plan = needed_plan(device, str(build))
    pause = Pause(duration(every, "--every"))
    report = Report(device.name)
    with _kept_on_stop(report), _daemon(resource, analyzer, wanted, time_scale, screen) as (lab, on):
        check_plan(lab, on, device, plan)  # before anything is glued
        simulated = on.bench is not None
        diagnoser = _diagnoser(lab, device, on.name, screen, yes) if diagnose else None
        for name in reached_steps(lab, names, on, screen, report.refused):
            for _ in pause.starts(repeat, name, screen):
                noted = notes.noted(device, name)
                _one_step(lab, noted, name, on, wanted, screen, report, plan if adaptive else None)
                if diagnoser is not None:
                    report.diagnoses.append(diagnoser.step(name, report.measurements[-1]["id"]))
        if diagnoser is None:
            report.diagnoses += _in_the_background(lab, report, screen)
        if simulated:
            report.truth = lab.bench({"command": "truth"}, on.name)["constants"]
        if report.truth and report.fits:
            _against_truth(report.truth, report.fits[-1], screen)
    if as_json:
        print(json.dumps(asdict(report)))
    check_refused(report.refused)
    _exit_by_verdict(report)


def _by_queue(
    path: Path,
    limits: Path | None,
    given: dict[str, Any],
    notes: NoteOptions,
    daemon: tuple[str | None, str | None, tuple[str, ...], float | None],
    screen: "Console",
) -> Report:
    """Measure what is left of a queue file; `daemon`: resource, analyzer, fitters and time scale. Raises PzctlError."""
    from ...files.builds.limits_table import with_limits
    from .queue_run import QueueRun, check_queue, queued, refuse_finished, what_is_left

    wanted = queued(path, lambda build: with_limits(build, limits), given)
    refuse_finished(wanted)
    report = Report(wanted.steps[0].build.name, queue=wanted.name)
    fitters = daemon[2]
    with _kept_on_stop(report), _daemon(*daemon, screen) as (lab, on):

        def prepare(step: str) -> None:
            if on.bench is not None:
                bring_to_step(lab, step, on, screen)

        def measure(entry: "QueuedStep", noted: "Build") -> None:
            _one_step(lab, noted, entry.step, on, fitters, screen, report)

        left = what_is_left(wanted, screen)
        check_queue(left, notes, lambda build, plan: check_plan(lab, on, build, plan))  # before anything is glued
        QueueRun(left, screen).run(prepare, notes.noted, measure)
    return report


@contextmanager
def _kept_on_stop(report: Report) -> "Generator[None]":
    """Say on Ctrl-C which measurements are complete."""
    try:
        yield
    except KeyboardInterrupt as stop:
        times = Counter(f"{one['sample']} {one['step']}" for one in report.measurements)
        kept = ", ".join(f"{name} ({n} times)" if n > 1 else name for name, n in times.items())
        says = f"kept in the journal: {kept}" if kept else "no measurement was complete"
        raise KeyboardInterrupt("; ".join([says, *getattr(stop, "__notes__", ())])) from None


def _device(build: Path | None, limits: Path | None, sample: str | None) -> "Build":
    """Return the build, under the name of the sample. Raises BuildError."""
    from ...files.builds.build_check import check_build_name
    from ...files.builds.build_file import THESIS_BUILD, read_build
    from ...files.builds.limits_table import with_limits

    device = with_limits(read_build(build or THESIS_BUILD), limits)
    if sample is None:
        return device
    check_build_name(sample, "--sample")
    return replace(device, name=sample)


def _steps(device: "Build", step: str | None, repeat: int) -> list[str]:
    """Return the steps to measure. Raises UsageError."""
    names = [gluing_step.name for gluing_step in device.steps]
    if step is not None and step not in names:
        raise UsageError(f"--step {step}: build {device.name!r} has the steps {', '.join(names)}")
    if repeat > 1 and step is None and len(names) > 1:
        raise UsageError(f"--repeat {repeat} needs --step; build {device.name!r} has the steps {', '.join(names)}")
    return [step] if step else names


def _exit_by_verdict(report: Report) -> None:
    """End with the status of the worst verdict, if the build has limits."""
    verdicts = [fit["verdict"]["verdict"] for fit in report.fits if "verdict" in fit]
    if verdicts:
        from ....fitters.population.conformity import worst
        from ...report.tables.verdict_table import EXIT_STATUS

        sys.exit(EXIT_STATUS[worst(verdicts)])


@contextmanager
def _daemon(
    resource: str | None,
    analyzer: str | None,
    fitters: tuple[str, ...],
    time_scale: float | None,
    console: "Console",
) -> "Generator[tuple[Client, AnalyzerState]]":
    """Yield a client of the running daemon, or of one started here, and the analyzer to measure with.

    A daemon started here for a simulated bench is stopped afterwards; one for a real instrument keeps running. Raises
    DaemonError if the daemon does not own the analyzer.
    """
    from ....fitters.plugins import installed
    from ...client.client import connect
    from ...client.location import analyzer_at
    from ...client.protocol import DaemonError
    from ...client.result_waiter import require
    from ...files.config import options, settings
    from ...server.launch import running, start

    begun = time.time()
    place = running()
    started = place is None
    for name in fitters if started else ():
        installed(name)
    simulated = False
    if place is None:
        given = settings({"resource": resource, "time_scale": time_scale})
        daemon_options = options({"time_scale": _STORY_TIME_SCALE} | given)
        every = [own.resource or "a simulated 4294A" for own in daemon_options.every_analyzer.values()]
        simulated = not any(own.resource for own in daemon_options.every_analyzer.values())
        console.print(f"no daemon runs: starting one for {', '.join(every)}", style="dim")
        if fitters:
            daemon_options = replace(
                daemon_options, fitters=tuple(dict.fromkeys((*fitters, *given.get("fitters", ()))))
            )
        place = start(daemon_options)
    if resource is not None:
        found = analyzer_at(place, resource)
        if found is None:
            owned = ", ".join(place.analyzers.values()) or place.resource
            raise DaemonError(
                f"the running daemon owns {owned}, not {resource}; end it with `pzctl daemon --stop`", "owner"
            )
        analyzer = analyzer or found
    with connect(place.events, place.requests) as lab, _reason_told(place, begun):
        try:
            on = _analyzer(lab, analyzer)
            console.print(f"instrument: {on.instrument.name}", style="dim", highlight=False, soft_wrap=True)
            states = lab.status().fitters if fitters else ()
            for name in fitters:
                require(name, states)  # before anything is swept
            yield lab, on
        finally:
            alive = started and running() is not None  # it may have been killed in the meantime
            if alive and simulated:
                lab.shutdown()
            elif alive:
                console.print("the daemon keeps running; end it with `pzctl daemon --stop`", style="dim")


@contextmanager
def _reason_told(place: "Location", begun: float) -> "Generator[None]":
    """Add to the error of a daemon that has ended since `begun` (Unix time, s) why it ended, if it said so."""
    from ...client.protocol import DaemonError
    from ...server.launch import last_words, running

    try:
        yield
    except DaemonError as error:
        reason = last_words(place, begun) if error.code == "unreachable" and running() is None else ""
        if not reason:
            raise
        raise DaemonError(f"{error}; its last words: {reason}", error.code) from None


def _analyzer(lab: "Client", name: str | None) -> "AnalyzerState":
    """Return the analyzer of this name, or the first one. Raises UsageError."""
    owned = {one.name: one for one in lab.hello().analyzers}
    if name is not None and name not in owned:
        raise UsageError(f"--analyzer {name}: the daemon's analyzers are {', '.join(owned)}")
    return owned[name] if name is not None else next(iter(owned.values()))


def _one_step(
    lab: "Client",
    build: "Build",
    step: str,
    on: "AnalyzerState",
    fitters: tuple[str, ...],
    console: "Console",
    report: Report,
    adapt: "SweepPlan | None" = None,
) -> None:
    """Measure one step, with `adapt` by a plan adapted to it from that one, and show its fits."""
    from .adaptive_measure import adapted_plan

    plan = adapted_plan(lab, build, step, adapt, on, console) if adapt else None
    measurement = _sweep(lab, build, step, on.name, plan, console)
    ended = time.perf_counter()
    report.measurements.append(
        {
            "id": measurement.id,
            "sample": build.name,
            "step": step,
            "sweeps": [sweep.id for sweep in measurement.sweeps],
        }
    )
    points = sum(sweep.frequency.size for sweep in measurement.sweeps)
    console.print(f"{step}: {points} points in {len(measurement.sweeps)} sweep(s)", highlight=False)
    for fitter in fitters:
        _show(lab.wait_fit(fitter, measurement.id), build, ended, console, report)


def _diagnoser(lab: "Client", build: "Build", analyzer: str, console: "Console", yes: bool) -> "Diagnoser":
    from .deciding_sweep import Diagnoser

    def sweep(plan: "SweepPlan", step: str, decides: str) -> "Measurement":
        return _sweep(lab, build, step, analyzer, plan, console, decides)

    return Diagnoser(lab, build, console, sweep, yes)


def _in_the_background(lab: "Client", report: Report, console: "Console") -> list[dict[str, Any]]:
    """Return the daemon's own diagnoses of fits with a significant misfit, and print their sentences."""
    from ...files.auto_diagnosis import is_significant

    diagnoses: list[dict[str, Any]] = []
    wanted = [fit for fit in report.fits if is_significant(fit["chi2_per_dof"], fit["fitter"], lab.settings())]
    for fit in wanted:
        step = fit["steps"][-1]
        measurement = next(measured["id"] for measured in report.measurements if measured["step"] == step)
        with console.status(f"{step}: chi2/dof is {fit['chi2_per_dof']:.3g}; the daemon is finding out why"):
            diagnosis = lab.wait_diagnosis(measurement)
        diagnoses.append(diagnosis | {"step": step, "measurement": measurement})
        for sentence in diagnosis["says"]:
            console.print(f"{step}: {sentence}", style="yellow", highlight=False)
    if diagnoses:
        console.print("more: pzctl report, the live page, or pzctl measure --diagnose", style="dim")
    return diagnoses


def _sweep(
    lab: "Client",
    build: "Build",
    step: str,
    analyzer: str,
    plan: "SweepPlan | None",
    console: "Console",
    decides: str | None = None,
) -> "Measurement":
    with _progress_of(step, console) as tell:
        return lab.measure(build, step, plan, progress=tell, decides=decides, analyzer=analyzer)


@contextmanager
def _progress_of(step: str, console: "Console") -> "Generator[Callable[[ProgressEvent], None]]":
    """Yield what shows the progress of a sweep: as a bar in a terminal, as lines in a pipe."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    if not console.is_terminal:
        with console.status(step) as status:
            yield lambda event: status.update(f"{step}: {event.what}, {event.fraction:.0%}")
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as progress:
        task = progress.add_task(step, total=1.0)
        yield lambda event: progress.update(task, completed=event.fraction, description=f"{step}: {event.what}")


def _show(result: "FitResult", build: "Build", ended: float, console: "Console", report: Report) -> None:
    """Print one fit's table and draw its picture; print and record how long after the sweep the constants came."""
    from ...files.paths import home
    from ...report.json_output.fit_json import fit_json
    from ...report.pictures.fit_pictures import fit_picture
    from ...report.tables.fit_tables import print_fit

    print_fit(console, result, build)
    seconds = time.perf_counter() - ended
    picture = home() / "pictures" / f"{as_file_name(result.build, result.steps[-1], result.fitter)}.png"
    console.print(f"constants {seconds:.2f} s after the sweep", highlight=False)
    console.print(f"picture: {fit_picture(result, picture)}\n", highlight=False, soft_wrap=True)
    report.fits.append(fit_json(result, build) | {"seconds_after_sweep": seconds, "picture": str(picture)})


def _against_truth(truth: dict[str, Any], fit: dict[str, Any], console: "Console") -> None:
    """Print the deviation of the last fit from the simulated device's true constants, in stated uncertainties."""
    from ....models.base.plain_numbers import signed
    from ...report.tables.unbroken_table import Column, UnbrokenTable

    numbers = (Column(head, justify="right") for head in ("fitted", "true", "error", "|error|/u"))
    title = "Fitted constants compared with the simulated bench's true ones"
    table = UnbrokenTable("constant", *numbers, title=title)
    for name, fitted in fit["constants"].items():
        for part in ("re", "im"):
            true, value, u = truth.get(name, {}).get(part), fitted[part], fitted[f"u_{part}"]
            if true and u:
                label = f"{name}.{part}" if fitted["im"] else name
                error = f"{signed(100 * (value / true - 1), 2)} %"
                table.add_row(label, f"{value:.5g}", f"{true:.5g}", error, f"{abs(value - true) / u:.1f}")
    console.print(table)
