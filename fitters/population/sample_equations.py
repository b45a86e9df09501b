"""The evidence of one sample on the shared bench: normal equations with the sample's own constants integrated out.

Near its fit, the residual of ln Z of a sample is linear in its own constants and errors, and in quantities shared with
the other samples: the analyzer's gain and phase, the fixture's residue, part of the model's own error, and effects at
the terminals. Its own are integrated out (a Schur complement); the remaining equations have only the shared unknowns,
so that any number of samples can be added at no cost.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.effects import Device, Effect, EffectParameter, catalogue
from ...models.effects.base.effect import TERMINALS
from ...models.stack import Stack
from ..diagnosis.data_quality.data_gates import gate
from ..diagnosis.hypotheses.bench_effects import BenchEffect, with_bench_effects
from ..diagnosis.hypotheses.hypothesis import Hypothesis, fitted
from ..diagnosis.hypotheses.problem import Problem
from ..engine.multi_step_fit import solve
from ..error_model import prior_scales as scales
from ..error_model.error_columns import ErrorColumns
from ..error_model.error_sizes import ErrorSizes
from ..error_model.instrument_share import accuracy_of
from ..error_model.point_covariance import Kernel
from ..error_model.smooth_basis import smooth
from ..interface import FitTask

FIXTURE = tuple(scales.FIXTURE)
"""The fixture's columns, in the order of the error model."""
MODEL_ERRORS = tuple(product((0.0, 1e-4, 1e-3), scales.RHOS))
"""Relative smooth and rough error of the model: common to all samples and estimated from all together."""
_MODEL = ("tau", "imaginary")
HALF = float(np.sqrt(0.5))
"""Half of the variance of the model's own error is common to samples of one kind, half is each sample's own."""
_FAINT = -1.0
"""Trial size of an effect, in prior standard deviations of its logarithm."""
Knobs = Mapping[str, Sequence[EffectParameter]]
"""Parameters of each possible effect of a bench; the first is its size."""


@dataclass(frozen=True, eq=False)
class SampleEquations:
    """Normal equations of one sample in the shared quantities."""

    sample: str
    keys: tuple[str, ...]
    """Name of each column: `slow 3`, `fixture inductance`, `tau 7`, `lead-inductance inductance`, shape (K,)."""
    grams: Mapping[tuple[float, float], tuple[Reals, float]]
    """For each size of the model's own error in `MODEL_ERRORS`: the Gram matrix of these columns and of the residual,
    the last, with everything of the sample's own integrated out, shape (K + 1, K + 1); and ln det of that."""
    sizes: ErrorSizes
    shortfall: float
    """Missing ln likelihood of its fit."""
    at: Mapping[str, Mapping[str, float]]
    """Parameters of each effect where it was linearised, by effect and parameter."""
    accuracy: tuple[tuple[Reals, Reals], ...]
    """ln frequency of each recording, and the analyzer's accuracy there, shape (N,)."""


def bench_effects(stack: Stack, names: Collection[str] | None = None) -> Knobs:
    """Return the effects of a jig, a lead or a cable: those at the terminals that have a size.

    `names`: the effects to consider; None for all. The residual of a fixture is part of the error model.
    """
    looked_for = (one for one in catalogue() if not one.only_named)
    there = {one.name: one.effect_parameters(stack, TERMINALS) for one in looked_for if TERMINALS in one.places(stack)}
    return {name: knobs for name, knobs in there.items() if knobs and (names is None or name in names)}


def ends_of(tasks: Sequence[FitTask]) -> tuple[float, float]:
    """Return the lowest and the highest ln frequency of all recordings."""
    edges = [np.log(sweep.frequency[[0, -1]]) for task in tasks for of in task.sweeps.values() for sweep in of]
    return float(min(edge[0] for edge in edges)), float(max(edge[1] for edge in edges))


def sample_equations(
    sample: str,
    task: FitTask,
    ends: tuple[float, float],
    knobs: Knobs,
    known: Sequence[BenchEffect] = (),
) -> SampleEquations:
    """Return the equations of a sample whose bench has these effects. Raises FitError if it cannot be fitted.

    `ends`: of ln frequency over all samples; `knobs`: parameters of the effects that the bench may have.
    """
    solution = solve(replace(task, sweeps=gate(task.sweeps).sweeps), lambda _: None)
    problem = with_bench_effects(Problem.of(solution, task.free), known)
    one = fitted(problem, (), problem.values, near=True, rounds=5)
    keys, shared, at = _shared(problem, one, ends, knobs, known)
    grams = {(tau, rho): _reduced(one, replace(one.fit.sizes, tau=tau, rho=rho), shared) for tau, rho in MODEL_ERRORS}
    sweeps = [recording.sweep for recording in problem.recordings]
    accuracy = tuple((np.log(sweep.frequency), accuracy_of(sweep)) for sweep in sweeps)
    return SampleEquations(sample, keys, grams, one.fit.sizes, one.fit.shortfall, at, accuracy)


def _shared(
    problem: Problem, one: Hypothesis, ends: tuple[float, float], knobs: Knobs, known: Sequence[BenchEffect]
) -> tuple[tuple[str, ...], list[Complexes], dict[str, dict[str, float]]]:
    """Return keys and columns, (N, K) for each recording, of the shared quantities, and the values of effects."""
    columns = one.fit.gram.columns
    keys: list[str] = []
    blocks: list[list[Complexes]] = [[] for _ in problem.recordings]
    for part, length, most in scales.OF_INSTRUMENT:
        bases = [smooth(np.log(r.sweep.frequency), ends, length, most) for r in problem.recordings]
        for own, basis, recording in zip(blocks, bases, problem.recordings, strict=True):
            size = accuracy_of(recording.sweep)[:, None]
            own += [np.asarray(size * basis * 1.0, np.complex128), np.asarray(1j * size * basis, np.complex128)]
        keys += [f"{part} {side} {k}" for side in ("gain", "phase") for k in range(bases[0].shape[1])]
    for part in ("fixture", *_MODEL):
        on = np.array([k for k, own in enumerate(columns.parts) if own == part], dtype=np.intp)
        signature = "" if part == "fixture" else f" {_kind_of(columns, problem)}"
        keys += [f"{part}{signature} {FIXTURE[n] if part == 'fixture' else n}" for n in range(on.size)]
        for own, block in zip(blocks, columns.blocks, strict=True):
            own.append(block[:, on])
    at: dict[str, dict[str, float]] = {}
    models = [model for model in one.fit.models if isinstance(model, Device)]
    by_name = {effect.name: effect for effect in catalogue()}
    for name, own_knobs in knobs.items():
        now = next((dict(other.values) for other in known if other.name == name), None)
        at[name] = now or {knob.name: _trial(knob, first=knob is own_knobs[0]) for knob in own_knobs}
        for own, model, recording in zip(blocks, models, problem.recordings, strict=True):
            own.append(
                _slopes(model, by_name[name], at[name], own_knobs, recording.sweep.frequency, there=now is not None)
            )
        keys += [f"{name} {knob.name}" for knob in own_knobs]
    return tuple(keys), [np.concatenate(own, axis=1) for own in blocks], at


def _kind_of(columns: ErrorColumns, problem: Problem) -> str:
    """Return a key that is equal for samples sharing the model's own error: layers, steps, and bands."""
    steps = [f"{r.step}:{r.sweep.frequency[0]:.0f}-{r.sweep.frequency[-1]:.0f}" for r in problem.recordings]
    devices = [r.model.reference for r in problem.recordings if isinstance(r.model, Device)]
    layers = dict.fromkeys(layer.name for stack in devices for layer in stack.layers)
    return "+".join([*layers, *dict.fromkeys(steps), str(len(columns.parts) - columns.parts.count("line"))])


def _trial(knob: EffectParameter, *, first: bool) -> float:
    centre, spread = knob.expected
    if knob.from_nothing:
        return float(centre * np.exp(_FAINT * spread)) if first else centre
    return knob.null


def unit_of(knob: EffectParameter, value: float) -> float:
    """Return the prior standard deviation of a parameter other than the size, near a value."""
    spread = knob.expected[1]
    if knob.from_nothing:
        return abs(value) * spread
    return min(spread, 0.3 * (knob.upper - knob.lower)) if np.isfinite(knob.upper) else spread


def _slopes(
    model: Device,
    effect: Effect,
    values: Mapping[str, float],
    knobs: Sequence[EffectParameter],
    f: Reals,
    *,
    there: bool,
) -> Complexes:
    """Return d ln Z per unit of the size, and per prior deviation of each other parameter; shape (N, P).

    Where the effect is not there yet, the first is that from nothing, with all other parameters at null: a resistance
    beside an inductance would change it by a per cent at a resonance, unlike the fixture's own column.
    """
    device = model if there else model.with_effect(effect, TERMINALS, values)
    prefix = f"{effect.name}@{TERMINALS}."
    names = [prefix + knob.name for knob in knobs]
    _, slopes = device.jacobian(f, names)
    own = [slope * unit_of(knob, values[knob.name]) for slope, knob in zip(slopes, knobs, strict=True)]
    at_null = device if there else device.replace({name: knob.null for name, knob in zip(names, knobs, strict=True)})
    own[0] = at_null.jacobian(f, names[:1])[1][0]
    return np.stack(own, axis=1)


def _reduced(one: Hypothesis, sizes: ErrorSizes, shared: Sequence[Complexes]) -> tuple[Reals, float]:
    """Return the Gram matrix of shared columns and residual, the sample's own part integrated out, and its ln det."""
    made = one.fit.gram
    parts = {**sizes.of_columns(), "slow": 0.0, "fast": 0.0, "fixture": 0.0, "tau": HALF * sizes.tau}
    on, d = made.columns.present(parts)
    kernel = Kernel(made.columns.points, sizes.colour, sizes.rough)
    blocks = [
        np.concatenate([c[:, on] * d, j, s, r[:, None]], axis=1)
        for c, j, s, r in zip(made.columns.blocks, made.J, shared, made.r, strict=True)
    ]
    G = kernel.white(blocks).squared()
    C, M = on.size, made.J[0].shape[1]
    G[:C, :C] += np.eye(C)
    G[C : C + M, C : C + M] += made.before.P
    G[C : C + M, -1] += made.before.g
    G[-1, C : C + M] += made.before.g
    G[-1, -1] += made.before.q
    n = C + M
    own = G[:n, :n]
    unit = np.sqrt(np.maximum(np.diag(own), 1e-300))
    scaled = own / unit / unit[:, None] + 1e-11 * np.eye(n)
    right = G[:n, n:] / unit[:, None]
    left = G[n:, n:] - right.T @ np.linalg.solve(scaled, right)
    _, log_det = np.linalg.slogdet(scaled)
    return (left + left.T) / 2, float(log_det + 2 * np.sum(np.log(unit)) + kernel.log_det)
