"""Fitter `sherrit-radial`: complex radial-mode constants from the critical frequencies, without iteration.

S. Sherrit, N. Gauthier, H. D. Wiederick, B. K. Mukherjee, Ferroelectrics 119 (1991) 17. The first two resonances give
Poisson's ratio and stiffness, the first antiresonance the coupling, frequencies away from them the permittivity.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Complexes, Frequencies
from ...models.constants.piezo_constants import Radial
from ...models.constants.sherrit import radial_constants
from ...models.disk.radial import RadialError
from ...models.disk.round_disk import RadialDisk
from ..interface import Constant, FitError, FitResult, FitTask
from .bare_disk import BareDisk, bare_disk
from .critical_frequencies import FEW_POINTS, Critical
from .direct_methods import drawn, method_answer, with_method_error
from .planar_result import RADIAL_ALL_UNITS, passivity_says, radial_named
from .radial_coordinates import RADIAL_CONSTANTS
from .radial_modes import RadialModes, radial_modes

PLANAR = ("c11p", "sigma_p", "kp", "eps33P")
_USUAL_ALPHA, _USUAL_D33F = 0.75, 1.3e-10
# c13E/c33E and e33/c33E of the usual ceramics: with them the method's error includes that of finite thickness.
_THICK = 40.0
# Diameter/thickness below which the thin-disk theory is off by more than 1 % in s12E


@dataclass(frozen=True, eq=False)
class _Seen:
    """Readings from the recordings."""

    modes: RadialModes
    far: tuple[Frequencies, Complexes, float] | None
    """Frequency (Hz) and impedance (ohm) away from resonances, and the relative noise of their mean."""
    eps33T: complex
    """Known permittivity; used only if no frequency is far enough from a resonance."""


class SherritRadial:
    """Sherrit's non-iterative method for the radial mode."""

    name = "sherrit-radial"
    version = "1"
    summary = "radial-mode constants from nine critical frequencies on Y/w and wZ (Sherrit 1991), bare round disk"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Read the critical frequencies and return the constants that follow from them.

        Raises FitError if the first two radial resonances are not both in the recordings, or too few points lie in a
        linewidth.
        """
        began = time.perf_counter()
        disk = bare_disk(task, self.name, round_one=True, frees=False)
        progress(f"reading the critical frequencies of {disk.step}")
        seen = _read(disk)
        sizes = {name: q.re for name, q in disk.sizes.items()}
        found = _constants(seen, _complex(seen.modes), 1.0, sizes)

        def draw(rng: np.random.Generator) -> dict[str, complex]:
            level = 1 + (seen.far[2] if seen.far else 0.0) * complex(rng.standard_normal(), rng.standard_normal())
            modes = seen.modes.first.drawn(rng), seen.modes.second.drawn(rng), seen.modes.parallel.drawn(rng)
            return radial_named(disk.layer.name, _constants(seen, modes, level, disk.drawn_sizes(rng)))

        u, values = drawn(draw), radial_named(disk.layer.name, found)
        thin = _model(disk, found)
        thick = thin.replace({f"{disk.layer.name}.alpha": _USUAL_ALPHA, f"{disk.layer.name}.d33f": _USUAL_D33F})
        again = replace(_read(disk.regenerated(thick)), eps33T=found.eps33T)
        u = with_method_error(
            u, values, radial_named(disk.layer.name, _constants(again, _complex(again.modes), 1.0, sizes))
        )
        return _answer(self, disk, thin, values, u, _says(disk, seen, found), time.perf_counter() - began)


def _complex(modes: RadialModes) -> tuple[complex, complex, complex]:
    return modes.first.at.complex, modes.second.at.complex, modes.parallel.at.complex


def _read(disk: BareDisk) -> _Seen:
    modes = radial_modes(disk)
    given = disk.layer.values.get("eps33T")
    far = _far(disk, modes)
    if far is None and given is None:
        raise FitError(
            "the recordings hold no frequency far enough from the resonances to show eps33T; add one down to "
            f"{0.5 * modes.first.at.top / 1e3:.3g} kHz, or give eps33T_r in build.toml"
        )
    return _Seen(modes, far, given.value if given is not None else 0j)


def _far(disk: BareDisk, modes: RadialModes) -> tuple[Frequencies, Complexes, float] | None:
    """Return the points that determine eps33T: well below the first resonance, else those farthest from resonances."""
    f = np.concatenate([sweep.frequency for sweep in disk.sweeps])
    Z = np.concatenate([sweep.impedance for sweep in disk.sweeps])
    noise = float(np.median(np.concatenate(disk.noises)))
    fs1, fp1, fs2 = modes.first.at.top, modes.parallel.at.top, modes.second.at.top
    for away in (f < 0.5 * fs1, f < 0.7 * fs1, f < 0.9 * fs1, (f > 1.3 * fp1) & (f < 0.9 * fs2)):
        count = int(np.count_nonzero(away))
        if count >= 3:
            return f[away], Z[away], noise / float(np.sqrt(count))
    return None


def _constants(seen: _Seen, modes: tuple[complex, complex, complex], level: complex, sizes: dict[str, float]) -> Radial:
    """Return the constants; `level`: factor on the far impedance.

    The resonance contributes even far below it, as (f/fs)^2; its contribution is divided out with the model's shape.
    """
    fs1, fs2, fp1 = modes
    radius = float(np.sqrt(sizes["area"] / np.pi))
    constants = radial_constants(fs1, fs2, fp1, seen.eps33T or 1e-8 + 0j, radius, sizes["density"])
    if seen.far is not None:
        f, Z, _ = seen.far
        try:
            shape = RadialDisk.of("disk", constants, sizes["area"], sizes["thickness"], sizes["density"])
        except RadialError as error:
            raise FitError(f"the critical frequencies are those of no material: {error}") from None
        factor = complex(np.mean(shape.impedance(f) / (Z * level)))
        constants = radial_constants(fs1, fs2, fp1, constants.eps33T * factor, radius, sizes["density"])
    return constants


def _model(disk: BareDisk, found: Radial) -> RadialDisk:
    sizes = disk.sizes
    try:
        return RadialDisk.of(disk.layer.name, found, sizes["area"].re, sizes["thickness"].re, sizes["density"].re)
    except RadialError as error:
        raise FitError(f"the critical frequencies are those of no material: {error}") from None


def _answer(
    fitter: SherritRadial,
    disk: BareDisk,
    model: RadialDisk,
    values: dict[str, complex],
    u: dict[str, tuple[float, float]],
    says: tuple[str, ...],
    seconds: float,
) -> FitResult:
    at = f"{disk.layer.name}."
    constants = {
        name: Constant(x.real, x.imag, *u[name], RADIAL_ALL_UNITS[name.removeprefix(at)]) for name, x in values.items()
    }
    own = {at + name for name in (*RADIAL_CONSTANTS, *PLANAR)}
    return method_answer(fitter, disk, model, 8, constants, own, says, seconds)


def _says(disk: BareDisk, seen: _Seen, found: Radial) -> tuple[str, ...]:
    read: tuple[tuple[str, Critical], ...] = (
        ("fs1", seen.modes.first),
        ("fp1", seen.modes.parallel),
        ("fs2", seen.modes.second),
    )
    frequencies = ", ".join(f"{name} {peak.at.top / 1e3:.6g} kHz" for name, peak in read)
    says = [
        f"Read: {frequencies}. Planar coupling kp {found.kp.real:.4f} (data sheets), kp_IEEE {found.kp_IEEE.real:.4f} "
        "(Sherrit's k^p, defined differently)."
    ]
    few = [f"{name} {peak.points_per_linewidth:.0f}" for name, peak in read if peak.points_per_linewidth < FEW_POINTS]
    if few:
        says.append(
            f"Points per linewidth: {', '.join(few)}; {FEW_POINTS:.0f} are needed. Imaginary parts suffer first."
        )
    if seen.far is None:
        says.append("eps33T is not measured here: it was taken from build or library.")
    says.append(passivity_says(found))
    aspect = 2 * disk.radius / disk.sizes["thickness"].re
    if aspect < _THICK:
        says.append(
            f"Diameter/thickness is {aspect:.3g}: finite thickness moves the overtone and makes sigma_p too large; the "
            "uncertainties include this for usual ceramics, and the fitter `radial` corrects it."
        )
    return tuple(says)
