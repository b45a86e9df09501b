"""Shared effects of samples whose recordings have no error but white noise, as simulated ones.

Each sample alone then tells its effects exactly: a name, and a size with its uncertainty. The joint equations of
`shared_effects` have errors, which hide the small differences between a lead and a cable.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...models.base.arrays import Reals
from ...models.effects import EffectParameter
from ...models.effects.base.effect import TERMINALS
from ..diagnosis.decision_rules import NAMED
from ..diagnosis.findings import Diagnosis, Finding, Size
from ..diagnosis.hypotheses.bench_effects import BenchEffect
from .sample_equations import Knobs
from .shared_bench import SharedBench, SharedEffect
from .shared_effects import COMMON, SCATTERS

_LEAST = 1e-9
"""Probability of a name that a sample does not even mention."""


def exact_bench(alone: Mapping[str, Diagnosis], knobs: Knobs) -> SharedBench | None:
    """Return the effects that all samples have with one size; None if there is none.

    `alone`: the diagnosis of each sample alone; empty if some have errors. `knobs`: parameters of each possible effect
    of a bench.
    """
    told = {sample: _at_terminals(one) for sample, one in alone.items()}
    effects: list[SharedEffect] = []
    different: list[str] = []
    for name, p in _named(told).items():
        found = {sample: one[name] for sample, one in told.items() if name in one}
        one = _shared(name, p, found, alone, knobs[name])
        if sum(q for s, q in one.scatter.items() if float(s) <= COMMON) < NAMED:
            different.append(name)
        else:
            effects.append(one)
    if not effects:
        return None
    known = tuple(
        BenchEffect(one.effect, {name: size.value for name, size in one.parameters.items()}) for one in effects
    )
    return SharedBench(tuple(effects), known, {}, 0.0, 0.0, {"tau": 0.0, "rho": 0.0}, tuple(different))


def _at_terminals(one: Diagnosis) -> dict[str, Finding]:
    return {finding.effect: finding for finding in one.findings if finding.where == TERMINALS}


def _named(told: Mapping[str, Mapping[str, Finding]]) -> dict[str, dict[str, float]]:
    """Return the effects that all samples name, each with the probabilities of itself and of others in its place.

    Samples are independent, so probabilities multiply; where one names another effect, its own is an alternative there.
    """
    named: dict[str, dict[str, float]] = {}
    for name in dict.fromkeys(effect for one in told.values() for effect in one):
        classes = [_class_of(name, one) for one in told.values()]
        if not all(classes):
            continue
        names = dict.fromkeys(other for p in classes for other in p)
        logs = np.array([sum(float(np.log(p.get(other, _LEAST))) for p in classes) for other in names])
        together = np.exp(logs - np.max(logs)) / np.sum(np.exp(logs - np.max(logs)))
        p = dict(zip(names, together.tolist(), strict=True))
        if p[name] == max(p.values()):
            named[name] = p
    return named


def _class_of(name: str, findings: Mapping[str, Finding]) -> dict[str, float]:
    """Return the probabilities of an effect and of those in its place in one sample; empty if it is not mentioned."""
    for one in findings.values():
        p = {one.effect: one.probability, **{other.effect: other.probability for other in one.alternatives}}
        if name in p:
            return {effect: max(value, _LEAST) for effect, value in p.items()}
    return {}


def _shared(
    name: str,
    p: Mapping[str, float],
    found: Mapping[str, Finding],
    alone: Mapping[str, Diagnosis],
    knobs: Sequence[EffectParameter],
) -> SharedEffect:
    """Return the effect with the common value of its size, and medians of its other parameters.

    What a few samples have in addition, a resistance of a clip, does not change a median.
    """
    first, *others = (knob.name for knob in knobs)
    sizes = {sample: (one.parameters[first].value, one.parameters[first].u) for sample, one in found.items()}
    values, u = np.array(list(sizes.values())).T
    weight = u**-2.0
    unit = {knob.name: knob.unit for knob in knobs}
    parameters = {first: Size(float(weight @ values / np.sum(weight)), float(np.sum(weight) ** -0.5), unit[first])}
    for other in others:
        middle = sorted((one.parameters[other] for one in found.values()), key=lambda size: size.value)
        at = middle[(len(middle) - 1) // 2]
        parameters[other] = Size(at.value, at.u, unit[other])
    takes = {sample: _takes(one, alone[sample]) for sample, one in found.items()}
    return SharedEffect(
        effect=name,
        probability=p[name],
        parameters=parameters,
        scatter=_scatter(values, u),
        gain=sum(takes.values()),
        alone=takes,
        sizes=sizes,
        alternatives={other: q for other, q in p.items() if other != name},
        within_fixture=False,
    )


def _takes(one: Finding, diagnosis: Diagnosis) -> float:
    """Return ln of the likelihood ratio of an effect in its sample."""
    readings = 2 * sum(curve.frequency.size for curve in diagnosis.after)
    return (one.chi2_per_dof_before - one.chi2_per_dof_after) * readings / 2


def _scatter(values: Reals, u: Reals) -> dict[str, float]:
    """Return the posterior probability of each relative scatter of a size, the common value integrated out."""
    logs: list[float] = []
    for s, prior in SCATTERS.items():
        variance = u**2 + (s * np.mean(values)) ** 2
        weight = 1 / variance
        left = values - weight @ values / np.sum(weight)
        logs.append(float(np.log(prior) - 0.5 * (weight @ left**2 + np.sum(np.log(variance)) + np.log(np.sum(weight)))))
    p = np.exp(np.array(logs) - max(logs))
    return {f"{s:g}": q for s, q in zip(SCATTERS, (p / np.sum(p)).tolist(), strict=True)}
