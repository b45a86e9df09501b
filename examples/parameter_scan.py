"""Scan an outer parameter, here the temperature of a chamber: constants of the disk against it, as CSV.

python examples/parameter_scan.py build.toml 20 30 40 > scan.csv
"""

import csv
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TextIO

from pzctl import Build, connect
from pzctl.daemon.files.builds.build_file import read_build

NAMES = ("disk.c33D", "disk.eps33S", "disk.h33")


def set_temperature(celsius: float) -> float:
    """Bring the chamber to a temperature and return the temperature reached: insert your chamber's commands here."""
    return celsius


def scan(
    build: Build, temperatures: Iterable[float], out: TextIO, reach: Callable[[float], float] = set_temperature
) -> None:
    """Measure and fit the first step at each temperature, with a lease of the instrument for the whole time."""
    rows = csv.writer(out)
    rows.writerow(["temperature_C", "measurement", *(f"{name}.{part}" for name in NAMES for part in ("re", "im", "u"))])
    with connect() as lab, lab.lease("temperature scan", seconds=3600) as lease:
        for wanted in temperatures:
            reached = reach(wanted)
            measured = lab.measure(build, build.steps[0].name, lease=lease)
            constants = lab.fit(measured.id, "mason").constants
            values = [(constants[name].re, constants[name].im, constants[name].u_re) for name in NAMES]
            rows.writerow([reached, measured.id, *(number for three in values for number in three)])
            out.flush()


def main(words: Sequence[str]) -> None:
    """Scan the transducer of a build file over the temperatures given, in degrees Celsius."""
    scan(read_build(Path(words[0])), [float(word) for word in words[1:]], sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1:])
