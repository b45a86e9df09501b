"""From a minimum to the answer people read."""

from collections.abc import Mapping

import numpy as np

from ..models.arrays import Reals
from ..models.build import Build, LayerSpec
from .assembly import ELASTIC_CONSTANTS, PIEZO_CONSTANTS, UNITS, layers_of
from .covariance import Estimate, estimate
from .derived import derived_constants
from .interface import Constant, Curve, FitResult
from .joint import Solution
from .objective import Objective

_MENTION = 0.9
_MISFIT = 1.5
# chi2 per degree of freedom above which a person is told that model and recording differ: the noise estimate itself
# is good to a few per cent, 1600 residuals scatter by 3.5 %.


def fitted_constants(
    layers: tuple[LayerSpec, ...], values: Mapping[str, float], names: tuple[str, ...], covariance: Reals | None
) -> dict[str, Constant]:
    """Return the constants of all layers; `covariance` is that of the parameters `names`, None where there is none."""
    variance = dict(zip(names, np.diag(covariance), strict=True)) if covariance is not None else None

    def u(name: str) -> float | None:
        return None if variance is None else float(np.sqrt(max(0.0, variance.get(name, 0.0))))

    constants: dict[str, Constant] = {}
    for layer in layers:
        for name in (PIEZO_CONSTANTS if layer.kind == "piezo" else ELASTIC_CONSTANTS) + ("thickness", "density"):
            full = f"{layer.name}.{name}"
            if name in PIEZO_CONSTANTS:
                re, im = f"{full}.re", f"{full}.im"
                constants[full] = Constant(values[re], values[im], u(re), u(im), UNITS[name], free=u(re) != 0)
            elif full in values:
                constants[full] = Constant(values[full], 0.0, u(full), 0.0, UNITS[name], free=u(full) != 0)
    return constants


def strong_correlations(names: tuple[str, ...], covariance: Reals) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs of parameters whose correlation is above 0.9 in size, strongest first, twenty at most."""
    sigma = np.sqrt(np.diag(covariance))
    moving: list[int] = np.flatnonzero(sigma > 0).tolist()
    pairs = [
        (names[i], names[j], float(covariance[i, j] / (sigma[i] * sigma[j])))
        for k, i in enumerate(moving)
        for j in moving[k + 1 :]
    ]
    strong = [pair for pair in pairs if abs(pair[2]) > _MENTION and not _same_constant(pair[0], pair[1])]
    return tuple(sorted(strong, key=lambda pair: -abs(pair[2]))[:20])


def _same_constant(first: str, second: str) -> bool:
    return first.removesuffix(".re").removesuffix(".im") == second.removesuffix(".re").removesuffix(".im")


def curves_of(objective: Objective, start: Reals, x: Reals) -> tuple[Curve, ...]:
    """Return measured, start and fitted impedance of every recording."""
    return tuple(
        Curve(
            recording.step,
            recording.sweep.frequency,
            recording.sweep.impedance,
            before.impedance(recording.sweep.frequency),
            after.impedance(recording.sweep.frequency),
        )
        for recording, before, after in zip(
            objective.recordings, objective.models(start), objective.models(x), strict=True
        )
    )


def least_squares_answer(fitter: str, version: str, solution: Solution) -> FitResult:
    """Return the answer of a least-squares fitter: constants, uncertainties, curves, and what to know of them."""
    objective = solution.descent.objective
    coordinates = objective.coordinates
    result = estimate(solution.descent)
    values, _ = coordinates.forward(result.x)
    layers = layers_of(solution.build, solution.noises)
    noise = max(solution.noises.values(), key=lambda n: n.relative)
    return FitResult(
        build=solution.build.name,
        fitter=fitter,
        version=version,
        steps=tuple(solution.noises),
        noise=noise,
        chi2_per_dof=result.chi2_per_dof,
        constants=fitted_constants(layers, values, coordinates.parameters, result.covariance),
        derived=derived_constants(layers, values, coordinates.parameters, result.covariance),
        correlation=strong_correlations(coordinates.parameters, result.covariance),
        rms_log_error=result.rms_log_error,
        converged=result.converged,
        evaluations=solution.evaluations,
        seconds=solution.seconds,
        says=verdict(result, _aspect(solution.build), noise.relative),
        curves=curves_of(objective, coordinates.inverse(solution.begun), result.x),
    )


def _aspect(build: Build) -> float | None:
    """Return diameter/thickness of the piezo layer, where the diameter is known."""
    if build.diameter is None:
        return None
    piezo = next(layer for layer in build.layers if layer.kind == "piezo")
    return build.diameter.re / piezo.values["thickness"].re


def verdict(result: Estimate, diameter_to_thickness: float | None, noise: float) -> tuple[str, ...]:
    """Return what a person must know before using the numbers."""
    says: list[str] = []
    if result.chi2_per_dof > _MISFIT:
        says.append(
            f"A 1-D model does not describe this recording: RMS log error {result.rms_log_error:.2g} where the noise "
            f"is {noise:.1g} (chi2 per degree of freedom {result.chi2_per_dof:.3g}). The uncertainties are widened by "
            "the misfit, but the constants may carry a bias they do not cover."
        )
        if diameter_to_thickness is not None and diameter_to_thickness < 40 and result.rms_log_error > 0.02:
            says.append(
                f"Diameter/thickness is {diameter_to_thickness:.1f}: radial overtones and the edge mode run through "
                "the thickness resonance of such a disk, and a 1-D model takes them for loss."
            )
    if not result.converged:
        says.append("The fit stopped before it converged; do not use these numbers.")
    return tuple(says)
