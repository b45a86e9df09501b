"""Learned physics outside the catalogue: place, law and its numbers; and weak lines, which are not findings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.files.builds.effects_writing import append_effects
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.search.weak_lines import weak_lines
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.interface import FitTask
from pzctl.fitters.plugins import load_fitter, run
from pzctl.models.effects import Device
from pzctl.models.stack import Piezo, Stack
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
F = np.linspace(1.5e6, 7.5e6, 301)
NOISE = 2e-4


def _recorded(Z: np.ndarray) -> FitTask:
    random = np.random.default_rng(3)
    noisy = Z * np.exp(NOISE * (random.normal(size=F.size) + 1j * random.normal(size=F.size)))
    return FitTask(BUILD, {"disk": (Sweep(F, noisy),)})


def _relaxing(stack: Stack, strength: float, at: float) -> np.ndarray:
    """The disk, computed separately at each frequency with its permittivity there; no law of the library is used."""
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo))
    return np.array(
        [
            replace(
                stack,
                layers=tuple(
                    replace(layer, eps33S=disk.eps33S * (1 + strength / (1 + 1j * f / at))) if layer is disk else layer
                    for layer in stack.layers
                ),
            ).impedance(np.array([f]))[0]
            for f in F
        ]
    )


def test_a_relaxation_outside_the_catalogue_is_located_named_sized_and_fitted(bare: Device, tmp_path: Path) -> None:
    strength, at = 0.2, 4e6
    task = _recorded(_relaxing(bare.bare, strength, at))
    others = {
        "alike": _recorded(_relaxing(bare.bare, 1.05 * strength, at)),
        "without": _recorded(bare.bare.impedance(F)),
    }
    diagnosis = diagnose(task, effects=("polarity",), learn=True, others=others)
    alike, without = diagnosis.others
    assert alike.effects == without.effects
    assert "learned at layer:disk" in alike.effects
    assert alike.chi2_per_dof_after < 0.05 * alike.chi2_per_dof_before
    assert without.chi2_per_dof_after > 2 * without.chi2_per_dof_before, "it does not have it"
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")
    assert diagnosis.places[0].probability > 0.9
    (finding,) = (one for one in diagnosis.findings if one.effect == "learned")
    assert finding.where == "layer:disk"
    relaxation = finding.parameters["at"]
    assert relaxation.unit == "Hz"
    assert relaxation.value == pytest.approx(at, rel=0.2)
    assert "permittivity of disk relaxes at" in finding.says
    assert diagnosis.final.chi2_per_dof < 0.02 * diagnosis.baseline.chi2_per_dof

    build = tmp_path / "build.toml"
    build.write_text(THESIS_BUILD.read_text(encoding="utf-8"), encoding="utf-8")
    append_effects(build, diagnosis.effects)
    fit = run(load_fitter("mason"), replace(task, build=read_build(build)))
    assert fit.chi2_per_dof < 0.02 * diagnosis.baseline.chi2_per_dof
    name = next(name for name in fit.constants if name.startswith("learned@layer:disk") and name.endswith(".at"))
    assert fit.constants[name].re == pytest.approx(relaxation.value, abs=3 * relaxation.u)


def test_a_law_takes_the_place_of_what_only_imitates_it(bare: Device) -> None:
    """Without a law, a resonance beside the lead is named, which leaves forty times as much."""
    diagnosis = diagnose(_recorded(_relaxing(bare.bare, 0.2, 4e6)), effects=("cable",), learn=True)
    assert [(one.effect, one.where) for one in diagnosis.findings] == [("learned", "layer:disk")]
    assert diagnosis.findings[0].probability > 0.9
    assert diagnosis.verdict == "explained"
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")


def test_weak_lines_are_found_at_their_frequencies(bare: Device) -> None:
    lines = ((2.6e6, 90.0, 4e-5), (3.3e6, 60.0, 5e-5), (6.1e6, 120.0, 3e-5))
    stack = bare.bare
    disk = next(layer for layer in stack.layers if isinstance(layer, Piezo))
    C0 = disk.eps33S.real * stack.area / disk.thickness
    w = 2 * np.pi * F
    Y = 1 / stack.impedance(F)
    for f, q, strength in lines:
        wk = 2 * np.pi * f
        Y = Y + 1j * w * strength * C0 / (1 - (w / wk) ** 2 + 1j * w / (wk * q))
    problem = Problem.of(solve(_recorded(1 / Y), lambda _: None), None)
    null = fitted(problem, (), problem.values, near=True)
    found = sorted(weak_lines(null), key=lambda line: line.frequency)
    assert [line.frequency for line in found] == pytest.approx([f for f, _, _ in lines], rel=4e-3)
    with_lines = fitted(replace(problem, lines=tuple(found)), (), null.values, (null.fit.sizes,), near=True)
    assert with_lines.log_evidence > null.log_evidence + 50
    nothing = Problem.of(solve(_recorded(stack.impedance(F)), lambda _: None), None)
    assert weak_lines(fitted(nothing, (), nothing.values, near=True)) == ()
