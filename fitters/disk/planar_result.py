"""Result of least squares on a bare disk: constants, and uncertainties propagated to derived constants."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Reals
from ...models.base.model import Model
from ...models.constants.passivity import passivity_margin
from ...models.constants.piezo_constants import Radial
from ..engine.covariance import Estimate, estimate
from ..engine.descent import Descent
from ..engine.parameters.assembly import UNITS, between_bounds, is_held, weighings_of
from ..engine.parameters.coordinates import Block, Coordinates, positive
from ..engine.plausibility import strange
from ..engine.recording import Prior
from ..error_model.instrument_share import chi2_beside_instrument
from ..interface import Constant, FitResult, TaskError
from ..uncertainty.budget import budget_at
from ..uncertainty.derived import DERIVED_UNITS
from ..uncertainty.fit_result import curves_of, strong_correlations
from .bare_disk import RADIAL_UNITS, BareDisk

RADIAL_ALL_UNITS = {**RADIAL_UNITS, "Qm_radial": "1", "tan_delta_T": "1"}
_TENSOR_UNITS = {
    **dict.fromkeys(("c11E", "c12E", "c13E", "c33E", "c44E"), "Pa"),
    **dict.fromkeys(("e31", "e33", "e15"), "C/m2"),
    "eps11S": "F/m",
}
PLANAR_UNITS = {**_TENSOR_UNITS, **UNITS, **DERIVED_UNITS, **RADIAL_ALL_UNITS, "alpha": "1", "d33f": "C/N"}
_DERIVED = (*DERIVED_UNITS, "kp_IEEE", "e31p", "Qm_radial", "tan_delta_T")
_ALPHA, _U_ALPHA = 0.75, 0.09
_D33F, _U_D33F = 1.3e-10, 0.2e-10
# c13E/c33E is 0.66 to 0.83 and e33/c33E 1.05e-10 to 1.45e-10 C/N for the ceramics of the library. Two sets of the same
# ceramic differ by as much, so a library value is no better known.
_MISFIT = 1.5
_STEP = 1e-6


@dataclass(frozen=True)
class Named:
    """Name and version of the fitter that gives the result."""

    name: str
    version: str


def plate_priors(disk: BareDisk) -> dict[str, float]:
    """Return c13E/c33E and e33/c33E (C/N) from library or build, else those of usual ceramics."""
    v = disk.layer.values
    known = "c33E" in v
    return {
        f"{disk.layer.name}.alpha": v["c13E"].re / v["c33E"].re if known and "c13E" in v else _ALPHA,
        f"{disk.layer.name}.d33f": v["e33"].re / v["c33E"].re if known and "e33" in v else _D33F,
    }


def disk_priors(disk: BareDisk, constants: tuple[str, ...]) -> tuple[Prior, ...]:
    """Return the priors of sizes, of `constants`, and of the motion through the thickness."""
    at = disk.layer.name
    plate = plate_priors(disk)
    priors = [
        Prior(f"{at}.alpha", plate[f"{at}.alpha"], _U_ALPHA),
        Prior(f"{at}.d33f", plate[f"{at}.d33f"], _U_D33F),
    ]
    priors += [Prior(disk.size_name(name), q.re, q.u) for name, q in disk.sizes.items() if q.u > 0]
    for name in constants:
        q = disk.layer.values.get(name)
        if q is not None and q.u > 0:
            priors.append(Prior(f"{at}.{name}.re", q.re, q.u))
    return (*priors, *weighings_of(disk.build, (disk.step,)))


def planar_coordinates(
    disk: BareDisk,
    fitter: str,
    blocks: tuple[Block, ...],
    model: Model,
    constants: tuple[str, ...],
    together: tuple[str, ...],
    free: tuple[str, ...] | None,
) -> Coordinates:
    """Return the coordinates of a fit of the disk's `constants`, its sizes, and the motion through the thickness.

    `together`: constants that move in combination, such as s12E as Poisson's ratio; they have no bounds.

    Held constants keep the build's value, not that of the recording's peaks. Raises FitError for an unknown name or an
    unsupported bound.
    """
    at, plate = disk.layer.name, _plate(disk)
    quantities = {f"{at}.{name}": disk.layer.values[name] for name in constants if name in disk.layer.values}
    sizes = {disk.size_name(name): quantity for name, quantity in disk.sizes.items()}
    known = {*(f"{at}.{name}" for name in constants), *sizes, *plate}
    held = {name for name, quantity in quantities.items() if is_held(quantity, piezo_constant=True)}
    held |= {name for name, quantity in sizes.items() if quantity.u == 0}
    moving = known - held if free is None else set(free)
    if not moving <= known:
        raise TaskError(f"cannot free {min(moving - known)!r}: `{fitter}` has {', '.join(sorted(known))}")
    bounds = {name: q.bounds for name, q in (quantities | sizes).items() if q.bounds is not None and name in moving}
    blocks = (*blocks, *(positive(name) for name in sizes))
    for name in bounds:
        if name.removeprefix(f"{at}.") in together:
            raise TaskError(f"cannot bound {name!r}: `{fitter}` moves it together with others; give it a prior instead")
    blocks = tuple(
        between_bounds(block, {name: ends for name, ends in bounds.items() if name in block.coordinates})
        for block in blocks
    )
    wanted = tuple(variant for name in moving for variant in (name, f"{name}.loss"))
    stated = {f"{name}.{part}": getattr(q, part) for name, q in quantities.items() for part in ("re", "im")}
    stated |= {name: quantity.re for name, quantity in sizes.items()} | plate_priors(disk)
    start = model.parameters()
    return Coordinates(blocks, start, wanted).held_at({**start, **stated})


def _plate(disk: BareDisk) -> tuple[str, str]:
    return f"{disk.layer.name}.alpha", f"{disk.layer.name}.d33f"


def radial_of(values: Mapping[str, float], layer: str) -> Radial:
    """Return the radial constants from model parameters."""
    return Radial(
        *(complex(values[f"{layer}.{n}.re"], values[f"{layer}.{n}.im"]) for n in ("s11E", "s12E", "d31", "eps33T"))
    )


def radial_named(layer: str, found: Radial) -> dict[str, complex]:
    """Return all radial constants by full name, SI; `Qm_radial` is c11p'/c11p'', `tan_delta_T` that of eps33T."""
    named = {name: complex(getattr(found, "eps33p" if name == "eps33P" else name)) for name in RADIAL_UNITS}
    named |= {"Qm_radial": complex(found.Qm), "tan_delta_T": complex(-found.eps33T.imag / found.eps33T.real)}
    return {f"{layer}.{name}": value for name, value in named.items()}


def propagated(
    make: Callable[[Mapping[str, float]], Mapping[str, complex]],
    values: Mapping[str, float],
    names: tuple[str, ...],
    covariance: Reals,
) -> dict[str, tuple[float, float]]:
    """Return the standard uncertainties of real and imaginary part of all results of `make`."""
    there = make(values)
    gradients = {name: np.zeros(len(names), np.complex128) for name in there}
    for k, name in enumerate(names):
        if covariance[k, k] == 0:
            continue
        step = min(_STEP * abs(values[name]) or _STEP, math.sqrt(covariance[k, k]))
        up, down = (make({**values, name: values[name] + side * step}) for side in (1, -1))
        for constant in there:
            gradients[constant][k] = (up[constant] - down[constant]) / (2 * step)

    def size(g: Reals) -> float:
        return math.sqrt(max(0.0, float(g @ covariance @ g)))

    return {name: (size(g.real), size(g.imag)) for name, g in gradients.items()}


def planar_answer(
    fitter: Named,
    disk: BareDisk,
    descent: Descent,
    make: Callable[[Mapping[str, float]], Mapping[str, complex]],
    says: tuple[str, ...],
    seconds: float,
) -> FitResult:
    """Return the result; `make` computes all complex constants from the model's parameters."""
    objective, result = descent.objective, estimate(descent)
    coordinates = objective.coordinates
    chi2 = chi2_beside_instrument(objective.recordings, objective.log_ratios(result.x), result.x.size)
    result = replace(result, chi2_per_dof=chi2)
    values, _ = coordinates.forward(result.x)
    names = coordinates.parameters
    u = propagated(make, values, names, result.covariance)
    constants: dict[str, Constant] = {}
    for name, x in make(values).items():
        constants[name] = Constant(x.real, x.imag, *u[name], PLANAR_UNITS[name.split(".")[1]], free=u[name][0] > 0)
    for k, name in enumerate(names):
        if name.split(".")[-1] in PLANAR_UNITS:
            spread = math.sqrt(max(0.0, float(result.covariance[k, k])))
            constants[name] = Constant(
                values[name], 0.0, spread, 0.0, PLANAR_UNITS[name.split(".")[-1]], free=spread > 0
            )
    derived = {name for name in constants if name.split(".")[-1] in _DERIVED}
    return FitResult(
        build=disk.build.name,
        fitter=fitter.name,
        version=fitter.version,
        steps=(disk.step,),
        noise=disk.noise,
        chi2_per_dof=result.chi2_per_dof,
        constants={name: c for name, c in constants.items() if name not in derived},
        derived={name: c for name, c in constants.items() if name in derived},
        correlation=strong_correlations(names, result.covariance),
        rms_log_error=result.rms_log_error,
        converged=result.converged,
        evaluations=descent.evaluations,
        seconds=seconds,
        says=(*says, *strange(disk.build, disk.layer, constants), *_verdict(result, disk)),
        curves=curves_of(objective, descent.start, result.x),
        budget=budget_at(objective, result.x),
    )


def passivity_says(found: Radial) -> str:
    """Return a sentence on Holland's passivity condition."""
    margin = passivity_margin(found.law)
    if margin >= -1e-9:
        return f"Passivity check passed: the smallest loss tangent is {margin:.2g} (Holland)."
    return f"Passivity check FAILED: the smallest loss is {margin:.2g} (Holland). An imaginary part must be wrong."


def _verdict(result: Estimate, disk: BareDisk) -> tuple[str, ...]:
    says: list[str] = []
    if result.chi2_per_dof > _MISFIT:
        says.append(
            f"The model does not describe this recording to its noise: RMS log error {result.rms_log_error:.2g} where "
            f"the noise is {disk.noise.relative:.1g}. The uncertainties are widened by the misfit."
        )
    if not result.converged:
        says.append("The fit stopped before it converged; do not use these numbers.")
    return tuple(says)
