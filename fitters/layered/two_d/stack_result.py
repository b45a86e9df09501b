"""The result of a fit of a stack in two dimensions: constants with uncertainties, and what a person must know."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.constants.passivity import passivity_margin
from ....models.disk2d.matrices import CONSTANTS
from ...disk.planar_result import PLANAR_UNITS, propagated, radial_named
from ...disk.two_d.determined_constants import undetermined
from ...disk.two_d.reference import in_words, tensor_of
from ...disk.two_d.tensor_start import unusual
from ...engine.covariance import Estimate, estimate
from ...engine.parameters.assembly import effects_of, layers_of
from ...engine.recording import rms
from ...error_model.instrument_share import chi2_beside_instrument
from ...interface import Constant, FitResult
from ...uncertainty.budget import budget_at
from ...uncertainty.derived import derived_constants
from ...uncertainty.fit_result import curves_of, fitted_constants, strong_correlations
from ...uncertainty.identifiability import separability
from .stack_problem import NAME
from .stepwise import FittedStack

_MISFIT = 1.5
# chi2 per degree of freedom above which a misfit is reported.
_LIGHT = 1e4
# Rayl: loads above this one are liquids or solids, whose radiation sideways the model lacks.


def stack_result(found: FittedStack, version: str, seconds: float) -> FitResult:
    """Return the result of a fit that took this long."""
    problem, objective = found.problem, found.descent.objective
    result = estimate(found.descent)
    ratios = objective.log_ratios(result.x)
    result = replace(result, chi2_per_dof=chi2_beside_instrument(objective.recordings, ratios, result.x.size))
    names, steps = objective.coordinates.parameters, tuple(problem.sweeps)
    layers = layers_of(problem.build, steps)
    constants = _fitted(found, names, result.covariance)
    derived = derived_constants(layers, found.values, names, result.covariance)
    highest = max(float(recording.sweep.frequency[-1]) for recording in objective.recordings)
    return FitResult(
        build=problem.build.name,
        fitter=NAME,
        version=version,
        steps=steps,
        noise=max((problem.noise[step] for step in steps), key=lambda noise: noise.relative),
        chi2_per_dof=result.chi2_per_dof,
        constants=constants,
        derived={**derived, **_radial(found, names, result.covariance)},
        correlation=strong_correlations(names, result.covariance),
        rms_log_error=result.rms_log_error,
        converged=result.converged,
        evaluations=found.descent.evaluations,
        seconds=seconds,
        says=(
            *_verdict(found, result),
            *_about(found),
            *undetermined(found.descent, problem.disk.name),
            *unusual(problem.disk, tensor_of(found.values, problem.disk.name)),
            *separability(layers, found.values, names, result.covariance, derived, highest),
        ),
        curves=curves_of(objective, found.descent.start, result.x),
        budget=budget_at(objective, result.x),
    )


def constants_of_stack(found: FittedStack, names: tuple[str, ...], covariance: Reals) -> dict[str, Constant]:
    """Return all constants and derived ones at the values of `found`; `covariance`: of the parameters `names`."""
    layers = layers_of(found.problem.build, tuple(found.problem.sweeps))
    made = _fitted(found, names, covariance)
    return made | derived_constants(layers, found.values, names, covariance) | _radial(found, names, covariance)


def _fitted(found: FittedStack, names: tuple[str, ...], covariance: Reals) -> dict[str, Constant]:
    """Return the constants of all layers, and the parameters of the effects that the build states."""
    build, steps = found.problem.build, tuple(found.problem.sweeps)
    layers, known = layers_of(build, steps), effects_of(build, steps)
    return fitted_constants(layers, found.values, names, covariance, effects=known) | _further(found, names, covariance)


def _further(found: FittedStack, names: tuple[str, ...], covariance: Reals) -> dict[str, Constant]:
    """Return the ten constants of the ceramic, and Poisson's ratios."""
    u = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    made: dict[str, Constant] = {}
    for name in (f"{found.problem.disk.name}.{constant}" for constant in CONSTANTS):
        re, im = f"{name}.re", f"{name}.im"
        unit = PLANAR_UNITS[name.partition(".")[2]]
        made[name] = Constant(found.values[re], found.values[im], u[re], u[im], unit, free=u[re] > 0)
    for name in (name for name in names if name.endswith(".poisson")):
        made[name] = Constant(found.values[name], 0.0, u[name], 0.0, "1", free=u[name] > 0)
    return made


def _radial(found: FittedStack, names: tuple[str, ...], covariance: Reals) -> dict[str, Constant]:
    """Return the constants of the radial mode."""
    layer = found.problem.disk.name

    def make(values: Mapping[str, float]) -> dict[str, complex]:
        return radial_named(layer, tensor_of(values, layer).radial)

    own = [k for k, name in enumerate(names) if name.removeprefix(f"{layer}.")[:-3] in CONSTANTS]
    tensor = tuple(names[k] for k in own)
    u = propagated(make, {name: found.values[name] for name in tensor}, tensor, covariance[np.ix_(own, own)])
    return {
        name: Constant(z.real, z.imag, *u[name], PLANAR_UNITS[name.partition(".")[2]], free=False)
        for name, z in make(found.values).items()
    }


def _about(found: FittedStack) -> tuple[str, ...]:
    """Return sentences on the model itself."""
    problem, values = found.problem, found.values
    tensor = tensor_of(values, problem.disk.name)
    says = [
        f"Constants {in_words(found.law)}, which describe the first step better. The model "
        f"is accurate to {found.error:.1g} of the capacitance (rms, compared with functions of higher degree).",
        f"Passivity check passed: the smallest loss tangent is {passivity_margin(tensor.law):.2g} (Holland).",
    ]
    heavy = [face for face in ("back", "front") if values.get(f"{face}.z", 0.0) > _LIGHT]
    if heavy:
        says.append(
            f"The load at the {' and the '.join(heavy)} acts on the axial motion of the face alone: what it radiates "
            "sideways and how it holds the face in its plane are not in the model."
        )
    return tuple(says)


def _verdict(found: FittedStack, result: Estimate) -> tuple[str, ...]:
    says: list[str] = []
    if result.chi2_per_dof > _MISFIT:
        objective = found.descent.objective
        ratios = objective.log_ratios(result.x)
        errors = {
            step: rms(*(r for one, r in zip(objective.recordings, ratios, strict=True) if one.step == step))
            for step in found.problem.sweeps
        }
        worst = max(errors, key=lambda step: errors[step])
        says.append(
            f"The model does not describe step {worst!r} to its noise: RMS log error {errors[worst]:.2g} where the "
            f"noise is {found.problem.noise[worst].relative:.1g} (chi2 per degree of freedom "
            f"{result.chi2_per_dof:.3g}). The uncertainties are widened by the misfit."
        )
    if not result.converged:
        says.append("The fit stopped before it converged; do not use these numbers.")
    return tuple(says)
