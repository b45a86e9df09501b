"""Common parts of direct methods, which read constants off a curve: uncertainties by random draws, and the result."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from ...models.base.model import Model
from ..engine.plausibility import strange
from ..interface import Constant, FitError, FitResult, Fitter
from .bare_disk import BareDisk

_DRAWS = 400


def spreads(draws: Sequence[Mapping[str, complex]]) -> dict[str, tuple[float, float]]:
    """Return the standard deviation of real and imaginary part of each constant over random draws."""

    def deviation(parts: list[float]) -> float:
        return float(np.std(np.array(parts), ddof=1))

    return {
        name: (deviation([draw[name].real for draw in draws]), deviation([draw[name].imag for draw in draws]))
        for name in draws[0]
    }


def with_method_error(
    u: Mapping[str, tuple[float, float]], found: Mapping[str, complex], again: Mapping[str, complex]
) -> dict[str, tuple[float, float]]:
    """Return uncertainties that include the error of the method.

    `again`: result of the method for a spectrum computed from the constants it `found`.
    """
    return {
        name: (
            math.hypot(u[name][0], again[name].real - found[name].real),
            math.hypot(u[name][1], again[name].imag - found[name].imag),
        )
        for name in u
    }


def drawn(make: Callable[[np.random.Generator], Mapping[str, complex]]) -> dict[str, tuple[float, float]]:
    """Return the spread of the results of `make` over seeded draws, without draws that are no possible material.

    Raises FitError if most of them are impossible: then the recording does not determine the constants.
    """
    rng = np.random.default_rng(0)
    draws: list[Mapping[str, complex]] = []
    for _ in range(_DRAWS):
        try:
            draw = make(rng)
        except (ZeroDivisionError, OverflowError, FitError):
            continue
        if all(map(np.isfinite, draw.values())):
            draws.append(draw)
    if len(draws) < _DRAWS // 2:
        raise FitError(
            "the critical frequencies are too uncertain: most values within their noise belong to no possible material"
        )
    return spreads(draws)


def size_constants(disk: BareDisk) -> dict[str, Constant]:
    """Return thickness, density and area as used; they are not fitted."""
    units = {"thickness": "m", "density": "kg/m3", "area": "m2"}
    return {
        disk.size_name(name): Constant(q.re, 0.0, q.u, 0.0, units[name], free=False) for name, q in disk.sizes.items()
    }


def method_answer(
    fitter: Fitter,
    disk: BareDisk,
    model: Model,
    numbers: int,
    made: Mapping[str, Constant],
    own: Collection[str],
    says: tuple[str, ...],
    seconds: float,
) -> FitResult:
    """Return the result of a direct method; `numbers` is how many numbers it reads off the curve.

    Among the constants `made`, those named in `own` are its primary ones; the others are derived.
    """
    chi2, rms = disk.misfit(model, numbers)
    return FitResult(
        build=disk.build.name,
        fitter=fitter.name,
        version=fitter.version,
        steps=(disk.step,),
        noise=disk.noise,
        chi2_per_dof=chi2,
        constants={name: c for name, c in made.items() if name in own} | size_constants(disk),
        derived={name: c for name, c in made.items() if name not in own},
        correlation=(),
        rms_log_error=rms,
        converged=True,
        evaluations=1,
        seconds=seconds,
        says=(*says, *strange(disk.build, disk.layer, made)),
        curves=disk.curves(model),
    )
