"""`pzctl daemon`: the lab service in the foreground."""

import logging
from typing import Annotated, Any

import typer


def daemon(
    resource: Annotated[
        str | None, typer.Option(help="VISA resource of the analyzer, or recording:FILE; none: a simulated 4294A.")
    ] = None,
    events: Annotated[str, typer.Option(help="ZeroMQ endpoint that events are published on.")] = "tcp://127.0.0.1:*",
    requests: Annotated[str, typer.Option(help="ZeroMQ endpoint that requests are taken on.")] = "tcp://127.0.0.1:*",
    fitter: Annotated[list[str] | None, typer.Option(help="Fitter to keep running; may be repeated.")] = None,
    bench: Annotated[str | None, typer.Option(help="host:port of the bench of a simulated instrument.")] = None,
    time_scale: Annotated[float, typer.Option(help="Speed of the simulated 4294A; 1 is the real one's.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which sample lies on the simulated bench.")] = 0,
    stop: Annotated[bool, typer.Option("--stop", help="End the daemon that runs, and exit.")] = False,
) -> None:
    """Own the analyzer: measure on request, keep every sweep, publish it, and let fitters answer. Until Ctrl-C.

    Example: pzctl daemon --resource TCPIP0::192.168.0.17::5025::SOCKET
    """
    if stop:
        from ..client import connect

        with connect() as lab:
            lab.shutdown()
        return
    from ..service import Options, run

    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", level=logging.INFO)
    simulator: dict[str, Any] = {"time_scale": time_scale, "seed": seed}
    kept = tuple(fitter) if fitter else Options.fitters
    run(Options(resource, events, requests, fitters=kept, bench=bench, simulator=simulator))
