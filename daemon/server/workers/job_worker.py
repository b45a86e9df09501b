"""One fit or diagnosis that was asked for, in a process of its own: an ordinary client that hands in what it found.

python -m pzctl.daemon.server.workers.job_worker MEASUREMENT --fitter mason --events tcp://... --requests tcp://...
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from ....fitters.interface import FitError, FitResult
from ....fitters.plugins import load_configured
from ...client.client import Client
from ...files.auto_diagnosis import DIAGNOSIS
from ...wire.events import ReceivedEvent, SweepEvent
from .fitter_worker import task_of
from .worker_main import run_as_guest


def diagnosis_version(effects: Sequence[str] | None, also: Sequence[str] = (), propose: bool = False) -> str:
    """Return what a diagnosis is known by: pzctl's version, the effects it was limited to, and what decided it."""
    words = [version("pzctl"), ",".join(effects or ()), " ".join(("with", *also)) if also else ""]
    return " ".join(word for word in (*words, "proposing" if propose else "") if word)


def fit(client: Client, measurement: str, fitter: str) -> None:
    """Fit a measurement; hand in the result, or why there is none. Raises PluginError, DaemonError."""
    loaded = load_configured(fitter)
    heard = client.sweeps(measurement)
    found: FitResult | str
    try:
        found = loaded.fit(task_of(heard))
    except FitError as error:
        found = str(error)
    client.submit(measurement, _ids(heard), fitter, loaded.version, found)


def diagnose(
    client: Client, measurement: str, effects: Sequence[str] | None, also: Sequence[str] = (), propose: bool = False
) -> None:
    """Diagnose a measurement; hand in what was found, or why it cannot be. Raises EffectError, DaemonError."""
    from ....fitters.diagnosis.diagnose import diagnose as find_out
    from ...report.json_output.experiment_json import deciding_json
    from ...report.tables.diagnosis_output import diagnosis_curves, diagnosis_json

    own = client.sweeps(measurement)
    further = [one for other in also for one in client.sweeps(other) if _measurement_of(one) == other]
    heard = [*own, *further]
    key = (measurement, _ids(heard), DIAGNOSIS, diagnosis_version(effects, also, propose))
    try:
        task = task_of(heard)
        diagnosis = find_out(task, effects)
        found = diagnosis_json(diagnosis) | deciding_json(task, diagnosis, task_of(own), propose)
    except FitError as error:
        client.submit(*key, str(error))
    else:
        client.submit_diagnosis(*key, found, diagnosis_curves(diagnosis))


def _measurement_of(heard: ReceivedEvent) -> str | None:
    return heard.event.measurement if isinstance(heard.event, SweepEvent) else None


def _ids(heard: Sequence[ReceivedEvent]) -> list[str]:
    return [one.event.id for one in heard]


def _step_back() -> None:
    """Let acquisition and fits go first: people wait for constants, and a diagnosis takes seconds."""
    if sys.platform != "win32":
        os.nice(10)


def work(client: Client, given: argparse.Namespace) -> None:
    """Do what the command line says. Raises PzctlError."""
    if given.fitter:
        fit(client, given.measurement, given.fitter)
        return
    _step_back()
    effects = given.effects.split(",") if given.effects else None
    also = given.also.split(",") if given.also else ()
    diagnose(client, given.measurement, effects, also, given.propose)


def main() -> None:
    """Do one errand and end."""
    parser = argparse.ArgumentParser(description="One fit or diagnosis for the daemon.")
    parser.add_argument("measurement")
    parser.add_argument("--fitter", help="the fitter; without one it is a diagnosis")
    parser.add_argument("--effects", help="consider only these, as cable,bond-layer")
    parser.add_argument("--also", help="measurements made to decide the diagnosis, separated by commas")
    parser.add_argument("--propose", action="store_true", help="say which measurements would decide")
    run_as_guest(parser, work)


if __name__ == "__main__":
    main()
