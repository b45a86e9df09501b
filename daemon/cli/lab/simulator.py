"""`pzctl sim`: a simulated analyzer on its raw socket."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer


def sim(
    model: Annotated[str | None, typer.Option(help="Which analyzer: 4294A (the default) or E4990A.")] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Raw socket of the instrument; 0 takes any free port.")
    ] = 5025,
    bench_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the bench, which glues the next layer on command.")
    ] = 5026,
    time_scale: Annotated[float, typer.Option(help="Sweep time relative to a real 4294A; 0 answers at once.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the sample on the bench and of the noise.")] = 0,
    jig: Annotated[str, typer.Option(help="The fixture: compensated, coax, clips or ideal.")] = "compensated",
    noise: Annotated[bool, typer.Option(help="Add the analyzer's random noise.")] = True,
    radial: Annotated[bool, typer.Option("--radial", help="Include the disk's radial modes.")] = False,
    prologix_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of a Prologix-style GPIB adapter, usually 1234.")
    ] = None,
    ftp_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the FTP server (needs aioftp), for example 2121.")
    ] = None,
    off: Annotated[bool, typer.Option("--off", help="Add a systematic error within the analyzer's accuracy.")] = False,
    build: Annotated[
        Path | None, typer.Option(help="Put a transducer of this build on the bench; the seed draws its constants.")
    ] = None,
    hidden: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Hidden effect, in SI units; may be repeated. See below."),
    ] = None,
) -> None:
    """Run a simulated Agilent 4294A (or Keysight E4990A) with a virtual bench behind it, until Ctrl-C.

    Effects for --hidden: lead-inductance (H), series-resistance (ohm), stray-capacitance (F) and leakage (S) at the
    terminals; drive-nonlinearity (loss of stiffness per strain, 1e3 is much), sweep-lag (s), temperature-drift (K/s).

    Example: pzctl sim --port 5025 --time-scale 0.01 --hidden lead-inductance=2e-8
    """
    from ....sim.bench.hidden_effects import parse
    from ....sim.bench.sample import sample
    from ....sim.server import SimOptions, run
    from ...files.builds.build_file import read_build
    from ...report.terminal import is_quiet
    from .sample_of_build import sample_of

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
        ),
        sample if build is None else partial(sample_of, read_build(build)),
        quiet=is_quiet(),
    )
