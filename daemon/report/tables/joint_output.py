"""The diagnosis of many samples as the JSON object of `pzctl diagnose --all --json`, and as text for the terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console

from ....fitters.diagnosis.decision_rules import NAMED
from ....fitters.population.joint_diagnosis import JointDiagnosis, Recurring
from ....fitters.population.shared_bench import SharedBench, SharedEffect
from ....fitters.population.shared_effects import COMMON
from ....models.base.uncertain_numbers import with_uncertainty
from ....models.effects import find_effect
from ....models.effects.base.effect import TERMINALS
from ..probability import probability_text
from .diagnosis_output import diagnosis_json
from .population_table import population_json, population_table
from .unbroken_table import Column, UnbrokenTable

_SHOWN = 1e-6
"""Smallest common error of the analyzer, of ln Z, that is told."""
_FIXTURE = "fixture-residual"
_TOLD = 0.01
"""Smallest probability at which another explanation is mentioned."""


def joint_json(joint: JointDiagnosis) -> dict[str, Any]:
    """Return the joint diagnosis as one JSON object."""
    bench = joint.shared
    return {
        "samples": list(joint.samples),
        "shared": [_shared(one, len(joint.own)) for one in bench.effects] + _fixture(bench),
        "fixture": msgspec.to_builtins(bench.fixture),
        "analyzer": {"gain": bench.gain, "phase_rad": bench.phase},
        "model_error": dict(bench.model_error),
        "not_shared": list(bench.not_shared),
        "own": {sample: diagnosis_json(one) for sample, one in joint.own.items()},
        "recurring": [msgspec.to_builtins(one) for one in joint.recurring],
        "population": population_json(joint.population),
        "failed": dict(joint.failed),
        "says": shared_sentences(joint),
        "seconds": joint.seconds,
    }


def _shared(one: SharedEffect, count: int) -> dict[str, Any]:
    """Return a shared effect in the form of a finding, with the result from each sample."""
    return {
        "effect": one.effect,
        "where": TERMINALS,
        "samples": count,
        "probability": one.probability,
        "parameters": msgspec.to_builtins(one.parameters),
        "gain": one.gain,
        "scatter": dict(one.scatter),
        "sizes": {sample: {"value": value, "u": u} for sample, (value, u) in one.sizes.items()},
        "alone": dict(one.alone),
        "alternatives": [
            {"effect": name, "where": TERMINALS, "probability": p} for name, p in one.alternatives.items()
        ],
        "within_fixture": one.within_fixture,
        "says": find_effect(one.effect).says.format(where=TERMINALS),
    }


def _fixture(bench: SharedBench) -> list[dict[str, Any]]:
    """Return the fixture's residual as a finding, if a part of it is more probable than not."""
    there = {name: part for name, part in bench.fixture.items() if part.probability >= NAMED}
    if not there:
        return []
    return [
        {
            "effect": _FIXTURE,
            "where": TERMINALS,
            "probability": max(part.probability for part in there.values()),
            "parameters": {name: {"value": part.value, "u": part.u, "unit": part.unit} for name, part in there.items()},
            "says": "Open and short compensation left a residue, the same in all samples; a short lead or a little "
            "stray capacitance would look the same.",
        }
    ]


def shared_sentences(joint: JointDiagnosis) -> list[str]:
    """Return one sentence for each shared effect; one sentence if there is none."""
    bench, count = joint.shared, len(joint.own)
    says = [_sentence(one, count) for one in bench.effects]
    left = [_sizes(one["parameters"]) for one in _fixture(bench)]
    says += [f"Residue of the compensation in all {count} samples: {sizes}." for sizes in left]
    says += [
        f"{name} would explain much, but by another amount in each sample: look at each one's own."
        for name in bench.not_shared
    ]
    return says or [f"The {count} samples share nothing beyond the analyzer's own error."]


def _sentence(one: SharedEffect, count: int) -> str:
    common = sum(p for s, p in one.scatter.items() if float(s) <= COMMON)
    others = "".join(f"; {name} {p:.2f}" for name, p in one.alternatives.items() if p > _TOLD)
    return (
        f"{one.effect}, {_sizes(msgspec.to_builtins(one.parameters), first=True)}, in all {count} samples "
        f"(probability {one.probability:.2f}{others}; one size for all {common:.2f})."
    )


def print_joint(console: Console, joint: JointDiagnosis) -> None:
    """Print the shared effects, each sample's own findings, and the statistics of the constants."""
    console.print("What all samples share", style="bold", highlight=False)
    for sentence in shared_sentences(joint):
        console.print(f"- {sentence}", highlight=False, markup=False)
    bench = joint.shared
    console.print(f"- {_analyzer(bench)}", highlight=False)
    for one in bench.effects:
        console.print(_size_table(one))
    console.print(_own_table(joint))
    for one in joint.recurring:
        console.print(f"- {_recurring(one)}", highlight=False, markup=False)
    for sample, says in joint.failed.items():
        console.print(f"! {sample}: {says}", style="yellow", highlight=False, markup=False)
    if joint.population.constants:
        console.print(population_table(joint.population))
    console.print(f"{len(joint.own)} samples in {joint.seconds:.1f} s", highlight=False)


def _analyzer(bench: SharedBench) -> str:
    """Return what the samples show of the analyzer's common error."""
    if max(bench.gain, bench.phase) < _SHOWN:
        return "The samples show no common error of the analyzer."
    gain, phase = f"gain {100 * bench.gain:.2g} %", f"phase {1e3 * bench.phase:.2g} mrad"
    return f"The analyzer's common error that the samples show: {gain}, {phase} at most."


def _recurring(one: Recurring) -> str:
    ranges = [f"{name} {min(values):.3g} to {max(values):.3g}" for name, values in one.sizes.items()]
    return f"{one.effect} at {one.where}: each one's own in {', '.join(one.samples)}" + (
        f" ({'; '.join(ranges)})" if ranges else ""
    )


def _size_table(one: SharedEffect) -> UnbrokenTable:
    """Return a table of a shared effect's size from each sample alone."""
    name, size = next(iter(one.parameters.items()))
    alone = (Column(head, justify="right") for head in (f"{name}, {size.unit}", "ln evidence alone"))
    title = f"{one.effect}, {name} by each sample alone"
    table = UnbrokenTable("sample", *alone, title=title, box=SIMPLE_HEAD)
    for sample, (value, u) in one.sizes.items():
        table.add_row(sample, with_uncertainty(value, u), f"{one.alone.get(sample, float('nan')):+.4g}")
    table.add_row("together", with_uncertainty(size.value, size.u), f"{one.gain:+.4g}", style="bold")
    return table


def _own_table(joint: JointDiagnosis) -> UnbrokenTable:
    findings = Column("its own findings", prose=True)
    table = UnbrokenTable("sample", "verdict", findings, "left of ln Z", title="Each sample's own", box=SIMPLE_HEAD)
    for sample, one in joint.own.items():
        findings = ", ".join(f"{f.effect} at {f.where} ({probability_text(f.probability)})" for f in one.findings)
        left = "-" if one.remaining is None else f"{100 * one.remaining.total:.2g} %"
        table.add_row(sample, one.verdict, findings or "nothing", left)
    return table


def _sizes(parameters: Mapping[str, Any], *, first: bool = False) -> str:
    items: Sequence[tuple[str, Any]] = list(parameters.items())
    return ", ".join(
        f"{name} {with_uncertainty(size['value'], size['u'])} {size['unit']}".rstrip()
        for name, size in (items[:1] if first else items)
    )
