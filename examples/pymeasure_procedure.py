"""A pzctl measurement as a PyMeasure procedure: it goes through PyMeasure's queue, results file and plots.

python examples/pymeasure_procedure.py build.toml results.csv
"""

import sys
from pathlib import Path
from typing import Any, ClassVar

from pymeasure.experiment import Parameter, Procedure, Results, Worker

from pzctl import connect
from pzctl.daemon.files.builds.build_file import read_build


class ImpedanceProcedure(Procedure):
    """Measure one gluing step; every point of every sweep is one row of the results."""

    build_file = Parameter("build.toml", default="build.toml")
    step = Parameter("Gluing step", default="disk")
    DATA_COLUMNS: ClassVar = ["Frequency (Hz)", "R (ohm)", "X (ohm)"]

    def execute(self) -> None:
        """Measure through the daemon; if PyMeasure stops the procedure, the measurement is cancelled."""
        with connect() as lab:
            measured = lab.measure(read_build(Path(self.build_file)), self.step, progress=self._progress)
        for sweep in measured.sweeps:
            for f, Z in zip(sweep.frequency, sweep.impedance, strict=True):
                self.emit("results", dict(zip(self.DATA_COLUMNS, (f, Z.real, Z.imag), strict=True)))

    def _progress(self, event: Any) -> None:
        self.emit("progress", 100 * event.fraction)
        if self.should_stop():
            raise KeyboardInterrupt  # the client treats this like Ctrl-C, and cancels


def main(build: str, results: str) -> None:
    """Run the procedure once."""
    procedure = ImpedanceProcedure()
    procedure.build_file = build
    worker = Worker(Results(procedure, results))
    worker.start()
    worker.join(timeout=3600)
    if procedure.status != Procedure.FINISHED:
        sys.exit("the procedure did not finish; see PyMeasure's log")


if __name__ == "__main__":
    main(*sys.argv[1:3])
