"""`pzctl daemon`: the lab service in the foreground."""

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer


def daemon(
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of the analyzer, or recording:FILE; default: a simulated 4294A.")
    ] = None,
    events: Annotated[str | None, typer.Option(help="ZeroMQ endpoint for publishing events.")] = None,
    requests: Annotated[str | None, typer.Option(help="ZeroMQ endpoint for receiving requests.")] = None,
    fitter: Annotated[list[str] | None, typer.Option(help="Fitter to keep running; may be repeated.")] = None,
    bench: Annotated[str | None, typer.Option(help="host:port of a simulated instrument's bench.")] = None,
    journal: Annotated[
        str | None, typer.Option(help="URL of a PostgreSQL database for the journal; default: the data folder.")
    ] = None,
    station: Annotated[
        str | None, typer.Option(help="Name of this bench in a shared journal; default: the name of this computer.")
    ] = None,
    time_scale: Annotated[
        float | None, typer.Option(help="Sweep time of the simulated 4294A relative to a real one.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the sample on the simulated bench.")] = None,
    max_bias: Annotated[float | None, typer.Option(help="Highest bias in volts that this bench allows.")] = None,
    max_oscillator: Annotated[
        float | None, typer.Option(help="Highest test signal in volts (rms) that this bench allows.")
    ] = None,
    compensation_days: Annotated[
        float | None, typer.Option(help="Days that a compensation is valid; a sweep under an older one says so.")
    ] = None,
    fit_seconds: Annotated[float | None, typer.Option(help="Seconds that one fit may take.")] = None,
    fit_memory: Annotated[int | None, typer.Option(help="Megabytes of address space that a fitter may use.")] = None,
    diagnose: Annotated[
        str | None, typer.Option(help="auto: diagnose every fit with a significant misfit; asked: only on request.")
    ] = None,
    log: Annotated[str | None, typer.Option(help="text, or json: one object a line.")] = None,
    page: Annotated[bool, typer.Option("--page", help="Also serve the live page, on this machine only.")] = False,
    page_port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 takes any free one.")] = 8294,
    build: Annotated[Path | None, typer.Option(help="build.toml for the page's buttons.")] = None,
    stop: Annotated[bool, typer.Option("--stop", help="Stop the running daemon and exit.")] = False,
) -> None:
    """Run the lab service until Ctrl-C: own the analyzer, measure, keep and publish every sweep, run fitters.

    Precedence of settings: flag, environment (PZCTL_RESOURCE ...), config.toml; see docs/service.md.

    Example: pzctl daemon --page --build S4.toml --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    if stop:
        from ...client.client import connect

        with connect() as lab:
            lab.shutdown()
        return
    from ...files.builds.build_file import THESIS_BUILD
    from ...files.config import options, settings
    from ...report.terminal import is_quiet
    from ...server.logs import begin_log
    from ...server.service import run

    flags = {"resource": resource, "events": events, "requests": requests, "fitters": fitter, "bench": bench}
    flags |= {"journal": journal, "station": station}
    flags |= {"max_bias_V": max_bias, "max_oscillator_V": max_oscillator}
    flags |= {"compensation_days": compensation_days}
    flags |= {"time_scale": time_scale, "seed": seed, "fit_seconds": fit_seconds, "fit_memory_MB": fit_memory}
    given = settings(flags | {"diagnose": diagnose, "log": log})
    begin_log(given.get("log", "text"))
    if is_quiet():
        logging.getLogger().setLevel(logging.WARNING)
    if not page:
        run(options(given))
        return
    from ...page.page_process import served_beside

    with served_beside(build or THESIS_BUILD, page_port) as address:
        if not is_quiet():
            print(f"page: {address}", file=sys.stderr)
        run(options(given))
