"""Fitter `bvd`: an equivalent circuit for devices of unknown structure.

Butterworth-Van Dyke: C0 with a loss tangent, in parallel with one R-L-C branch for each resonance (IEEE Std 177-1966),
as many as the recording has evidence for.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...models.base.arrays import Reals
from ...models.circuits.lumped import Branch, Lumped
from ...models.effects.base.scale import equivalent_plate
from ...models.sweep import Sweep
from ..engine.covariance import estimate
from ..engine.descent import Descent, settle, with_model_discrepancy
from ..engine.fitted_model import FittedModel
from ..engine.noise import noise_of
from ..engine.parameters.constraints import bounded
from ..engine.parameters.coordinates import Coordinates, hardly_negative, positive, resonant_branch
from ..engine.recording import Recording, log_ratio
from ..engine.start import resonance_pairs
from ..interface import UNCOMPUTABLE, Constant, FitError, FitResult, FitTask, Noise, TaskError
from ..uncertainty.fit_result import curves_of

_UNITS = {"C0": "F", "C0.tan_delta": "1", "R": "ohm", "L": "H", "C": "F"}
_DEVICE = "device"
"""Name of the only part of a device of unknown structure, where an effect may be."""
_PAIRS = 6
_MOST = 12
"""Budget: number of branches."""
_TRIED, _TRIED_BESIDE = 2, 4
"""Budget: number of places in the band at which a further branch is tried, and number of branches up to which one
beside the band is tried too."""
_TRIED_QUALITIES = 8.0, 25.0, 80.0, 250.0, 800.0
_BESIDE, _EDGE = 1.03, 0.999
"""Factor by which a branch beside the band is outside at the start; part of `_BEYOND` that it must stay within."""
_BEYOND = 1.05
"""Factor by which a branch may resonate beyond the recorded band. Far beyond it is no resonance of the device, but its
capacitance behind a lead."""
_QUALITIES = 3.0, 1e5
"""Range of the quality factors of a further branch: a line that is broader belongs to the background."""
_LEAST_QUALITY = 1.0
"""That of a circuit's only branch, below which it is no resonance."""


def _starts(sweep: Sweep) -> list[Lumped]:
    """Return one circuit per resonance pair: the branch from fs and fp, level and quality from the whole curve.

    Raises FitError if there is no pair, or none whose circuit has the sign of the recording.
    """
    f, Y = sweep.frequency, sweep.admittance
    circuits: list[Lumped] = []
    name = sweep.name or "the recording"
    pairs = resonance_pairs(sweep)[:_PAIRS]
    for fs, fp in pairs:
        ratio = (fp / fs) ** 2 - 1
        x = f / fs
        levels = [Y / (2j * np.pi * f * (1 + ratio / (1 - x**2 + 1j * x / Q))) for Q in _TRIED_QUALITIES]
        sizes = [float(np.median(np.abs(level))) for level in levels]
        misfits = [float(np.median(np.abs(level / C0 - 1))) for level, C0 in zip(levels, sizes, strict=True)]
        k = int(np.argmin(misfits))
        if float(np.median(levels[k].real)) > 0:
            branch = Branch.from_resonance(fs, _TRIED_QUALITIES[k], sizes[k] * ratio)
            circuits.append(Lumped(sizes[k], (branch,), tan_delta=5e-3))
    if not pairs and float(np.median(Y.imag)) > 0:
        raise FitError(f"{name} shows no resonance with an antiresonance above it")
    if not circuits:
        raise FitError(
            f"{name} is not capacitive: a piezoelectric device beside its resonances is a capacitor, so the polarity "
            "or the wiring is wrong, or this is another device"
        )
    return circuits


def _descend(sweep: Sweep, start: Lumped, noise: Reals, *, wired: bool = False) -> Descent:
    low, high = np.log(2 * np.pi * sweep.frequency[[0, -1]] * (1 / _BEYOND, _BEYOND)).tolist()
    each = (f"branch{k}" for k in range(1, len(start.branches) + 1))
    branches = (bounded(resonant_branch(name), {f"{name}.fs": (low, high)}) for name in each)
    wires = (hardly_negative("series.R", 1.0), hardly_negative("series.L", 1e-7)) if wired else ()
    blocks = (positive("C0"), hardly_negative("C0.tan_delta", 0.01), *wires, *branches)
    names = tuple(name for block in blocks for name in block.coordinates)
    coordinates = Coordinates(blocks, start.parameters(), names)
    recording = Recording("", sweep, start, noise)
    cautious = with_model_discrepancy(recording, log_ratio(start.impedance(sweep.frequency), sweep.impedance))
    return settle([cautious], coordinates, (), coordinates.x)


def _circuit(descent: Descent) -> Lumped:
    """Return the fitted circuit."""
    values, _ = descent.objective.coordinates.forward(descent.x)
    count = sum(name.endswith(".L") and name.startswith("branch") for name in values)
    return Lumped(1.0, (Branch(1.0, 1.0, 1.0),) * count).replace(values)


def _price(descent: Descent, sigma: Reals) -> float:
    """Return the Bayesian information criterion of a fit; the lower, the better. The misfit counts as noise."""
    (ratio,) = descent.objective.log_ratios(descent.x)
    kept = np.isfinite(sigma)
    numbers = 2 * int(np.count_nonzero(kept))
    chi2 = float(np.mean(np.abs(ratio[kept] / sigma[kept]) ** 2)) / 2
    return numbers * float(np.log(max(chi2, 1.0))) + descent.x.size * float(np.log(numbers))


def _grown(sweep: Sweep, best: Descent, sigma: Reals, progress: Callable[[str], None], *, wired: bool) -> Descent:
    """Add branches one by one, each where the residual has a line, while the evidence increases."""
    price = _price(best, sigma)
    while (count := len(_circuit(best).branches)) < _MOST:
        progress(f"trying {count + 1} resonances")
        circuit = _circuit(best)
        lines = _further(sweep, circuit, sigma)
        trials = [trial for one in lines if (trial := _with(sweep, circuit, one, sigma, wired=wired))]
        now, found = min(trials, key=lambda trial: trial[0], default=(price, best))
        if now >= price:
            break
        price, best = now, found
    return best


def _with(sweep: Sweep, circuit: Lumped, one: Branch, sigma: Reals, *, wired: bool) -> tuple[float, Descent] | None:
    """Return price and fit with a further branch; None if a branch is no resonance, or leaves the recorded band."""
    try:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of a branch that runs away
            trial = _descend(sweep, replace(circuit, branches=(*circuit.branches, one)), sigma, wired=wired)
            price, branches = _price(trial, sigma), _circuit(trial).branches
    except UNCOMPUTABLE:
        return None
    return (price, trial) if _are_resonances(sweep, branches, _QUALITIES[0]) else None


def _are_resonances(sweep: Sweep, branches: Sequence[Branch], least: float) -> bool:
    """Return whether all branches resonate in the band or just beside it, with a quality factor of `least` or more."""
    reach = _EDGE * _BEYOND
    low, high = float(sweep.frequency[0]) / reach, float(sweep.frequency[-1]) * reach
    return all(low < branch.fs < high and least < branch.Q < _QUALITIES[1] for branch in branches)


def _further(sweep: Sweep, circuit: Lumped, sigma: Reals) -> list[Branch]:
    """Return branches at the highest lines of conductance that a circuit leaves, and just beside the band."""
    f, Y = sweep.frequency, sweep.admittance
    left = (Y - 1 / circuit.impedance(f)).real
    significance = np.where(np.isfinite(sigma), left / (np.abs(Y) * sigma), 0.0)
    found: list[Branch] = []
    for _ in range(_TRIED):
        k = int(np.argmax(significance))
        if significance[k] <= 1:
            break
        low, high = k, k
        while low > 0 and left[low - 1] > left[k] / 2:
            low -= 1
        while high < f.size - 1 and left[high + 1] > left[k] / 2:
            high += 1
        width = max(float(f[high] - f[low]), float(np.min(np.diff(f))))
        Q = float(np.clip(f[k] / width, *_QUALITIES))
        found.append(Branch.from_resonance(float(f[k]), Q, float(left[k] / (2 * np.pi * f[k] * Q))))
        significance[max(0, 2 * low - high) : 2 * high - low + 1] = 0.0
    if len(circuit.branches) < _TRIED_BESIDE:
        strongest = max(circuit.branches, key=lambda branch: branch.C)
        beside = float(f[0]) / _BESIDE, float(f[-1]) * _BESIDE
        found += [Branch.from_resonance(fs, strongest.Q, strongest.C / 2) for fs in beside]
    return found


def _strongest_first(descent: Descent) -> list[int]:
    """Return the numbers of the branches, largest capacitance first; those that resonate beside the band come last."""
    branches, (low, high) = _circuit(descent).branches, descent.objective.recordings[0].sweep.frequency[[0, -1]]
    return sorted(
        range(1, len(branches) + 1), key=lambda k: (not low <= branches[k - 1].fs <= high, -branches[k - 1].C)
    )


def circuit_of(result: FitResult) -> Lumped:
    """Return the circuit that a result of this fitter describes."""
    values = {name: constant.re for name, constant in result.constants.items()}
    return Lumped(1.0, (Branch(1.0, 1.0, 1.0),) * sum(name.endswith(".L") for name in values)).replace(values)


class ButterworthVanDyke:
    """An equivalent circuit for a device of unknown geometry."""

    name = "bvd"
    version = "3"
    summary = "Butterworth-Van Dyke circuit C0 || R-L-C || ...; needs no build, for devices of unknown geometry"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the circuit to one recording, with as many branches as it has evidence for.

        `branch1` has the largest capacitance of those that resonate in the band, and `fs`, `fp`, `Qm` and `keff` are of
        it; the others follow in the order of theirs, and then those beside the band. Raises FitError for more than one
        recording, or one without a resonance that a circuit can describe.
        """
        began = time.perf_counter()
        step, sweep, noise, sigma = _posed(task, progress)
        best = _fitted(sweep, sigma, progress)
        coordinates = best.objective.coordinates
        result = estimate(best)
        fitted, _ = coordinates.forward(best.x)
        spread = dict(zip(coordinates.parameters, np.sqrt(np.diag(result.covariance)), strict=True))
        names = {name: name for name in ("C0", "C0.tan_delta")}  # as shown, and as fitted
        for shown, k in enumerate(_strongest_first(best), 1):
            names |= {f"branch{shown}.{part}": f"branch{k}.{part}" for part in "RLC"}
        values = {shown: fitted[own] for shown, own in names.items()}
        u = {shown: float(spread[own]) for shown, own in names.items()}
        circuit = _circuit(best)
        branch = circuit.branches[_strongest_first(best)[0] - 1]
        ratio = branch.C / circuit.C0
        return FitResult(
            build=task.build.name if task.build is not None else (sweep.name or "recording"),
            fitter=self.name,
            version=self.version,
            steps=(step,),
            noise=noise,
            chi2_per_dof=result.chi2_per_dof,
            constants={
                name: Constant(value, 0.0, u[name], 0.0, _UNITS[name if name in _UNITS else name.partition(".")[2]])
                for name, value in values.items()
            },
            derived={
                "fs": Constant(branch.fs, 0.0, None, None, "Hz", free=False),
                "fp": Constant(branch.fs * float(np.sqrt(1 + ratio)), 0.0, None, None, "Hz", free=False),
                "Qm": Constant(branch.Q, 0.0, None, None, "1", free=False),
                "keff": Constant(float(np.sqrt(ratio / (1 + ratio))), 0.0, None, None, "1", free=False),
            },
            correlation=(),
            rms_log_error=result.rms_log_error,
            converged=best.converged,
            evaluations=best.evaluations,
            seconds=time.perf_counter() - began,
            says=_says(result.chi2_per_dof, result.rms_log_error, len(circuit.branches)),
            curves=curves_of(best.objective, best.start, best.x),
        )

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted circuit, for a diagnosis; `branch1` has the largest capacitance. Raises FitError.

        It has no branches in place of wires, which the diagnosis looks for: where a circuit behind wires needs fewer
        and describes the recording better, it is that one, without its wires.
        """
        step, sweep, _, sigma = _posed(task, progress)
        best = wireless = _fitted(sweep, sigma, progress)
        count = len(_circuit(best).branches)
        if count > 1:
            behind = _fitted(sweep, sigma, progress, wired=True)
            if len(_circuit(behind).branches) < count and _price(behind, sigma) < _price(best, sigma):
                best = behind
        circuit = replace(_circuit(best), R=0.0, L=0.0)
        ordered = tuple(circuit.branches[k - 1] for k in _strongest_first(best))
        if ordered != circuit.branches or best is not wireless:
            best = _descend(sweep, replace(circuit, branches=ordered), sigma)
        before = best.objective
        recordings = [replace(recording, step=step) for recording in before.recordings]
        best = replace(best, objective=before.with_recordings(recordings))
        return FittedModel(best, equivalent_plate(_DEVICE, circuit.C0, ordered[0].fs), _UNITS)


def _posed(task: FitTask, progress: Callable[[str], None]) -> tuple[str, Sweep, Noise, Reals]:
    """Return the step, its one recording, and its noise, in all and at each point. Raises TaskError."""
    sweeps = [(step, sweep) for step, of_step in task.sweeps.items() for sweep in of_step]
    if len(sweeps) != 1:
        raise TaskError(f"`bvd` fits one recording; {len(sweeps)} were given")
    step, sweep = sweeps[0]
    noise, (sigma,) = noise_of([sweep])
    progress(f"fitting {step}")
    return step, sweep, noise, sigma


def _fitted(sweep: Sweep, sigma: Reals, progress: Callable[[str], None], *, wired: bool = False) -> Descent:
    """Return the fit of a circuit, `wired`: behind R and L. Raises FitError."""
    starts = _starts(sweep)
    descents = [one for start in starts if (one := _first(sweep, start, sigma, wired=wired)) is not None]
    if not descents:
        low, high = sweep.frequency[[0, -1]] / 1e6
        raise FitError(
            f"{sweep.name or 'the recording'} shows no resonance that a circuit can describe: of {len(starts)} tried, "
            f"none stays between {low:.4g} and {high:.4g} MHz with a quality factor above {_LEAST_QUALITY:g}"
        )
    first = min(descents, key=lambda descent: descent.objective.recordings[0].misfit)
    best = _grown(sweep, first, sigma, progress, wired=wired)
    return replace(best, evaluations=sum(descent.evaluations for descent in descents))


def _first(sweep: Sweep, start: Lumped, sigma: Reals, *, wired: bool) -> Descent | None:
    """Return the fit of a single branch; None if it is no resonance, or leaves the recorded band."""
    try:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of a branch that runs away
            descent = _descend(sweep, start, sigma, wired=wired)
            branches = _circuit(descent).branches
    except UNCOMPUTABLE:
        return None
    return descent if _are_resonances(sweep, branches, _LEAST_QUALITY) else None


def _says(chi2_per_dof: float, rms_log_error: float, branches: int) -> tuple[str, ...]:
    if chi2_per_dof < 1.5:
        return ()
    return (
        f"{_counted(branches)} not describe this recording to its noise: RMS log error {rms_log_error:.2g}; "
        "the uncertainties are widened by the misfit.",
    )


def _counted(branches: int) -> str:
    return "One resonance does" if branches == 1 else f"{branches} resonances do"
