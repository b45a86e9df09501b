"""The process of one requested fit or diagnosis: an ordinary client that submits the result.

python -m pzctl.daemon.server.workers.job_worker MEASUREMENT --fitter mason --events tcp://... --requests tcp://...
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from ....fitters.interface import FitError, FitResult
from ....fitters.plugins import load_configured, run
from ...client.client import Client
from ...files.auto_diagnosis import DIAGNOSIS
from ...wire.events import ReceivedEvent, SweepEvent
from .fitter_worker import task_of
from .worker_main import run_worker


def diagnosis_version(effects: Sequence[str] | None, also: Sequence[str] = (), propose: bool = False) -> str:
    """Return the version string of a diagnosis: pzctl's version, the effects considered, further measurements."""
    words = [version("pzctl"), ",".join(effects or ()), " ".join(("with", *also)) if also else ""]
    return " ".join(word for word in (*words, "proposing" if propose else "") if word)


def fit(client: Client, measurement: str, fitter: str) -> None:
    """Fit a measurement; submit the result, or the reason why there is none. Raises PluginError, DaemonError."""
    loaded = load_configured(fitter)
    sweeps = client.sweeps(measurement)
    answer: FitResult | str
    try:
        answer = run(loaded, task_of(sweeps))
    except FitError as error:
        answer = str(error)
    client.submit(measurement, _ids(sweeps), fitter, loaded.version, answer)


def diagnose(
    client: Client, measurement: str, effects: Sequence[str] | None, also: Sequence[str] = (), propose: bool = False
) -> None:
    """Diagnose a measurement; submit the diagnosis or the reason for none. Raises EffectError, DaemonError."""
    from ....fitters.diagnosis.diagnose import diagnose as run_diagnosis
    from ....fitters.engine.on_cores import available_cores
    from ...report.json_output.experiment_json import deciding_json
    from ...report.tables.diagnosis_output import diagnosis_curves, diagnosis_json

    own_sweeps = client.sweeps(measurement)
    further = [sweep for other in also for sweep in client.sweeps(other) if _measurement_of(sweep) == other]
    sweeps = [*own_sweeps, *further]
    key = (measurement, _ids(sweeps), DIAGNOSIS, diagnosis_version(effects, also, propose))
    try:
        task = task_of(sweeps)
        diagnosis = run_diagnosis(task, effects, jobs=available_cores())
        answer = diagnosis_json(diagnosis) | deciding_json(task, diagnosis, task_of(own_sweeps), propose)
    except FitError as error:
        client.submit(*key, str(error))
    else:
        client.submit_diagnosis(*key, answer, diagnosis_curves(diagnosis))


def _measurement_of(received: ReceivedEvent) -> str | None:
    return received.event.measurement if isinstance(received.event, SweepEvent) else None


def _ids(events: Sequence[ReceivedEvent]) -> list[str]:
    return [received.event.id for received in events]


def _lower_priority() -> None:
    """Give acquisition and fits precedence: people wait for constants, and a diagnosis takes seconds."""
    if sys.platform != "win32":
        os.nice(10)


def work(client: Client, given: argparse.Namespace) -> None:
    """Run the job that the command line describes. Raises PzctlError."""
    if given.fitter:
        fit(client, given.measurement, given.fitter)
        return
    _lower_priority()
    effects = given.effects.split(",") if given.effects else None
    also = given.also.split(",") if given.also else ()
    diagnose(client, given.measurement, effects, also, given.propose)


def main() -> None:
    """Run one job and end."""
    parser = argparse.ArgumentParser(description="One fit or diagnosis for the daemon.")
    parser.add_argument("measurement")
    parser.add_argument("--fitter", help="the fitter; without it, the job is a diagnosis")
    parser.add_argument("--effects", help="consider only these, for example cable,bond-layer")
    parser.add_argument("--also", help="measurements made to decide the diagnosis, separated by commas")
    parser.add_argument("--propose", action="store_true", help="say which measurements would decide")
    run_worker(parser, work)


if __name__ == "__main__":
    main()
