"""Fitter `sherrit-thickness`: complex thickness-mode constants from the critical frequencies, without iteration.

S. Sherrit, H. D. Wiederick, B. K. Mukherjee, Ferroelectrics 134 (1992) 65.
"""

import cmath
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Reals
from ...models.constants.passivity import passivity_margin
from ...models.constants.piezo_constants import Thickness
from ...models.constants.sherrit import coupling_squared
from ...models.stack import Stack
from ...models.sweep import Sweep
from ..engine.parameters.assembly import PIEZO_CONSTANTS, UNITS, stack_of
from ..engine.plausibility import refuse_lost
from ..engine.start import DiskStart, disk_starts
from ..interface import Constant, FitError, FitResult, FitTask
from ..uncertainty.derived import DERIVED_UNITS, derived_of
from .bare_disk import BareDisk, bare_disk
from .critical_frequencies import (
    FEW_POINTS,
    Critical,
    ImmittanceTrace,
    admittance_trace,
    critical,
    impedance_trace,
    tops,
)
from .direct_methods import drawn, method_answer, with_method_error

_NEAR_EXPECTED = (0.55, 1.8)
# Thickness antiresonance over the expected one: a stiffness three times off belongs to another mode.


@dataclass(frozen=True, eq=False)
class _Seen:
    """Readings from the recording."""

    fs: Critical
    fp: Critical
    far: tuple[Frequencies, Complexes, float]
    """Frequency (Hz) and impedance (ohm) away from the resonance, and the relative noise of their mean."""


class SherritThickness:
    """Sherrit's non-iterative method for the thickness mode."""

    name = "sherrit-thickness"
    version = "1"
    summary = "thickness-mode constants from six critical frequencies on Y/w and wZ (Sherrit 1992), bare disk"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Read the critical frequencies and return the constants that follow from them.

        Raises FitError if the recording shows no thickness resonance, or too few points lie in its linewidth.
        """
        began = time.perf_counter()
        disk = bare_disk(task, self.name, round_one=False, frees=False)
        progress(f"reading the critical frequencies of {disk.step}")
        seen = _read(disk)
        constants = _made(disk, seen)

        def draw(rng: np.random.Generator) -> dict[str, complex]:
            level = 1 + seen.far[2] * complex(rng.standard_normal(), rng.standard_normal())
            sizes = disk.drawn_sizes(rng)
            return _named(disk, _constants(seen.fs.drawn(rng), seen.fp.drawn(rng), seen.far, level, sizes), sizes)

        u, model = drawn(draw), _model(disk, constants)
        values = _named(disk, constants, _sizes(disk))
        again = disk.regenerated(model)
        u = with_method_error(u, values, _named(disk, _made(again, _read(again)), _sizes(disk)))
        return _answer(self, disk, model, values, u, _says(seen, constants), time.perf_counter() - began)


def _sizes(disk: BareDisk) -> dict[str, float]:
    return {name: q.re for name, q in disk.sizes.items()}


def _made(disk: BareDisk, seen: _Seen) -> Thickness:
    return _constants(seen.fs.at.complex, seen.fp.at.complex, seen.far, 1.0, _sizes(disk))


def _model(disk: BareDisk, found: Thickness) -> Stack:
    """Return the plate with these constants between the build's loads."""
    parts: dict[str, float] = {}
    for name in PIEZO_CONSTANTS:
        value: complex = getattr(found, name)
        parts |= {f"{disk.layer.name}.{name}.re": value.real, f"{disk.layer.name}.{name}.im": value.imag}
    return stack_of(disk.build, disk.build.step(disk.step)).replace(parts)


def _read(disk: BareDisk) -> _Seen:
    high = disk.between(0.5 * disk.expected_thickness_mode, np.inf)
    bands = list(zip(high.sweeps, high.noises, strict=True))
    start = thickness_pair(disk, high.sweeps)
    series = [admittance_trace(*band) for band in bands]
    parallel = [impedance_trace(*band) for band in bands]
    fs, fp = _peak(series, start.fs, "the resonance"), _peak(parallel, start.fp, "the antiresonance")
    return _Seen(fs, fp, _far(bands, fs, fp))


def thickness_pair(disk: BareDisk, sweeps: Sequence[Sweep]) -> DiskStart:
    """Return the resonance pair of the thickness mode. Raises FitError."""
    expected, sizes = disk.expected_thickness_mode, disk.sizes
    starts: list[DiskStart] = []
    for sweep in sweeps:
        with suppress(FitError):
            starts += disk_starts(sweep, sizes["thickness"].re, sizes["density"].re, sizes["area"].re)
    near = [start for start in starts if _NEAR_EXPECTED[0] < start.fp / expected < _NEAR_EXPECTED[1]]
    if near:
        return min(near, key=lambda start: start.misfit)
    loss = disk.layer.values["c33D"]
    refuse_lost(sweeps, expected, loss.im / loss.re)
    seen = f"; the pair at {starts[0].fs / 1e6:.4g} and {starts[0].fp / 1e6:.4g} MHz is another mode" if starts else ""
    raise FitError(
        f"no thickness resonance in {disk.bands}: it is expected near {expected / 1e6:.3g} MHz for this thickness{seen}"
    )


def _peak(traces: Sequence[ImmittanceTrace], near: float, what: str) -> Critical:
    """Return the critical frequencies of the peak near a frequency, from the finest sweep that contains it."""
    there = tops(traces, 0.995 * near, 1.005 * near)
    trace, k, _ = min(there, key=lambda peak: float(np.median(np.diff(peak[0].frequency))))
    return critical(trace, k, what)


def _far(bands: Sequence[tuple[Sweep, Reals]], fs: Critical, fp: Critical) -> tuple[Frequencies, Complexes, float]:
    """Return the points that determine eps33S: near 2 fp, where motion contributes least, else the farthest ones."""
    f = np.concatenate([sweep.frequency for sweep, _ in bands])
    Z = np.concatenate([sweep.impedance for sweep, _ in bands])
    noise = float(np.median(np.concatenate([noise for _, noise in bands])))
    for away in (
        np.abs(f / fp.at.top - 2) < 0.3,
        (f > 1.25 * fp.at.top) & (f < 2.7 * fp.at.top),
        (f < 0.85 * fs.at.top),
        (f > 1.08 * fp.at.top) & (f < 2.8 * fp.at.top),
    ):
        count = int(np.count_nonzero(away))
        if count >= 5:
            return f[away], Z[away], noise / float(np.sqrt(count))
    raise FitError(
        f"the recording ends at {f.max() / 1e6:.4g} MHz, too near the resonance to show eps33S; "
        f"sweep up to {2 * fp.at.top / 1e6:.3g} MHz, or down to {0.8 * fs.at.top / 1e6:.3g} MHz"
    )


def _constants(
    fs: complex, fp: complex, far: tuple[Frequencies, Complexes, float], level: complex, sizes: dict[str, float]
) -> Thickness:
    """Return the constants; `level`: factor on the far impedance."""
    kt2 = coupling_squared(fs, fp)
    if kt2.real <= 0:
        raise FitError(f"the resonance lies at {fs.real:.6g} Hz, above the antiresonance at {fp.real:.6g} Hz")
    f, Z, _ = far
    X = np.pi / 2 * f / fp
    clamped = sizes["thickness"] / (2j * np.pi * f * sizes["area"] * Z * level) * (1 - kt2 * np.tan(X) / X)
    c33D = 4 * sizes["density"] * (sizes["thickness"] * fp) ** 2
    return Thickness.from_coupling(c33D, cmath.sqrt(kt2), complex(np.mean(clamped)))


def _named(disk: BareDisk, found: Thickness, sizes: dict[str, float]) -> dict[str, complex]:
    """Return the constants and the derived constants by full name."""
    layer = disk.layer
    values = {f"{layer.name}.{name}": sizes[name] for name in ("thickness", "density")}
    constants: dict[str, complex] = {f"{layer.name}.{name}": getattr(found, name) for name in PIEZO_CONSTANTS}
    for name, value in constants.items():
        values |= {f"{name}.re": value.real, f"{name}.im": value.imag}
    return constants | derived_of(layer, values)


def _answer(
    fitter: SherritThickness,
    disk: BareDisk,
    model: Stack,
    values: dict[str, complex],
    u: dict[str, tuple[float, float]],
    says: tuple[str, ...],
    seconds: float,
) -> FitResult:
    units = {f"{disk.layer.name}.{name}": unit for name, unit in (UNITS | DERIVED_UNITS).items()}
    constants = {name: Constant(x.real, x.imag, *u[name], units[name]) for name, x in values.items()}
    own = {f"{disk.layer.name}.{name}" for name in PIEZO_CONSTANTS}
    return method_answer(fitter, disk, model, 6, constants, own, says, seconds)


def _says(seen: _Seen, found: Thickness) -> tuple[str, ...]:
    says = [
        f"Read: fs {seen.fs.at.top / 1e6:.6g} MHz, fp {seen.fp.at.top / 1e6:.6g} MHz; half widths "
        f"{(seen.fs.at.minus - seen.fs.at.plus) / 1e3:.4g} and {(seen.fp.at.minus - seen.fp.at.plus) / 1e3:.4g} kHz. "
        "The uncertainties include noise, sizes, and the error of the method."
    ]
    fewest = min(seen.fs.points_per_linewidth, seen.fp.points_per_linewidth)
    if fewest < FEW_POINTS:
        lie = "point lies" if round(fewest) == 1 else "points lie"
        says.append(
            f"Only {fewest:.0f} {lie} in the linewidth; {FEW_POINTS:.0f} are needed. Imaginary parts suffer first."
        )
    margin = passivity_margin(found.law)
    if margin < 0:
        says.append(
            f"These constants are not passive (smallest loss {margin:.2g}), unlike any material. An imaginary part is "
            "wrong, usually that of h33; real parts may still be right."
        )
    return tuple(says)
