"""How far the analyzer may be off: as stated, as its driver noted at each point, or a 4294A's."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.error_model.instrument_share import accuracy_of
from pzctl.fitters.error_model.prior_scales import INSTRUMENT
from pzctl.fitters.interface import FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.models.effects import Device
from pzctl.models.sweep import Sweep

F = np.linspace(2e6, 12e6, 101)
SPECIFIED = 1e-3 * F / 1e6
"""A 4294A's, from 1 MHz upwards."""
BUILD = read_build(THESIS_BUILD)


def recorded(settings: dict[str, object]) -> Sweep:
    """Return a sweep of a perfect disk by an analyzer that is off by 0.7 of its specification."""
    noise = np.random.default_rng(5).standard_normal((2, F.size))
    error = 0.7 * SPECIFIED * np.exp(1j) + 5e-5 * (noise[0] + 1j * noise[1])
    return Sweep(F, Device(stack_of(BUILD, BUILD.step("disk"))).impedance(F) * np.exp(error), settings=settings)


@pytest.mark.long
def test_an_analyzer_within_its_specification_at_each_point_is_no_mismatch() -> None:
    names = ("series-resistance", "lead-inductance", "dielectric-dispersion")
    diagnosis = diagnose(FitTask(BUILD, {"disk": (recorded({"accuracy_relative": SPECIFIED.tolist()}),)}), names)
    assert (diagnosis.verdict, diagnosis.findings) == ("no-mismatch", ())


def test_uncertainties_contain_what_the_analyzer_may_be_off() -> None:
    def away(settings: dict[str, object]) -> float:
        own = Mason().fit(FitTask(BUILD, {"disk": (recorded(settings),)})).constants["disk.h33"]
        return abs(own.im) / own.u_im  # the disk's has no loss

    assert away({"accuracy_relative": SPECIFIED.tolist()}) < 2 < away({"accuracy": 1e-4})


@pytest.mark.parametrize(
    "settings",
    [{}, {"accuracy_relative": [1e-3]}, {"accuracy_relative": "good"}, {"accuracy_relative": ["x"] * F.size}],
    ids=["nothing", "too few", "a word", "words"],
)
def test_without_a_number_for_each_point_a_4294a_is_assumed(settings: dict[str, object]) -> None:
    np.testing.assert_array_equal(accuracy_of(recorded(settings)), np.full(F.size, INSTRUMENT))


def test_what_is_stated_holds_before_what_was_noted() -> None:
    stated = replace(recorded({}), settings={"accuracy": 2e-3, "accuracy_relative": SPECIFIED.tolist()})
    np.testing.assert_array_equal(accuracy_of(stated), np.full(F.size, 2e-3))


def test_a_part_of_a_recording_keeps_the_accuracy_of_its_points() -> None:
    few = recorded({"accuracy_relative": SPECIFIED.tolist(), "bandwidth": 5}).at(F > 6e6)
    np.testing.assert_array_equal(accuracy_of(few), SPECIFIED[F > 6e6])
    assert few.settings["bandwidth"] == 5
