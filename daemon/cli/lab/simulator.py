"""`pzctl sim`: a simulated analyzer on its raw socket."""

from typing import Annotated

import typer


def sim(
    model: Annotated[str | None, typer.Option(help="Which analyzer: 4294A (the default) or E4990A.")] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Raw socket of the instrument; 0 takes any free port.")
    ] = 5025,
    bench_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the bench: the next gluing step is done there.")
    ] = 5026,
    time_scale: Annotated[float, typer.Option(help="Length of a sweep against the real one; 0 answers at once.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which sample lies on the bench, and which noise.")] = 0,
    jig: Annotated[str, typer.Option(help="The fixture: compensated, coax, clips ...")] = "compensated",
    noise: Annotated[bool, typer.Option(help="Random noise as the analyzer has it.")] = True,
    radial: Annotated[bool, typer.Option("--radial", help="The disk has its radial modes too.")] = False,
    prologix_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of a Prologix-style GPIB front, often 1234.")
    ] = None,
    ftp_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of its FTP server (needs aioftp), as 2121.")
    ] = None,
    off: Annotated[bool, typer.Option("--off", help="Systematic error within the analyzer's accuracy.")] = False,
    hidden: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Physics to hide, in SI; may be repeated. See below."),
    ] = None,
) -> None:
    """Run a simulated Agilent 4294A (or Keysight E4990A) with a virtual bench behind it, until Ctrl-C.

    What --hidden knows: lead-inductance (H), series-resistance (ohm), stray-capacitance (F) and leakage (S) at the
    terminals; drive-nonlinearity (loss of stiffness per strain, 1e3 is much), sweep-lag (s), temperature-drift (K/s).

    Example: pzctl sim --port 5025 --time-scale 0.01 --hidden lead-inductance=2e-8
    """
    from ....sim.bench.hidden_effects import parse
    from ....sim.server import SimOptions, run

    run(
        SimOptions(
            **({"model": model} if model else {}),
            port=port,
            bench_port=bench_port,
            prologix_port=prologix_port,
            ftp_port=ftp_port,
            time_scale=time_scale,
            seed=seed,
            jig=jig,
            noise=noise,
            radial=radial,
            off=off,
            hidden=parse(hidden or []),
        )
    )
