"""The coupling objective of E. S. Tjelde (NTNU 2012), eq. (3.2) corrected: |h33^2 eps33S/c33D - kt^2|^2, complex.

kt^2 = (pi/2)(fs/fp) tan[(pi/2)(fp - fs)/fp] and c33D = 4 density (thickness fp)^2, where fs and fp are the complex
critical frequencies (S. Sherrit et al., Ferroelectrics 134 (1992) 65). Both form a recording of two points, whose model
computes them from the constants; priors, ties and uncertainties are therefore those of any other fit.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances
from ...models.constants.sherrit import coupling_squared
from ...models.sweep import Sweep
from ..disk.bare_disk import BareDisk, bare_disk
from ..disk.critical_frequencies import Critical, ImmittanceTrace, admittance_trace, critical, impedance_trace, tops
from ..disk.sherrit_thickness import thickness_pair
from ..engine.descent import settle
from ..engine.multi_step_fit import Solution, check_task
from ..engine.noise import noise_of
from ..engine.parameters.assembly import coordinates_of, nominal_parameters, priors_of, recordings_of
from ..engine.recording import Recording
from ..interface import FitError, FitTask

_DRAWS = 400
_PARTS = ("c33D.re", "c33D.im", "h33.re", "h33.im", "eps33S.re", "eps33S.im", "thickness", "density")


@dataclass(frozen=True)
class Coupling:
    """Model of a free plate's critical frequencies: fp^2 (Hz^2) and kt^2, as two complex numbers."""

    layer: str
    values: Mapping[str, float]
    """Values by full parameter name, SI."""

    def parameters(self) -> Mapping[str, float]:
        """Return every parameter with its value."""
        return self.values

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the model with these parameters changed."""
        return replace(self, values={**self.values, **values})

    def _constants(self) -> tuple[complex, complex, complex, float, float]:
        v = [self.values[f"{self.layer}.{part}"] for part in _PARTS]
        return complex(v[0], v[1]), complex(v[2], v[3]), complex(v[4], v[5]), v[6], v[7]

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return fp^2 and kt^2, shape (2,); `frequency` only gives their number."""
        c, h, eps, thickness, density = self._constants()
        return np.array([c / (4 * density * thickness**2), h**2 * eps / c])[: frequency.size]

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return both and the derivatives of their logarithms, shape (P, 2)."""
        c, h, eps, thickness, density = self._constants()
        slopes = {
            "c33D": (1 / c, -1 / c),
            "h33": (0.0, 2 / h),
            "eps33S": (0.0, 1 / eps),
            "thickness": (-2 / thickness, 0.0),
            "density": (-1 / density, 0.0),
        }
        rows = [
            np.array(slopes[name.split(".")[1]], dtype=np.complex128) * (1j if name.endswith(".im") else 1.0)
            for name in names
        ]
        return self.impedance(frequency), np.array(rows).reshape(len(names), 2)


def solve_coupling(task: FitTask, progress: Callable[[str], None]) -> Solution:
    """Fit stiffness and coupling to the critical frequencies of the bare disk; priors determine everything else.

    Raises FitError if the recordings are not of one bare disk, or its critical frequencies cannot be read.
    """
    began = time.perf_counter()
    build, sweeps = check_task(task)
    if len(sweeps) > 1:
        raise FitError(f"the objective kt2 is about the bare piezo disk alone; steps {', '.join(sweeps)} were given")
    (step,) = sweeps
    if build.reground(step):
        raise FitError(f"the objective kt2 is about the disk as it came; before step {step!r} it was ground")
    noise, sigmas = noise_of(sweeps[step])
    progress(f"reading the critical frequencies of {step}")
    values = nominal_parameters(build)
    coordinates = coordinates_of(build, [step], values, task.free)
    descent = settle([coupling_recording(task, values)], coordinates, priors_of(build, [step]), coordinates.x)
    whole = recordings_of(build, step, sweeps[step], sigmas)
    seconds = time.perf_counter() - began
    return Solution(build, {step: noise}, descent, values, descent.evaluations, seconds, tuple(whole))


def coupling_recording(task: FitTask, values: Mapping[str, float]) -> Recording:
    """Return the critical frequencies of a bare disk as a recording. Raises FitError if they cannot be read."""
    disk = bare_disk(replace(task, free=None), "the objective kt2", round_one=False, frees=True)
    fs, fp = _read(disk)
    model = Coupling(
        disk.layer.name, {f"{disk.layer.name}.{part}": values[f"{disk.layer.name}.{part}"] for part in _PARTS}
    )
    seen = _both(fs.at.complex, fp.at.complex)
    rng = np.random.default_rng(1)
    drawn = np.array([np.log(_both(fs.drawn(rng), fp.drawn(rng)) / seen) for _ in range(_DRAWS)])
    noise = np.sqrt(np.mean(np.abs(drawn) ** 2, axis=0) / 2)
    sweep = Sweep(np.array([fs.at.top, fp.at.top]), seen, id="critical frequencies")
    return Recording(disk.step, sweep, model, noise)


def _both(fs: complex, fp: complex) -> Complexes:
    return np.array([fp**2, coupling_squared(fs, fp)])


def _read(disk: BareDisk) -> tuple[Critical, Critical]:
    high = disk.between(0.5 * disk.expected_thickness_mode, np.inf)
    bands = list(zip(high.sweeps, high.noises, strict=True))
    pair = thickness_pair(disk, high.sweeps)
    series = _top([admittance_trace(*band) for band in bands], pair.fs, "the resonance")
    return series, _top([impedance_trace(*band) for band in bands], pair.fp, "the antiresonance")


def _top(traces: Sequence[ImmittanceTrace], near: float, what: str) -> Critical:
    trace, k, _ = min(
        tops(traces, 0.995 * near, 1.005 * near), key=lambda peak: float(np.median(np.diff(peak[0].frequency)))
    )
    return critical(trace, k, what)
