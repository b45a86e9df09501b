"""Samples with finished fits in a journal."""

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.wire.events import FitEvent, SampleStep, StateEvent
from pzctl.daemon.wire.result_messages import report_of
from pzctl.fitters.interface import Constant, FitResult, Noise
from pzctl.models.build import Build

BUILD = """
name = "{name}"
diameter_mm = 16.0
layers = [{{ name = "disk", kind = "piezo", material = "Pz27", thickness_mm = 0.5 }}]
load = {{ back = "air", front = "air" }}
steps = [{{ name = "disk", layers = ["disk"] }}]
[limits.disk]
c33D_GPa = {{ min = 146, max = 156 }}
"""


def disk_build(name: str) -> Build:
    return parse_build(BUILD.format(name=name))


def put_fit(journal: JournalWriter, name: str, c33D: float, *, kt: float = 0.46, build: Build | None = None) -> str:
    """Put a measurement of a sample's disk with a fit into the journal, and return its id."""
    build, sample = build or disk_build(name), SampleStep(name, "disk")
    measurement, _ = journal.begin_measurement(f"{name}-{journal.last_seq}", build, "disk")
    journal.append(StateEvent(state="measured", measurement=measurement, sample=sample))
    constants = {"disk.c33D": Constant(c33D, 0.011 * c33D, 1e9, 2e7, "Pa")}
    derived = {"disk.kt": Constant(kt, 0.0, 0.001, 0.0, "1", free=False)}
    noise = Noise(1e-3, "repeats")
    result = FitResult(name, "mason", "1", ("disk",), noise, 1.02, constants, derived, (), 0.001, True, 9, 0.1)
    event = FitEvent(
        measurement=measurement,
        sample=sample,
        fitter="mason",
        version="1",
        sweeps=(measurement,),
        report=report_of(result),
    )
    journal.append(event)
    return measurement
