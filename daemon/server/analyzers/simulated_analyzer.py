"""A simulated 4294A in a child process, for a daemon without an instrument.

python -m pzctl.daemon.server.analyzers.simulated_analyzer '{"time_scale": 0}'
"""

import subprocess
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from ....drivers.base.analyzer import InstrumentError
from ...files.worker_limits import limit_files
from ...wire.frames import to_json
from ..logs import LARGEST_LOG
from ..workers.bounded_logs import keep_end
from ..workers.subprocesses import end_child, end_with_parent, last_line, start_child


class Simulated(msgspec.Struct, frozen=True):
    """The addresses of a simulated instrument, which its process prints first."""

    instrument: str
    """VISA resource."""
    bench: str
    """`host:port` of its bench."""


@contextmanager
def simulated_instrument(log: Path, options: Mapping[str, Any]) -> Generator[Simulated]:
    """Run a simulated 4294A with these fields of `SimOptions`; ports that are not given are free ones.

    It ends with this process, however that ends. Raises InstrumentError if it does not start.
    """
    keep_end(log, LARGEST_LOG)
    sim_options = to_json({"port": 0, "bench_port": 0, **options}).decode()
    with log.open("ab") as errors:
        process = start_child(
            "pzctl.daemon.server.analyzers.simulated_analyzer",
            [sim_options],
            errors,
            stdout=subprocess.PIPE,
            environment={},
        )
        try:
            yield _first_words(process, log)
        finally:
            end_child(process)


def _first_words(process: "subprocess.Popen[bytes]", log: Path) -> Simulated:
    line = process.stdout.readline() if process.stdout else b""
    try:
        return msgspec.json.decode(line, type=Simulated)
    except msgspec.MsgspecError:
        raise InstrumentError(f"simulated 4294A: it did not start: {last_line(log)}; see {log}") from None


def main() -> None:
    """Run the simulated instrument until the parent ends."""
    from ....sim.server import SimOptions, run

    end_with_parent()
    limit_files()
    run(msgspec.json.decode(sys.argv[1], type=SimOptions))


if __name__ == "__main__":
    main()
