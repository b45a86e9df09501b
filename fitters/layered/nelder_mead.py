"""Fitter `mason-nelder-mead`: the procedure of a 2012 master thesis, as the baseline of comparisons.

E. S. Tjelde, Model based estimation of the complex material constants ... (NTNU, 2012), chapter 3.4, with its printed
errors corrected: the coupling objective (3.2) is |h^2 eps/c - kt^2|^2, and losses are passive under exp(+jwt).
Nelder-Mead as in MATLAB's `fminsearch` (Lagarias et al., SIAM J. Optim. 9 (1998) 112), which is SciPy's: 1000
evaluations, tolerances 1e-6, no bounds, layers one after another, each frozen before the next. No uncertainties.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ...models.base.arrays import Complexes, Reals
from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from ..engine.multi_step_fit import check_task, refuse_effects
from ..engine.noise import noise_of
from ..engine.parameters.assembly import ground_name, layers_of, nominal_parameters, renamed, stack_of
from ..engine.plausibility import doubts, refuse_degenerate
from ..engine.recording import log_ratio, rms
from ..engine.start import coupling_squared, disk_starts
from ..interface import Curve, FitError, FitResult, FitTask, TaskError
from ..uncertainty.derived import derived_constants
from ..uncertainty.fit_result import fitted_constants

_MAX_EVALUATIONS = 1000
_TOLERANCE = 1e-6
_EPS0 = 8.8541878128e-12
_START_H33 = 19.8e8 * (1 - 0.005j)
_START_EPS33S = (914 - 10j) * _EPS0
_START_Q = 80.0
# Table 3.1 of the thesis; the sign of h'' follows from passivity under exp(+jwt).


@dataclass
class _Search:
    """Successive Nelder-Mead searches over a growing set of known values."""

    values: dict[str, float]
    evaluations: int = 0
    converged: bool = True

    def minimise(self, error: Callable[[Reals], float], x: Reals) -> Reals:
        """Return the result of Nelder-Mead; `x` is in the thesis's own units, to which its tolerances refer."""
        result = minimize(
            error,
            x,
            method="Nelder-Mead",
            options={
                "maxfev": _MAX_EVALUATIONS,
                "maxiter": _MAX_EVALUATIONS,
                "xatol": _TOLERANCE,
                "fatol": _TOLERANCE,
            },
        )
        self.evaluations += int(result.nfev)
        self.converged = self.converged and bool(result.success)
        return np.asarray(result.x)


def _set_disk(values: dict[str, float], disk: str, x: Reals) -> dict[str, float]:
    """Return values with x = h' h'' (1e8 V/m), eps' eps'' (relative), Q, z (MRayl), c (m/s)."""
    h_re, h_im, e_re, e_im, Q, z, c = (float(value) for value in x)
    stiffness = 1e6 * z * c
    return values | {
        f"{disk}.h33.re": 1e8 * h_re,
        f"{disk}.h33.im": 1e8 * h_im,
        f"{disk}.eps33S.re": _EPS0 * e_re,
        f"{disk}.eps33S.im": _EPS0 * e_im,
        f"{disk}.c33D.re": stiffness,
        f"{disk}.c33D.im": stiffness / Q,
        f"{disk}.density": 1e6 * z / c,
    }


class MasonNelderMead:
    """The thesis's staged Nelder-Mead on the 1-D stack: the baseline, without uncertainties."""

    name = "mason-nelder-mead"
    version = "1"
    summary = "the 2012 thesis's staged Nelder-Mead on sum |w dZ|^2, layer by layer, no uncertainty (baseline)"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit one step after another, earlier constants frozen. Raises FitError if a step cannot be fitted this way."""
        began = time.perf_counter()
        if task.free is not None:
            raise TaskError(f"the procedure of `{self.name}` is fixed: it cannot free {', '.join(task.free)} alone")
        build, sweeps = check_task(task)
        refuse_effects(build, self.name)
        if len(build.piezos) > 1:
            names = ", ".join(layer.name for layer in build.piezos)
            raise TaskError(f"{self.name} fits a single piezo layer; build {build.name!r} has {names}: use mason")
        refuse_degenerate(build, sweeps)
        first = next(iter(sweeps))
        if [build.layer(name).kind for name in build.step(first).layers] != ["piezo"]:
            raise FitError(f"{self.name} begins with the bare piezo disk; no recording of such a step was given")
        search = _Search(nominal_parameters(build))
        begun = dict(search.values)
        done: set[str] = set()
        for step, of_step in sweeps.items():
            progress(f"fitting {step}")
            new = [name for name in build.step(step).layers if name not in done]
            error = _error(build, step, of_step)
            if not done:
                begun.update(_fit_disk(search, build.step(step).layers[0], of_step[0], error))
            else:
                _fit_layers(search, build, step, new, error)
            done |= set(build.step(step).layers)
        return _answer(self, build, sweeps, search, begun, time.perf_counter() - began)


def _error(build: Build, step: str, sweeps: Sequence[Sweep]) -> Callable[[dict[str, float]], float]:
    """Return the thesis's objective (3.1) of one step: sum |w Z_model - w Z_measured|^2.

    It is infinite outside the physical range (a glue of negative thickness), which turns the simplex back.
    """
    stack, parts = stack_of(build, build.step(step)), _parts(build, step)

    def error(values: dict[str, float]) -> float:
        try:
            model = stack.replace({parameter: values[name] for parameter, name in parts.items()})
        except PzctlError:
            return np.inf
        total = 0.0
        for sweep in sweeps:
            difference = 2 * np.pi * sweep.frequency * (model.impedance(sweep.frequency) - sweep.impedance)
            total += float(np.sum(np.abs(difference) ** 2))
        return total

    return error


def _parts(build: Build, step: str) -> dict[str, str]:
    """Return the search's name of each parameter of a step's stack; unknown ones keep their value."""
    known, ground = nominal_parameters(build), renamed(build, step)
    names = stack_of(build, build.step(step)).parameters()
    return {name: ground.get(name, name) for name in names if ground.get(name, name) in known}


def _fit_disk(search: _Search, disk: str, sweep: Sweep, error: Callable[[dict[str, float]], float]) -> dict[str, float]:
    """Carry out the stages f_p -> c -> Z, kt^2, (h, eps, Q), (z, c). Return the starting values."""
    values = search.values
    thickness, density = values[f"{disk}.thickness"], values[f"{disk}.density"]
    seen = disk_starts(sweep, thickness, density, values["area"])[0]
    c = 2 * thickness * seen.fp
    x = np.array(
        [
            *(_START_H33.real / 1e8, _START_H33.imag / 1e8),
            *(_START_EPS33S.real / _EPS0, _START_EPS33S.imag / _EPS0),
            *(_START_Q, density * c / 1e6, c),
        ]
    )
    start = _set_disk(values, disk, x)
    kt2 = coupling_squared(seen.fs, seen.fp)

    def coupling_error(part: Reals) -> float:
        h, eps = 1e8 * complex(part[0], part[1]), _EPS0 * complex(part[2], part[3])
        stiffness = 1e6 * x[5] * x[6] * (1 + 1j / x[4])
        return abs(h**2 * eps / stiffness - kt2) ** 2

    def place(part: Reals, at: slice) -> Reals:
        whole = x.copy()
        whole[at] = part
        return whole

    x = place(search.minimise(coupling_error, x[:4]), slice(0, 4))
    for at in (slice(0, 5), slice(5, 7)):
        x = place(search.minimise(lambda part, at=at: error(_set_disk(values, disk, place(part, at))), x[at]), at)
    search.values = _set_disk(values, disk, x)
    return start


def _fit_layers(
    search: _Search, build: Build, step: str, new: Sequence[str], error: Callable[[dict[str, float]], float]
) -> None:
    """Fit z, c, q of each new matching layer, and the thickness of each new glue and of each ground layer.

    A layer counts as glue if the build holds its constants (a bare number): only its thickness is fitted.
    """
    units = {"z": 1e6, "c": 1.0, "q": 1.0, "thickness": 1e-3}
    ground = [(ground_name(layer, step), 1e-3) for layer in build.step(step).reground]
    names = [
        (f"{layer}.{constant}", units[constant])
        for layer in new
        for constant in (("z", "c", "q") if build.layer(layer).values["c"].u > 0 else ("thickness",))
    ]
    names += ground
    values = search.values
    if not names:
        return

    def set_to(x: Reals) -> dict[str, float]:
        return values | {name: unit * float(value) for (name, unit), value in zip(names, x, strict=True)}

    x = search.minimise(lambda x: error(set_to(x)), np.array([values[name] / unit for name, unit in names]))
    search.values = set_to(x)


def _answer(
    fitter: MasonNelderMead,
    build: Build,
    sweeps: dict[str, tuple[Sweep, ...]],
    search: _Search,
    begun: dict[str, float],
    seconds: float,
) -> FitResult:
    layers = layers_of(build, sweeps)
    noise_by_step = {step: noise_of(of_step) for step, of_step in sweeps.items()}
    curves: list[Curve] = []
    misfits: list[Complexes] = []
    weighted = 0.0
    for step, of_step in sweeps.items():
        stack = stack_of(build, build.step(step))
        parts = _parts(build, step)
        before = stack.replace({parameter: begun[name] for parameter, name in parts.items()})
        after = stack.replace({parameter: search.values[name] for parameter, name in parts.items()})
        for sweep, sigma in zip(of_step, noise_by_step[step][1], strict=True):
            f = sweep.frequency
            curves.append(Curve(step, f, sweep.impedance, before.impedance(f), after.impedance(f)))
            misfits.append(log_ratio(curves[-1].fitted, sweep.impedance))
            weighted += float(np.sum(np.abs(misfits[-1] / sigma) ** 2))
    misfit = np.concatenate(misfits)
    constants, derived = (make(layers, search.values, (), None) for make in (fitted_constants, derived_constants))
    return FitResult(
        build=build.name,
        fitter=fitter.name,
        version=fitter.version,
        steps=tuple(sweeps),
        noise=max((noise for noise, _ in noise_by_step.values()), key=lambda n: n.relative),
        chi2_per_dof=weighted / (2 * misfit.size),
        constants=constants,
        derived=derived,
        correlation=(),
        rms_log_error=rms(misfit),
        converged=search.converged,
        evaluations=search.evaluations,
        seconds=seconds,
        says=(
            *doubts(build, sweeps, constants, derived, rms(misfit)),
            "This baseline fitter gives no uncertainties and may have ended in a local minimum. It fits the "
            "constants of the thesis and ignores held values, ties, bounds and priors.",
        ),
        curves=tuple(curves),
    )
