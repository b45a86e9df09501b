"""Selection of the recordings of a bare piezo disk, common to all its fitters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Reals
from ...models.base.model import Model
from ...models.build import Build, LayerSpec, Quantity
from ...models.sweep import Sweep
from ..engine.multi_step_fit import check_task, refuse_effects
from ..engine.noise import noise_of
from ..engine.plausibility import refuse_another_device
from ..engine.recording import log_ratio, rms
from ..interface import Curve, FitError, FitTask, Noise, TaskError

RADIAL_UNITS = {
    "s11E": "1/Pa",
    "s12E": "1/Pa",
    "d31": "C/N",
    "eps33T": "F/m",
    "c11p": "Pa",
    "sigma_p": "1",
    "kp": "1",
    "kp_IEEE": "1",
    "eps33P": "F/m",
    "e31p": "C/m2",
}
_GENERIC_SPEED = 2900.0
# m/s: sqrt(c11p/density) of soft PZT, for a disk without known radial constants
_FIRST_ETA = 2.07
# First root of J(eta) = 1 - sigma for sigma 0.33


@dataclass(frozen=True, eq=False)
class BareDisk:
    """The recordings of a step with a single piezo disk."""

    build: Build
    step: str
    layer: LayerSpec
    sweeps: tuple[Sweep, ...]
    """Repeats on one frequency grid are averaged into one."""
    noises: tuple[Reals, ...]
    """Standard deviation of Re and Im of ln Z at each point of each sweep, shape (N,)."""
    noise: Noise

    @property
    def sizes(self) -> dict[str, Quantity]:
        """`area` (m2), `thickness` (m), `density` (kg/m3)."""
        return {"area": self.build.area, **{name: self.layer.values[name] for name in ("thickness", "density")}}

    @property
    def expected_thickness_mode(self) -> float:
        """Expected antiresonance of the thickness mode from build and library, Hz."""
        v = self.layer.values
        return math.sqrt(v["c33D"].re / v["density"].re) / (2 * v["thickness"].re)

    @property
    def expected_radial_mode(self) -> float:
        """Expected first radial resonance from build and library, Hz."""
        v, speed = self.layer.values, _GENERIC_SPEED
        if "s11E" in v and "s12E" in v:
            s11, s12 = v["s11E"].re, v["s12E"].re
            speed = math.sqrt(s11 / ((s11**2 - s12**2) * v["density"].re))
        return _FIRST_ETA * speed / (2 * math.pi * self.radius)

    @property
    def radius(self) -> float:
        """Radius of the disk, m."""
        return math.sqrt(self.build.area.re / math.pi)

    def size_name(self, size: str) -> str:
        """Return the full name of a size: the area belongs to the transducer, the others to the layer."""
        return size if size == "area" else f"{self.layer.name}.{size}"

    def between(self, low: float, high: float) -> "BareDisk":
        """Return the recordings between two frequencies (Hz), without those that have fewer than ten points there."""
        kept: list[tuple[Sweep, Reals]] = []
        for sweep, noise in zip(self.sweeps, self.noises, strict=True):
            there = (sweep.frequency >= low) & (sweep.frequency <= high)
            if np.count_nonzero(there) >= 10:
                kept.append((sweep.at(there), noise[there]))
        return replace(self, sweeps=tuple(s for s, _ in kept), noises=tuple(n for _, n in kept))

    @property
    def bands(self) -> str:
        """The recordings' bands in words."""
        return ", ".join(f"{s.frequency[0] / 1e3:.5g}-{s.frequency[-1] / 1e3:.5g} kHz" for s in self.sweeps)

    def drawn_sizes(self, rng: np.random.Generator) -> dict[str, float]:
        """Return random sizes, distributed according to their standard uncertainties."""
        return {name: max(0.1 * q.re, rng.normal(q.re, q.u)) for name, q in self.sizes.items()}

    def regenerated(self, model: Model) -> "BareDisk":
        """Return the same recordings computed from the model, without noise."""
        sweeps = tuple(replace(sweep, impedance=model.impedance(sweep.frequency)) for sweep in self.sweeps)
        return replace(self, sweeps=sweeps)

    def curves(self, model: Model) -> tuple[Curve, ...]:
        """Return measured and model impedance; the start curve is the result itself."""
        pairs = [(sweep, model.impedance(sweep.frequency)) for sweep in self.sweeps]
        return tuple(Curve(self.step, sweep.frequency, sweep.impedance, Z, Z) for sweep, Z in pairs)

    def misfit(self, model: Model, parameters: int) -> tuple[float, float]:
        """Return chi2 per degree of freedom, and the rms of |ln(Z_model/Z_measured)|."""
        ratios = [log_ratio(model.impedance(sweep.frequency), sweep.impedance) for sweep in self.sweeps]
        weighted = sum(
            float(np.sum(np.abs(ratio / noise) ** 2)) for ratio, noise in zip(ratios, self.noises, strict=True)
        )
        every = np.concatenate(ratios)
        return weighted / max(1, 2 * every.size - parameters), rms(every)


def bare_disk(task: FitTask, fitter: str, round_one: bool, frees: bool) -> BareDisk:
    """Return the recordings of the bare disk among those given. Raises FitError if there are none.

    `round_one`: the fitter needs a disk known to be round; `frees`: it can hold some constants and free others.
    """
    if task.free is not None and not frees:
        raise TaskError(
            f"`{fitter}` reads all constants off the recording: it cannot free {', '.join(task.free)} alone"
        )
    build, sweeps = check_task(replace(task, free=None))
    refuse_effects(build, fitter)
    for step in sweeps:
        layers = [build.layer(name) for name in build.step(step).layers]
        if len(layers) == 1 and layers[0].kind == "piezo":
            break
    else:
        raise FitError(
            f"`{fitter}` needs the bare piezo disk; the recordings are of {', '.join(sweeps)}, which hold glued layers"
        )
    if round_one and build.diameter is None:
        raise FitError(
            f"`{fitter}` needs a round disk: build {build.name!r} gives area_mm2; write diameter_mm if it is round"
        )
    if round_one and build.hole_diameter is not None:
        raise FitError(
            f"`{fitter}` covers disks without a hole; build {build.name!r} gives hole_diameter_mm: fit it with stack2d"
        )
    refuse_another_device(build, {step: sweeps[step]})
    ground = build.reground(step).get(layers[0].name)
    if ground is not None:
        layers[0] = replace(layers[0], values={**layers[0].values, "thickness": ground[1]})
    noise, sigmas = noise_of(sweeps[step])
    merged = _merged(sweeps[step], sigmas)
    return BareDisk(
        build, step, layers[0], tuple(sweep for sweep, _ in merged), tuple(sigma for _, sigma in merged), noise
    )


def _merged(sweeps: Sequence[Sweep], sigmas: Sequence[Reals]) -> list[tuple[Sweep, Reals]]:
    """Return the sweeps with repeats on one frequency grid averaged."""
    groups: list[list[int]] = []
    for k, sweep in enumerate(sweeps):
        for group in groups:
            f = sweeps[group[0]].frequency
            if f.shape == sweep.frequency.shape and np.allclose(f, sweep.frequency, rtol=1e-9):
                group.append(k)
                break
        else:
            groups.append([k])
    merged: list[tuple[Sweep, Reals]] = []
    for group in groups:
        first = sweeps[group[0]]
        Z = np.mean([sweeps[k].impedance for k in group], axis=0)
        sigma = np.sqrt(np.mean([sigmas[k] ** 2 for k in group], axis=0) / len(group))
        merged.append((Sweep(first.frequency, Z, first.settings, first.time, first.id), sigma))
    return merged
