"""Fitter `bvd`: an equivalent circuit for devices of unknown structure.

Butterworth-Van Dyke: C0 with a loss tangent, in parallel with one R-L-C branch (IEEE Std 177-1966).
"""

import time
from collections.abc import Callable

import numpy as np

from ...models.base.arrays import Reals
from ...models.circuits.lumped import Branch, Lumped
from ...models.sweep import Sweep
from ..engine.covariance import estimate
from ..engine.descent import Descent, settle, with_model_discrepancy
from ..engine.noise import noise_of
from ..engine.parameters.coordinates import Coordinates, hardly_negative, positive, resonant_branch
from ..engine.recording import Recording, log_ratio
from ..engine.start import resonance_pairs
from ..interface import Constant, FitError, FitResult, FitTask, TaskError
from ..uncertainty.fit_result import curves_of

_UNITS = {"C0": "F", "C0.tan_delta": "1", "branch1.R": "ohm", "branch1.L": "H", "branch1.C": "F"}
_PAIRS = 6


def _starts(sweep: Sweep) -> list[Lumped]:
    """Return one circuit per resonance pair: branch from fs, fp and the level, quality from the largest G."""
    w = 2 * np.pi * sweep.frequency
    free = float(np.median(sweep.admittance.imag / w))
    if free <= 0:
        raise FitError(
            f"{sweep.id or 'the recording'} is not capacitive: the median of B/w is {free:.3g} F; "
            "a piezoelectric device off resonance is a capacitor, so the polarity or the wiring is wrong"
        )
    circuits: list[Lumped] = []
    for fs, fp in resonance_pairs(sweep):
        ratio = (fp / fs) ** 2 - 1
        C0 = free / (1 + ratio)
        peak = float(np.interp(fs, sweep.frequency, sweep.admittance.real))
        Q = max(3.0, peak / (2 * np.pi * fs * C0 * ratio))
        circuits.append(Lumped(C0, (Branch.from_resonance(fs, Q, C0 * ratio),), tan_delta=5e-3))
    if not circuits:
        raise FitError(f"{sweep.id or 'the recording'} shows no resonance with an antiresonance above it")
    return circuits[:_PAIRS]


def _descend(sweep: Sweep, start: Lumped, noise: Reals) -> Descent:
    blocks = (positive("C0"), hardly_negative("C0.tan_delta", 0.01), resonant_branch("branch1"))
    names = tuple(name for block in blocks for name in block.coordinates)
    coordinates = Coordinates(blocks, start.parameters(), names)
    recording = Recording("", sweep, start, noise)
    cautious = with_model_discrepancy(recording, log_ratio(start.impedance(sweep.frequency), sweep.impedance))
    return settle([cautious], coordinates, (), coordinates.x)


class ButterworthVanDyke:
    """An equivalent circuit for a device of unknown geometry."""

    name = "bvd"
    version = "1"
    summary = "Butterworth-Van Dyke circuit C0 || R-L-C; needs no build, for devices of unknown geometry"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the circuit to one recording. Raises FitError for more than one, or one without a resonance pair."""
        began = time.perf_counter()
        sweeps = [(step, sweep) for step, of_step in task.sweeps.items() for sweep in of_step]
        if len(sweeps) != 1:
            raise TaskError(f"`bvd` fits one recording; {len(sweeps)} were given")
        step, sweep = sweeps[0]
        noise, (sigma,) = noise_of([sweep])
        progress(f"fitting {step}")
        descents = [_descend(sweep, start, sigma) for start in _starts(sweep)]
        best = min(descents, key=lambda descent: descent.objective.recordings[0].misfit)
        coordinates = best.objective.coordinates
        result = estimate(best)
        values, _ = coordinates.forward(best.x)
        u = dict(zip(coordinates.parameters, np.sqrt(np.diag(result.covariance)), strict=True))
        circuit = Lumped(1.0, (Branch(1.0, 1.0, 1.0),)).replace(values)
        branch, ratio = circuit.branches[0], circuit.branches[0].C / circuit.C0
        return FitResult(
            build=task.build.name if task.build is not None else (sweep.id or "recording"),
            fitter=self.name,
            version=self.version,
            steps=(step,),
            noise=noise,
            chi2_per_dof=result.chi2_per_dof,
            constants={name: Constant(values[name], 0.0, float(u[name]), 0.0, _UNITS[name]) for name in _UNITS},
            derived={
                "fs": Constant(branch.fs, 0.0, None, None, "Hz", free=False),
                "fp": Constant(branch.fs * float(np.sqrt(1 + ratio)), 0.0, None, None, "Hz", free=False),
                "Qm": Constant(branch.Q, 0.0, None, None, "1", free=False),
                "keff": Constant(float(np.sqrt(ratio / (1 + ratio))), 0.0, None, None, "1", free=False),
            },
            correlation=(),
            rms_log_error=result.rms_log_error,
            converged=best.converged,
            evaluations=sum(descent.evaluations for descent in descents),
            seconds=time.perf_counter() - began,
            says=_says(result.chi2_per_dof, result.rms_log_error),
            curves=curves_of(best.objective, best.start, best.x),
        )


def _says(chi2_per_dof: float, rms_log_error: float) -> tuple[str, ...]:
    if chi2_per_dof < 1.5:
        return ()
    return (
        f"One resonance does not describe this recording to its noise: RMS log error {rms_log_error:.2g}; "
        "the uncertainties are widened by the misfit.",
    )
