"""A device as found in a recording: its model, what is uncertain of it, and what the model leaves undescribed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ....models.build import Build
from ....models.effects import Device
from ....models.sweep import Sweep
from ...diagnosis.hypotheses.conditions import as_devices
from ...engine.covariance import curvature
from ...engine.multi_step_fit import solve
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import log_ratio, rms
from ...error_model.smooth_basis import smooth
from ...interface import FitError, FitTask
from ..change import Values
from ..comparison import DescribedBy
from ..resonances import Resonances

_NEAR = 1e-5
"""Relative shift of frequency up to which a curve is extrapolated by its slope."""
_STEP = 1e-6
_PARTS = 0.25
"""Correlation length, in ln f, of the share of a discrepancy that is in parallel or in series."""
_KEPT = 24
"""Curves in the cache."""

Apply = Callable[[Device, Values], Device]
"""Returns a device with a change of these sizes."""


@dataclass(frozen=True, eq=False)
class Step:
    """One of several changes, with its sizes."""

    apply: Apply
    values: Values
    before: Apply | None = None
    """What of it was in the device before; None for nothing."""


@dataclass(frozen=True, eq=False)
class FoundDevice:
    """The device of one recording of a pair."""

    described: DescribedBy
    device: Device
    coordinates: Coordinates
    """Those of the fit."""
    own: Mapping[str, str]
    """Names of the device's parameters by those in the fit."""
    x: Reals
    """Free coordinates of the fit, shape (M,)."""
    root: Reals
    """Root of their covariance, shape (M, M)."""
    recorded: Impedances
    """The recording at the frequencies of the pair, ohm, shape (N,)."""
    resonances: Resonances
    """Those before, which may drift."""
    _curves: dict[object, Impedances] = field(default_factory=dict[object, Impedances])
    _moved: dict[bytes, "FoundDevice"] = field(default_factory=dict[bytes, "FoundDevice"])

    @classmethod
    def of(
        cls, build: Build, step: str, sweeps: Sequence[Sweep], recorded: Impedances, resonances: Resonances
    ) -> "FoundDevice":
        """Fit the build's step to the recordings of one side. Raises TaskError, FitError."""
        descent = solve(FitTask(build, {step: tuple(sweeps)}), lambda _: None).descent
        objective = descent.objective
        recording = as_devices(objective.recordings)[0]
        if not isinstance(recording.model, Device):
            raise FitError(f"step {step!r} of build {build.name!r} is no stack")
        own = {recording.renamed.get(name, name): name for name in recording.model.parameters()}
        coordinates = objective.coordinates
        own = {name: own[name] for name in coordinates.parameters if name in own}
        device = _at(recording.model, coordinates, own, descent.x)
        root = curvature(objective, descent.x).half
        by = DescribedBy(build.name, step, rms(*objective.log_ratios(descent.x)))
        return cls(by, device, coordinates, own, descent.x, root, recorded, resonances)

    def moved(self, coordinates: Reals) -> "FoundDevice":
        """Return the same with other constants: by so many standard deviations along each axis, shape (M,)."""
        key = coordinates.tobytes()
        if key not in self._moved:
            x = self.x + self.root @ coordinates
            device = _at(self.device, self.coordinates, self.own, x)
            self._moved.clear()
            self._moved[key] = replace(self, device=device, x=x, _curves={}, _moved={})
        return self._moved[key]

    def log_ratio(self, frequency: Frequencies, steps: Sequence[Step], own: Resonances) -> Complexes:
        """Return ln(Z with all these changes / Z with all but the last), shape (N,); `own`: the drifted resonances."""
        warp = self._warp(frequency, own)
        near = np.round(warp.real / _NEAR) * _NEAR
        ratio = self._ratio(frequency, steps, near)
        rest = warp - near
        if not np.any(rest):
            return ratio
        slope = (self._ratio(frequency, steps, near - _STEP) - ratio) / _STEP
        return ratio - rest * slope

    def of_constants(self, frequency: Frequencies, steps: Sequence[Step]) -> Complexes:
        """Return the change of ln Z by these changes per standard deviation of the fitted constants, shape (N, M)."""
        changed = _changed(self.device, steps)
        _, chain = self.coordinates.forward(self.x)
        rows = [k for k, name in enumerate(self.coordinates.parameters) if name in self.own]
        slopes = self._slopes(changed, frequency) - self._slopes(_changed(self.device, _earlier(steps)), frequency)
        return np.asarray(slopes.T @ chain[rows] @ self.root, np.complex128)

    def of_discrepancy(self, frequency: Frequencies, steps: Sequence[Step]) -> Complexes:
        """Return how else the discrepancy of the model may act after the change, as differences of ln Z, shape (N, K).

        A factor of Z that stays the same is assumed. If it is an admittance in parallel with the device, or an
        impedance in series, ln Z differs by (R - 1)(D - 1), or by -(1 - 1/R)(1 - 1/D), to first order in D - 1:
        R is the change of Z by the model, D the recording relative to the model. It may be either, in parts that
        vary with frequency.
        """
        none = np.zeros_like(frequency)
        first = self._curve(frequency, _earlier(steps), none)
        R, D = self._curve(frequency, steps, none) / first, self.recorded / first
        u = np.log(frequency)
        parts = smooth(u, (float(u[0]), float(u[-1])), _PARTS, 8)
        both = ((R - 1) * (D - 1), (1 - 1 / R) * (1 - 1 / D))
        return np.hstack([one[:, None] * parts for one in both])

    def _warp(self, frequency: Frequencies, own: Resonances) -> Complexes:
        """Return by how much ln f of the device has drifted, its imaginary part by losses, shape (N,).

        At each frequency by as much as the resonances that contribute to the admittance there.
        """
        first = self.resonances
        if own is first or not first.poles.size:
            return np.zeros(frequency.size, np.complex128)
        shift = np.log(np.abs(own.poles) / np.abs(first.poles)) - 0.5j * np.log(own.q / first.q) / first.q
        part = np.abs(first.seen(frequency)) ** 2
        return np.asarray(part @ shift / np.sum(part, axis=1), np.complex128)

    def _ratio(self, frequency: Frequencies, steps: Sequence[Step], shift: Reals) -> Complexes:
        before = (*steps[:-1], *_earlier(steps[-1:]))
        return log_ratio(self._curve(frequency, steps, shift), self._curve(frequency, before, shift))

    def _curve(self, frequency: Frequencies, steps: Sequence[Step], shift: Reals) -> Impedances:
        """Return the model's impedance with these changes, ohm, shape (N,), with ln f shifted."""
        key = shift.tobytes(), tuple((step.apply, *step.values.items()) for step in steps)
        known = self._curves.get(key)
        if known is None:
            known = _changed(self.device, steps).impedance(frequency * np.exp(-shift))
            if len(self._curves) >= _KEPT:
                self._curves.pop(next(iter(self._curves)))
            self._curves[key] = known
        return known

    def _slopes(self, device: Device, frequency: Frequencies) -> Complexes:
        """Return d ln Z / d fitted parameter, shape (P, N); 0 for parameters that the device has not."""
        there, names = device.parameters(), tuple(self.own.values())
        rows = [k for k, name in enumerate(names) if name in there]
        made = np.zeros((len(names), frequency.size), np.complex128)
        made[rows] = device.jacobian(frequency, [names[k] for k in rows])[1]
        return made


def _at(device: Device, coordinates: Coordinates, own: Mapping[str, str], x: Reals) -> Device:
    """Return the device with the constants of a fit at these free coordinates."""
    values, _ = coordinates.forward(x)
    return device.replace({name: values[fit] for fit, name in own.items()})


def _changed(device: Device, steps: Sequence[Step]) -> Device:
    for step in steps:
        device = step.apply(device, step.values)
    return device


def _earlier(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return what of the changes was in the device before them."""
    return tuple(Step(step.before, step.values) for step in steps if step.before is not None)
