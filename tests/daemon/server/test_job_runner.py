"""Requested fits and diagnoses: done once, by any installed fitter, in their own process."""

from dataclasses import replace

import numpy as np
import pytest

import pzctl
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.wire.events import DiagnosisEvent, FitEvent
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build, Quantity
from pzctl.models.sweep_plan import Segment, SweepPlan

THESIS = THESIS_BUILD


def test_a_fit_and_a_diagnosis_of_what_was_measured(start_daemon) -> None:
    start_daemon()
    known = replace(read_build(THESIS), plan=SweepPlan((Segment(1e6, 6e6, 51),)))
    with pzctl.connect() as lab:
        lab.bench({"command": "hidden", "series-resistance": 0.5})
        measurement = lab.measure(known, "disk").id
        result = lab.fit(measurement, "mason")
        assert result.steps == ("disk",)
        assert result.converged
        truth = lab.bench({"command": "truth"})["constants"]["disk.c33D"]["re"]
        assert np.isclose(result.constants["disk.c33D"].re, truth, rtol=0.01)
        assert lab.fit(measurement, "mason").seconds == result.seconds, "not done again"
        diagnosis = lab.diagnose(measurement, ["leakage", "series-resistance"])
        assert diagnosis["verdict"] == "explained"
        (finding,) = diagnosis["findings"]
        assert finding["effect"] == "series-resistance"
        assert np.isclose(finding["parameters"]["resistance"]["value"], 0.5, rtol=0.01)
        kinds = [(type(reply.event), reply.event.fitter) for reply in lab.fits(measurement)]
        assert kinds == [(FitEvent, "mason"), (DiagnosisEvent, "diagnosis")]
        assert lab.diagnose(measurement, ["series-resistance", "leakage"]) == diagnosis


def test_what_cannot_be_done_is_said(start_daemon, build: Build) -> None:
    start_daemon()
    with pzctl.connect() as lab:
        measurement = lab.measure(build, "disk").id
        for ask, says in (
            (lambda: lab.fit(measurement, "nobody"), "'nobody' is not installed here; there are bvd, disk"),
            (lambda: lab.fit(measurement, "os:system"), "'os:system' is not installed here"),
            (lambda: lab.fit("m", "mason"), "holds no measurement 'm'"),
            (lambda: lab.diagnose(measurement, ["magic"]), "effect 'magic' is not known; there are"),
        ):
            with pytest.raises(DaemonError, match=says):
                ask()
        wide = lab.measure(replace(build, area=Quantity(2.0)), "disk").id
        with pytest.raises(FitError, match="the capacitance of this build gives"):
            lab.fit(wide, "mason", patience=60)


def test_a_job_that_takes_too_long_is_ended(start_daemon, build: Build) -> None:
    start_daemon(limits=Limits(seconds=0.01))
    with pzctl.connect() as lab:
        measurement = lab.measure(build, "disk").id
        for _ in range(2):
            with pytest.raises(FitError, match=r"nlopt-global of measurement .*: no answer within 0.01 s"):
                lab.fit(measurement, "nlopt-global")
