"""From a minimum to the complete result of a fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.base.local_maxima import prominent_peaks
from ...models.build import Build, LayerSpec
from ..engine.covariance import Estimate, estimate
from ..engine.multi_step_fit import Solution
from ..engine.objective import Objective
from ..engine.parameters.assembly import (
    BOLT_STIFFNESS,
    ELASTIC_CONSTANTS,
    PIEZO_CONSTANTS,
    UNITS,
    effects_of,
    layers_of,
    without_vanished,
)
from ..engine.parameters.known_effects import KnownEffect
from ..engine.recording import rms
from ..error_model.instrument_share import chi2_beside_instrument
from ..error_model.marginal_estimate import MarginalEstimate, marginal_estimate
from ..error_model.prior_scales import LEFT_AT_MOST
from ..error_model.unexplained import rms_of, unexplained_at
from ..interface import Constant, Curve, FitResult, Options
from .bootstrap import bootstrap
from .budget import budget_of
from .derived import derived_constants
from .identifiability import separability
from .intervals import with_draws, with_intervals
from .profile import profile_intervals

_USUAL = Options()
_FROZEN = (
    "The constants of earlier steps were frozen: their errors went into the later ones, whose uncertainties do not "
    "include them."
)
_VANISHED = 1e-6
# Part of the uncertainty that a build states, below which a fitted parameter of an effect has come to its limit.
_MENTION = 0.9
_WIDE, _GROSS, _PROMINENT = 40.0, 0.02, 0.01
# Diameter/thickness above which a disk is a plate; RMS log error that radial overtones leave; part of the largest
# conductance by which a maximum counts.
_MISFIT = 1.5
# chi2 per degree of freedom above which a misfit is reported: the noise estimate has a few per cent of uncertainty,
# and 1600 residuals scatter by 3.5 %.


def fitted_constants(
    layers: tuple[LayerSpec, ...],
    values: Mapping[str, float],
    names: tuple[str, ...],
    covariance: Reals | None,
    effects: Sequence[KnownEffect] = (),
) -> dict[str, Constant]:
    """Return the constants of all layers, and the parameters of the effects that the build states.

    `covariance` is that of the parameters `names`, None if there is none.
    """
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
                for name_ in (full, *(ground for ground in values if ground.startswith(f"{full}@"))):
                    constants[name_] = Constant(values[name_], 0.0, u(name_), 0.0, UNITS[name], free=u(name_) != 0)
    if BOLT_STIFFNESS in names:
        stiffness, known = values[BOLT_STIFFNESS], u(BOLT_STIFFNESS)
        constants[BOLT_STIFFNESS] = Constant(stiffness, 0.0, known, 0.0, UNITS["stiffness"], free=known != 0)
    for name, knob in (parameter for one in effects for parameter in one.parameters):
        constants[name] = Constant(values[name], 0.0, u(name), 0.0, knob.unit, free=u(name) != 0)
    return constants


def _at_an_end(
    effects: Sequence[KnownEffect], free: tuple[str, ...], constants: Mapping[str, Constant]
) -> tuple[str, ...]:
    """Return the fitted parameters of effects that ended at a limit: a coordinate has no slope there, so u is 0."""
    ended: list[str] = []
    for one in effects:
        for name, knob in one.parameters:
            least = _VANISHED * one.spec.values[knob.name].u
            near = min(constants[name].re - knob.lower, knob.upper - constants[name].re) <= least
            if name in free and near and (constants[name].u_re or 0.0) <= least:
                ended.append(name)
    return tuple(ended)


def strong_correlations(names: tuple[str, ...], covariance: Reals) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs of parameters with a correlation above 0.9 in size, strongest first, twenty at most."""
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


def least_squares_answer(fitter: str, version: str, solution: Solution, options: Options = _USUAL) -> FitResult:
    """Return the result of a least-squares fitter: constants, uncertainties, curves, and sentences about them."""
    objective, coordinates = solution.judged, solution.descent.objective.coordinates
    result = estimate(solution.descent, objective)
    chi2 = chi2_beside_instrument(objective.recordings, objective.log_ratios(result.x), result.x.size)
    result = replace(result, chi2_per_dof=chi2)
    covariance = result.covariance + _carried(solution)
    values, _ = coordinates.forward(result.x)
    told: MarginalEstimate | None = None
    if options.objective == "log" and options.procedure == "joint":
        told = _with_errors(objective, result.x, solution.build)
        values, covariance = dict(told.values), told.covariance
        # chi2 stays that of the minimum: whether the model can describe the recordings does not depend on their errors
        result = replace(result, x=told.x, rms_log_error=rms(*objective.log_ratios(told.x)))
    layers = layers_of(solution.build, solution.noises)
    noise = max(solution.noises.values(), key=lambda n: n.relative)
    effects = effects_of(solution.build, solution.noises)
    constants = fitted_constants(layers, values, coordinates.parameters, covariance, effects=effects)
    ended = _at_an_end(effects, coordinates.free, constants)
    constants |= {name: replace(constants[name], u_re=None, free=True) for name in ended}
    whole = covariance if told is None else told.with_held
    derived = derived_constants(layers, values, coordinates.parameters, whole)
    curves = curves_of(objective, coordinates.inverse(solution.begun), result.x)
    says = verdict(result, solution.build, curves, noise.relative, told)
    highest = max(float(recording.sweep.frequency[-1]) for recording in objective.recordings)
    says += separability(layers, values, coordinates.parameters, covariance, derived, highest)
    if ended:
        says += (f"At an end of its range, where its uncertainty is not known: {', '.join(ended)}.",)
    if options.procedure == "frozen" and len(solution.noises) > 1:
        says += (_FROZEN,)
    if options.uncertainty == "profile":
        constants = with_intervals(constants, profile_intervals(solution.descent, told))
    elif options.uncertainty == "bootstrap":
        constants, derived, of_draws = with_draws(constants, derived, layers, bootstrap(solution.descent, told))
        says += of_draws
    not_budgeted = options.procedure == "frozen" or options.objective == "kt2"
    return FitResult(
        build=solution.build.name,
        fitter=fitter,
        version=version,
        steps=tuple(solution.noises),
        noise=noise,
        chi2_per_dof=result.chi2_per_dof,
        constants=constants,
        derived=derived,
        correlation=strong_correlations(coordinates.parameters, covariance),
        rms_log_error=result.rms_log_error,
        converged=result.converged,
        evaluations=solution.evaluations,
        seconds=solution.seconds,
        says=says,
        curves=curves,
        budget=None if not_budgeted else budget_of(solution, told.by if told else None),
    )


def _with_errors(objective: Objective, x: Reals, build: Build) -> MarginalEstimate:
    """Return the fit with the error model from a minimum of least squares; where a layer has vanished, also from it."""
    coordinates = objective.coordinates
    values, _ = coordinates.forward(x)
    back = without_vanished(build, values)
    starts = [x] if back == values else [x, coordinates.inverse(back)]
    return max((marginal_estimate(objective, start) for start in starts), key=lambda one: one.found.log_evidence)


def _carried(solution: Solution) -> Reals:
    """Return the covariance of constants frozen after an earlier step, placed among all parameters."""
    names = solution.descent.objective.coordinates.parameters
    total = np.zeros((len(names), len(names)))
    for descent in solution.carried:
        at = [names.index(name) for name in descent.objective.coordinates.parameters]
        total[np.ix_(at, at)] += estimate(descent).covariance
    return total


def _aspect(build: Build) -> float | None:
    """Return diameter/thickness of the first piezo layer, if the diameter is known; without the hole of a ring."""
    if build.diameter is None:
        return None
    hole = 0.0 if build.hole_diameter is None else build.hole_diameter.re
    return (build.diameter.re - hole) / build.piezos[0].values["thickness"].re


def verdict(
    result: Estimate, build: Build, curves: Sequence[Curve], noise: float, told: MarginalEstimate | None
) -> tuple[str, ...]:
    """Return what a person must know before using the numbers; `told`: the fit with errors, if there is one."""
    says: list[str] = []
    misfit = result.chi2_per_dof > _MISFIT
    left = _left_beside_usual_errors(told) if misfit and told is not None else np.inf
    if left < LEFT_AT_MOST:
        says.append(
            f"Beside errors that the instrument may have, the fit leaves {100 * left:.1g} % of Z, where the noise is "
            f"{100 * noise:.1g} %: no more than the imperfections of a good device. The uncertainties include it."
        )
    elif misfit:
        errors = {step: _rms_of_step(curves, step) for step in dict.fromkeys(curve.step for curve in curves)}
        worst = max(errors, key=lambda step: errors[step])
        of, error = (f"step {worst!r}", errors[worst]) if len(errors) > 1 else ("this recording", result.rms_log_error)
        says.append(
            f"A 1-D model does not describe {of}: RMS log error {error:.2g} where the noise "
            f"is {noise:.1g} (chi2 per degree of freedom {result.chi2_per_dof:.3g}). The uncertainties are widened by "
            "the misfit, but the constants may have a bias that they do not include."
        )
        says += _lateral(build, curves)
    if not result.converged:
        says.append("The fit stopped before it converged; do not use these numbers.")
    return tuple(says)


def _left_beside_usual_errors(told: MarginalEstimate) -> float:
    """Return the rms of ln Z that neither constants nor usual errors explain; infinite if the errors are unusual."""
    return rms_of(unexplained_at(told.found)) if told.found.has_usual_errors else np.inf


def _rms_of_step(curves: Sequence[Curve], step: str) -> float:
    return rms(*(np.log(curve.fitted / curve.measured) for curve in curves if curve.step == step))


def _lateral(build: Build, curves: Sequence[Curve]) -> tuple[str, ...]:
    """Return the hint that a disk's diameter shows, if its bare recording has more resonances than a plate."""
    aspect, disk = _aspect(build), build.piezos[0]
    bare = [curve for curve in curves if build.step(curve.step).layers == (disk.name,)]
    if aspect is None or aspect > _WIDE or not bare or _rms_of_step(bare, bare[0].step) < _GROSS:
        return ()
    if not any(_resonances(c.frequency, c.measured) > _resonances(c.frequency, c.fitted) + 1 for c in bare):
        return ()
    if build.hole_diameter is not None:
        return (
            f"The wall of the ring is {aspect / 2:.1f} times as wide as thick: its lateral modes overlap the thickness "
            "resonance, and a 1-D model mistakes them for loss. `--fitter stack2d` models them.",
        )
    return (
        f"Diameter/thickness is {aspect:.1f}: radial overtones and the edge mode overlap the thickness resonance of "
        "such a disk, and a 1-D model mistakes them for loss. `--fitter disk2d` models them, for the bare disk, "
        "`--fitter stack2d` for all steps.",
    )


def _resonances(frequency: Frequencies, impedance: Impedances) -> int:
    """Return the number of maxima of the conductance that stand out from noise and rounding."""
    G = (1 / impedance).real
    return len(prominent_peaks(G, _PROMINENT * float(np.ptp(G)))[0])
