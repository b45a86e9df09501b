"""Shared effects of all samples of a bench, from one log evidence: effects at the terminals, fixture, analyzer.

A shared effect has one size, common to all samples up to a scatter; its evidence is the sum over samples of their
marginal evidence at that size, with the analyzer's error, the fixture's residue and half of the model's own error
integrated out once for all samples. An effect that only some samples have, or with different sizes, requires a
large scatter, and is left to the diagnosis of each sample.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...models.base.arrays import Reals
from ...models.effects import EffectParameter
from ...models.effects.fixture_residual import EFFECT as FIXTURE_RESIDUAL
from ...models.effects.fixture_residual import UNITS
from ..diagnosis.decision_rules import NAMED, ODDS, TOLERATED, WORTH
from ..diagnosis.findings import Size
from ..diagnosis.hypotheses.bench_effects import BenchEffect
from ..diagnosis.hypotheses.hypothesis import coarseness
from ..error_model import prior_scales as scales
from ..error_model.error_sizes import GRIDS, ErrorSizes
from ..error_model.smooth_basis import smooth
from .sample_equations import FIXTURE, MODEL_ERRORS, Knobs, SampleEquations, unit_of
from .shared_bench import FixturePart, SharedBench, SharedEffect
from .summed_equations import Quadratic, SummedEquations, quadratic_in, residue_at, scales_of, without_others

SCATTERS = {0.0: 0.5, 0.1: 0.125, 0.3: 0.125, 1.0: 0.125, 3.0: 0.125}
"""Relative scatter of a shared effect's size from sample to sample, with prior: one jig is as likely as any scatter."""
COMMON = 0.3
"""Largest scatter of a shared effect; beyond it, each sample has its own."""
_TRIED = 3
"""Budget: number of further candidates fitted in all samples."""
_MOST = 3
"""Budget: largest number of shared effects."""
_PASSES = 4
"""Budget: surveys of one explanation; each is linear where the one before has ended."""
_SETTLED = 0.1
"""Increase of ln evidence below which a further survey is not worth its time."""
_NEGLIGIBLE = 7.0
"""ln odds from which sizes of the errors do not affect an uncertainty: a probability of 1e-3."""
_NODES = 400
_TAIL, _WIDE = 0.1, 4.0
"""One size in ten comes from a density four times as wide, as in the diagnosis of one sample."""

Survey = Callable[[tuple[BenchEffect, ...]], Sequence[SampleEquations]]
"""Returns the equations of all samples, given the effects of their bench."""


def _log_density(values: Reals, knob: EffectParameter) -> Reals:
    """Return ln prior density of a size, per unit of it."""
    median, spread = knob.expected
    z = np.log(np.maximum(values, 1e-300) / median) / spread
    mixed = (1 - _TAIL) * np.exp(-(z**2) / 2) + _TAIL / _WIDE * np.exp(-(z**2) / 2 / _WIDE**2)
    return np.log(np.maximum(mixed, 1e-300) / np.sqrt(2 * np.pi) / spread / np.maximum(values, 1e-300))


def _best(
    equations: Sequence[SampleEquations], names: Sequence[str], knobs: Knobs, fixture: Mapping[str, float]
) -> tuple[SummedEquations, ErrorSizes]:
    """Return the equations and the likeliest error sizes for all samples together.

    The model's own error, that of the analyzer and that of the fixture are common to all samples.
    """
    own = _typical(equations)
    has_fixture = (1.0,) if any(fixture.values()) else GRIDS["fixture"]
    grids = tuple(product(GRIDS["slow"], GRIDS["fast"], has_fixture))
    best: tuple[float, SummedEquations, ErrorSizes] | None = None
    for tau, rho in MODEL_ERRORS:
        total = SummedEquations.of(equations, (tau, rho))
        for slow, fast, there in grids:
            sizes = replace(own, tau=tau, rho=rho, slow=slow, fast=fast, fixture=there)
            found = quadratic_in(total, sizes, names, knobs, fixture)
            value = found.top + (0.5 * float(found.b @ np.linalg.solve(found.A, found.b)) if names else 0.0)
            if best is None or value > best[0]:
                best = value, total, sizes
    if best is None:
        raise ArithmeticError("no size of the errors")
    return best[1:]


def _weigh(found: Quadratic, at: Sequence[float], knobs: Sequence[EffectParameter]) -> tuple[float, Reals, Reals]:
    """Return ln evidence with the sizes integrated out (Laplace), their likeliest values, and covariance."""
    if not at:
        return found.top, np.zeros(0), np.zeros((0, 0))
    start = np.asarray(at, np.float64)
    step = -np.linalg.solve(found.A, found.b)
    values = np.maximum(start + step, 1e-3 * start)
    moved = values - start
    here = found.top - float(found.b @ moved) - 0.5 * float(moved @ found.A @ moved)
    prior = sum(float(_log_density(np.array([v]), knob)[0]) for v, knob in zip(values.tolist(), knobs, strict=True))
    _, log_det = np.linalg.slogdet(found.A / (2 * np.pi))
    return here + prior - 0.5 * float(log_det), values, np.asarray(np.linalg.inv(found.A), np.float64)


def _gain(found: Quadratic, median: float, knob: EffectParameter) -> tuple[float, float]:
    """Return ln evidence of an absent effect, relative to that without it, and its likeliest size.

    `found` is linearised at zero size; the size is integrated over its prior.
    """
    spread = knob.expected[1]
    values: Reals = np.asarray(median * np.exp(spread * np.linspace(-6, 6, _NODES)), np.float64)
    log_p: Reals = -found.b[0] * values - 0.5 * found.A[0, 0] * values**2 + _log_density(values, knob)
    weights: Reals = np.asarray(np.log(np.gradient(values)), np.float64)
    best = float(values[int(np.argmax(log_p + weights))])
    peak = float(np.max(log_p + weights))
    return peak + float(np.log(np.sum(np.exp(log_p + weights - peak)))), best


@dataclass(frozen=True, eq=False)
class _Explanation:
    """Shared effects with the equations of all samples linearised there."""

    known: tuple[BenchEffect, ...]
    fixture: Mapping[str, float]
    """Its residue where the equations were linearised, SI."""
    total: SummedEquations
    sizes: ErrorSizes
    log_evidence: float
    values: Reals
    covariance: Reals

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(one.name for one in self.known)

    @property
    def shortfall(self) -> float:
        """Missing ln likelihood over all samples."""
        return sum(one.shortfall for one, _, _ in self.total.parts)


def shared_bench(survey: Survey, knobs: Knobs, ends: tuple[float, float], odds: Mapping[str, float]) -> SharedBench:
    """Return the shared effects. `knobs`, `odds`: of each effect at the terminals; `ends`: of ln frequency."""
    now = _explained(survey, (), {}, knobs)
    rejected: list[str] = []
    steps: list[tuple[_Explanation, list[tuple[_Explanation, float]]]] = []
    while len(now.known) < _MOST:
        promising = _promising(now, knobs, rejected)[:_TRIED]
        tried = [_explained(survey, *_beside(now, one, knobs)) for one in promising]
        weighed = [(one, one.log_evidence + float(np.log(ODDS * odds[one.names[-1]]))) for one in tried]
        better = [(one, weight) for one, weight in weighed if weight > now.log_evidence]
        if not better:
            break
        best = max(better, key=lambda pair: pair[1])[0]
        if sum(p for s, p in _scatter(best, best.names[-1], knobs).items() if s <= COMMON) < NAMED:
            rejected.append(best.names[-1])
            continue
        steps.append((now, weighed))
        now = best
    return _told(now, steps, rejected, knobs, ends)


def _beside(
    now: _Explanation, one: BenchEffect, knobs: Knobs
) -> tuple[tuple[BenchEffect, ...], Mapping[str, float], Knobs]:
    """Return the effects with one more, and the residue of the fixture beside them, both by the linear equations.

    Much of what the fixture's residue had to imitate belongs to the new effect.
    """
    first = knobs[one.name][0]
    nothing = BenchEffect(one.name, {**one.values, first.name: 0.0})
    found = _finished(now.total, (*now.known, nothing), now.fixture, now.sizes, knobs)
    moved = _moved(found, knobs)
    size = max(moved[-1].values[first.name], 1e-3 * one.values[first.name])
    last = BenchEffect(one.name, {**one.values, first.name: size})
    return (*moved[:-1], last), _residue(found, knobs), knobs


def _explained(
    survey: Survey, known: tuple[BenchEffect, ...], fixture: Mapping[str, float], knobs: Knobs
) -> _Explanation:
    """Return an explanation, linearised where it is likeliest: each survey begins where the one before ends."""
    best = found = _surveyed(survey, known, knobs, fixture)
    for _ in range(_PASSES - 1):
        found = _surveyed(survey, _moved(found, knobs), knobs, _residue(found, knobs))
        gain = found.log_evidence - best.log_evidence
        best = found if gain > 0 else best
        if abs(gain) < _SETTLED:
            break
    return best


def _surveyed(
    survey: Survey, known: tuple[BenchEffect, ...], knobs: Knobs, fixture: Mapping[str, float]
) -> _Explanation:
    residue = (BenchEffect(FIXTURE_RESIDUAL.name, fixture),) if any(fixture.values()) else ()
    total, sizes = _best(survey((*known, *residue)), [one.name for one in known], knobs, fixture)
    return _finished(total, known, fixture, sizes, knobs)


def _finished(
    total: SummedEquations,
    known: tuple[BenchEffect, ...],
    fixture: Mapping[str, float],
    sizes: ErrorSizes,
    knobs: Knobs,
) -> _Explanation:
    found = quadratic_in(total, sizes, [one.name for one in known], knobs, fixture)
    firsts = [knobs[one.name][0] for one in known]
    at = [one.values[knob.name] for one, knob in zip(known, firsts, strict=True)]
    return _Explanation(known, fixture, total, sizes, *_weigh(found, at, firsts))


def _residue(one: _Explanation, knobs: Knobs) -> dict[str, float]:
    """Return the likeliest residue of the fixture, SI; empty where there is none."""
    if one.sizes.fixture == 0:
        return {}
    beside = _coefficients(one, knobs)
    return {name: one.fixture.get(name, 0.0) + beside[f"fixture {name}"][0] * scales.FIXTURE[name] for name in FIXTURE}


def _averaged(one: _Explanation, knobs: Knobs) -> dict[str, tuple[float, float]]:
    """Return coefficients and their standard deviations over all sizes of the errors.

    All samples together hardly determine how much of a smooth error is the analyzer's, but the sizes depend on it.
    """
    equations = [own for own, _, _ in one.total.parts]
    has_fixture = (1.0,) if any(one.fixture.values()) else GRIDS["fixture"]
    grids = tuple(product(GRIDS["slow"], GRIDS["fast"], has_fixture))
    found: list[tuple[float, dict[str, tuple[float, float]]]] = []
    for error in MODEL_ERRORS:
        total = SummedEquations.of(equations, error)
        for slow, fast, fixture in grids:
            sizes = replace(one.sizes, tau=error[0], rho=error[1], slow=slow, fast=fast, fixture=fixture)
            other = _finished(total, one.known, one.fixture, sizes, knobs)
            if other.log_evidence > one.log_evidence - _NEGLIGIBLE:
                found.append((other.log_evidence, _coefficients(other, knobs)))
    weights = np.exp(np.array([log for log, _ in found]) - max(log for log, _ in found))
    weights /= np.sum(weights)
    keys = dict.fromkeys(key for _, own in found for key in own)
    means = np.array([[own.get(key, (0.0, 0.0))[0] for key in keys] for _, own in found])
    within = np.array([[own.get(key, (0.0, 0.0))[1] for key in keys] for _, own in found])
    mean = weights @ means
    u = np.sqrt(weights @ (within**2 + (means - mean) ** 2))
    return dict(zip(keys, zip(mean.tolist(), u.tolist(), strict=True), strict=True))


def _typical(equations: Sequence[SampleEquations]) -> ErrorSizes:
    """Return the sizes of the errors of a typical sample: medians on the grids."""
    sizes = {name: sorted(getattr(one.sizes, name) for one in equations)[len(equations) // 2] for name in GRIDS}
    return ErrorSizes(**sizes)


def _promising(now: _Explanation, knobs: Knobs, rejected: Sequence[str]) -> list[BenchEffect]:
    """Return the effects that would explain most in addition to the present ones, best first, at their likely sizes."""
    at = now.total.parts[0][0].at
    gains: list[tuple[float, BenchEffect]] = []
    for name, own in knobs.items():
        if name in now.names or name in rejected:
            continue
        found = quadratic_in(now.total, now.sizes, [name, *now.names], knobs, now.fixture)
        gain, size = _gain(without_others(found), own[0].expected[0], own[0])
        if gain > WORTH:
            gains.append((gain, BenchEffect(name, {**at[name], own[0].name: size})))
    return [one for _, one in sorted(gains, key=lambda pair: -pair[0])]


def _moved(
    one: _Explanation, knobs: Knobs, averaged: Mapping[str, tuple[float, float]] | None = None
) -> tuple[BenchEffect, ...]:
    """Return the effects with their likeliest parameters, or those of `averaged` coefficients."""
    beside = averaged or _coefficients(one, knobs)
    moved: list[BenchEffect] = []
    for effect, size in zip(one.known, one.values.tolist(), strict=True):
        own = knobs[effect.name]
        values = {own[0].name: size}
        if averaged is not None:
            mean, _ = averaged[f"{effect.name} {own[0].name}"]
            values[own[0].name] = max(effect.values[own[0].name] + mean, 1e-3 * size)
        for knob in own[1:]:
            a, _ = beside[f"{effect.name} {knob.name}"]
            now = effect.values[knob.name]
            free = (
                now * np.exp(knob.expected[1] * np.clip(a, -3, 2))
                if knob.from_nothing
                else now + unit_of(knob, now) * a
            )
            values[knob.name] = float(np.clip(free, knob.lower, knob.upper))
        moved.append(BenchEffect(effect.name, values))
    return tuple(moved)


def _coefficients(one: _Explanation, knobs: Knobs) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of the coefficient of every shared column, in its own units."""
    total = one.total
    firsts = {f"{name} {knobs[name][0].name}" for name in one.names}
    there = residue_at(total, one.fixture)
    d = scales_of(total, one.sizes, one.names, knobs)
    d = np.array([1.0 if key in firsts else size for key, size in zip(total.keys, d, strict=True)])
    on = np.flatnonzero(d > 0)
    known = np.array([0.0 if total.keys[int(k)] in firsts else 1.0 for k in on])
    H = np.diag(known) + d[on][:, None] * total.G[np.ix_(on, on)] * d[on]
    unit = np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H / unit / unit[:, None], rcond=1e-13, hermitian=True) / unit / unit[:, None]
    mean = -inverse @ (d[on] * total.G[on, -1] + there[on])
    u = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return {total.keys[int(k)]: (float(d[k] * m), float(d[k] * s)) for k, m, s in zip(on, mean, u, strict=True)}


def _scatter(one: _Explanation, name: str, knobs: Knobs) -> dict[float, float]:
    """Return the posterior probability of each relative scatter of an effect's size."""
    size = next(v for effect, v in zip(one.known, one.values.tolist(), strict=True) if effect.name == name)
    key = f"{name} {knobs[name][0].name}"
    weights = {
        s: _finished(one.total.scattered(key, s * size), one.known, one.fixture, one.sizes, knobs).log_evidence
        + float(np.log(prior))
        for s, prior in SCATTERS.items()
    }
    peak = max(weights.values())
    total = sum(np.exp(w - peak) for w in weights.values())
    return {s: float(np.exp(w - peak) / total) for s, w in weights.items()}


def _told(
    now: _Explanation,
    steps: Sequence[tuple[_Explanation, list[tuple[_Explanation, float]]]],
    rejected: Sequence[str],
    knobs: Knobs,
    ends: tuple[float, float],
) -> SharedBench:
    """Return the result."""
    beside = _averaged(now, knobs)
    known = _moved(now, knobs, beside)
    effects = tuple(_effect(now, number, steps[number], knobs, known, beside) for number in range(len(known)))
    fixture: dict[str, FixturePart] = {}
    for name, scale in scales.FIXTURE.items():
        if f"fixture {name}" in beside:
            mean, u = beside[f"fixture {name}"]
            value = now.fixture.get(name, 0.0) + mean * scale
            fixture[name] = FixturePart(value, u * scale, UNITS[name], _is_there(value / scale, u))
    residue: tuple[BenchEffect, ...] = ()
    if fixture:
        residue = (BenchEffect(FIXTURE_RESIDUAL.name, {name: part.value for name, part in fixture.items()}),)
    gain, phase = _largest_errors(beside, ends, [own for one, _, _ in now.total.parts for own in one.accuracy])
    errors = {"tau": now.sizes.tau, "rho": now.sizes.rho}
    return SharedBench(effects, (*known, *residue), fixture, gain, phase, errors, tuple(rejected))


def _is_there(value: float, u: float) -> float:
    """Return the probability that a part of the residual is present, from value and u in units of its prior.

    The odds are those of any effect, times the ratio of prior to posterior density at zero (Savage and Dickey).
    """
    log_odds = 0.5 * (value / u) ** 2 + float(np.log(u * ODDS))
    return float(1 / (1 + np.exp(-min(log_odds, 700.0))))


def _largest_errors(
    beside: Mapping[str, tuple[float, float]], ends: tuple[float, float], accuracy: Sequence[tuple[Reals, Reals]]
) -> tuple[float, float]:
    """Return the largest gain and phase error of any recording; `accuracy`: ln frequency and accuracy of each."""
    largest = {"gain": 0.0, "phase": 0.0}
    for log_f, size in accuracy:
        bases = {part: smooth(log_f, ends, length, most) for part, length, most in scales.OF_INSTRUMENT}
        for side, before in largest.items():
            curve = np.zeros(log_f.size)
            for part, basis in bases.items():
                curve += basis @ [beside.get(f"{part} {side} {k}", (0.0, 0.0))[0] for k in range(basis.shape[1])]
            largest[side] = max(before, float(np.max(np.abs(curve * size))))
    return largest["gain"], largest["phase"]


def _effect(
    final: _Explanation,
    number: int,
    step: tuple[_Explanation, list[tuple[_Explanation, float]]],
    knobs: Knobs,
    known: tuple[BenchEffect, ...],
    beside: Mapping[str, tuple[float, float]],
) -> SharedEffect:
    before, weighed = step
    name = known[number].name
    own = knobs[name]
    temper = coarseness(min((one.shortfall for one, _ in weighed), default=0.0))
    logs = np.array([before.log_evidence, *(weight for _, weight in weighed)])
    odds = logs / temper
    p = np.exp(odds - np.max(odds)) / np.sum(np.exp(odds - np.max(odds)))
    by_name = dict(zip(["", *(one.names[-1] for one, _ in weighed)], p.tolist(), strict=True))
    parameters: dict[str, Size] = {}
    for knob in own:
        value = known[number].values[knob.name]
        unit = 1.0 if knob is own[0] else unit_of(knob, value)
        parameters[knob.name] = Size(value, beside[f"{name} {knob.name}"][1] * unit, knob.unit)
    gain = next(one.log_evidence for one, _ in weighed if one.names[-1] == name) - before.log_evidence
    limit = scales.FIXTURE.get(own[0].name)
    alone, sizes = _alone(before, final, name, number, knobs)
    return SharedEffect(
        effect=name,
        probability=by_name[name],
        parameters=parameters,
        scatter={f"{s:g}": q for s, q in _scatter(final, name, knobs).items()},
        gain=gain,
        alone=alone,
        sizes=sizes,
        alternatives={other: q for other, q in by_name.items() if other not in ("", name)},
        within_fixture=limit is not None and parameters[own[0].name].value < TOLERATED * limit,
    )


def _alone(
    before: _Explanation, final: _Explanation, name: str, number: int, knobs: Knobs
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Return, by sample, ln evidence of an effect from it alone, and its estimate of the size."""
    alone: dict[str, float] = {}
    sizes: dict[str, tuple[float, float]] = {}
    knob = knobs[name][0]
    for k, (one, _, _) in enumerate(before.total.parts):
        found = quadratic_in(before.total.only(k), before.sizes, [name, *before.names], knobs, before.fixture)
        alone[one.sample], _ = _gain(without_others(found), knob.expected[0], knob)
    for k, (one, _, _) in enumerate(final.total.parts):
        found = without_others(quadratic_in(final.total.only(k), final.sizes, [name], knobs, final.fixture))
        there = final.known[number].values[knob.name]
        sizes[one.sample] = (float(there - found.b[0] / found.A[0, 0]), float(found.A[0, 0] ** -0.5))
    return alone, sizes
