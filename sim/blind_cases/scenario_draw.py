"""Draws the cases: no effect, one, two, one outside the catalogue, or one that the constants absorb."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import effect_families as families
from . import layer_families as layered
from .detectability import AbsorbedFit, fit_without, scaled_to_gain
from .device_under_test import DeviceUnderTest, random_device
from .injected_effect import InjectedEffect, Scenario, path_effect
from .node_circuit import OHM_OF_CABLE
from .recording_process import SweepSpec

KINDS = {"none": 0.25, "one": 0.45, "two": 0.15, "outside": 0.10, "absorbed": 0.05}
_UNDETECTABLE = 6.0
"""Gain in chi2 that no test can distinguish from noise."""
_SHRINK_FACTOR, _SHRINK_ROUNDS = 0.8, 12
"""Factor that is applied to an effect until it is undetectable, and how often at most."""
_SMALL = 0.1
"""An absorbed effect must be scalable to this part of its base size; a face is either in water or not."""
_POINTS = 801
_ABSORBING_BANDS = (0.117, 1.46), (0.6, 1.4)
"""Bands in units of f0 with a single resonance, where the constants can absorb an effect."""


@dataclass(frozen=True)
class Case:
    """One recording session and its truth."""

    name: str
    kind: str
    scenario: Scenario
    sweeps: tuple[SweepSpec, ...]
    absorbed_fits: tuple[AbsorbedFit, ...]
    """For each effect, the fit without it, which tells how detectable it is."""
    stated_diameter: float
    """m, as the build file states it."""
    seed: int


def draw_case(seed: int, index: int) -> Case:
    """Return case number `index` of a seed, the same one every time."""
    rng = np.random.default_rng([seed, index])
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    name = f"case-{index:03d}"
    effects, device = _draw_effects(rng, kind, name)
    stated_diameter = device.diameter
    if kind == "absorbed" and not effects:
        stated_diameter, device = _with_wrong_size(rng, device)
    sweeps = plan_session(rng, device, effects, kind)
    scenario = Scenario(device, effects)
    for k in range(len(effects)):
        scenario, _ = scaled_to_gain(scenario, k, sweeps, _target_gain(rng, kind))
    fits = tuple(fit_without(scenario, k, sweeps) for k in range(len(effects)))
    for _ in range(_SHRINK_ROUNDS):
        if kind != "absorbed" or all(fit.gain < _UNDETECTABLE for fit in fits):
            break
        scenario = replace(
            scenario, effects=tuple(effect.at(effect.scale * _SHRINK_FACTOR) for effect in scenario.effects)
        )
        fits = tuple(fit_without(scenario, k, sweeps) for k in range(len(effects)))
    scenario = replace(scenario, effects=with_alternative_names(scenario, sweeps))
    return Case(name, kind, scenario, sweeps, fits, stated_diameter, int(rng.integers(2**31)))


def with_alternative_names(scenario: Scenario, sweeps: Sequence[SweepSpec]) -> tuple[InjectedEffect, ...]:
    """Return the effects with the other names that count as right: a cable of undetectable capacitance is a lead."""
    effects = scenario.effects
    cables = [k for k, effect in enumerate(effects) if effect.name == "cable"]
    if not cables or {effect.name for effect in effects} & {"lead-inductance", "stray-capacitance"}:
        return effects  # `_joint_names` has the names of such a pair
    cable = effects[cables[0]]
    inductance = OHM_OF_CABLE * cable.scale * float(cable.sizes["delay"])
    lead = path_effect("lead-inductance", cable.steps, 30.0, inductance=inductance)
    if fit_without(Scenario(scenario.device, (*effects, lead)), cables[0], sweeps).gain > _UNDETECTABLE:
        return effects
    joint = _joint_names({lead.name if effect is cable else effect.name for effect in effects})
    return tuple(replace(effect, accept=joint or ((lead.name,) if effect is cable else ())) for effect in effects)


def _target_gain(rng: np.random.Generator, kind: str) -> float:
    """Return the gain in chi2 that an effect must have: from barely detectable to obvious."""
    if kind == "absorbed":
        return _UNDETECTABLE / 2
    return float(10 ** rng.uniform(2.2 if kind == "two" else 1.3, 7.0))


def _draw_effects(rng: np.random.Generator, kind: str, name: str) -> tuple[tuple[InjectedEffect, ...], DeviceUnderTest]:
    """Return effects, and a device that has the places for them."""
    steps = int(rng.choice([1, 2, 3], p=[0.6, 0.28, 0.12]))
    backed = bool(rng.random() < 0.08)
    count = {"none": 0, "one": 1, "two": 2, "outside": 1, "absorbed": 1}[kind]
    weights = np.array([weight for weight, _ in families.CATALOGUE])
    for _ in range(200):
        device = random_device(rng, name, steps, backed)
        if kind == "outside":
            return (families.outside(rng, device),), device
        if kind == "absorbed":
            return _absorbed(rng, device), device
        chosen = rng.choice(len(weights), size=count, replace=False, p=weights / weights.sum())
        effects = _effects_of_families(rng, [families.CATALOGUE[int(k)][1] for k in chosen], device)
        if effects is not None:
            return effects, device
        steps, backed = int(rng.integers(1, 4)), bool(rng.random() < 0.2)
    return (), random_device(rng, name, 1, False)


def _effects_of_families(
    rng: np.random.Generator, chosen: Sequence[families.Family], device: DeviceUnderTest
) -> tuple[InjectedEffect, ...] | None:
    """Return the effects, or None if the device has no place for one of them."""
    effects: list[InjectedEffect] = []
    for family in chosen:
        if family in families.BOND and not device.layers:
            return None
        effect = family(rng, device)
        alone = effect.needs == "the disk alone" and (len(device.steps) > 1 or len(chosen) > 1)
        wide = effect.needs == "the disk alone" and device.diameter / device.disk.thickness > 30
        if alone or wide or (effect.needs == "a backing") != (device.back > 1e6):
            return None
        effects.append(effect)
    if {"up and down", "levels"} <= {effect.needs for effect in effects}:
        return None  # a session has repeats of only one kind
    joint = _joint_names({effect.name for effect in effects})
    return tuple(replace(effect, accept=joint) for effect in effects)


def _joint_names(pair: set[str]) -> tuple[str, ...]:
    """Return the names of the one effect of the catalogue that equals two effects together; empty if there is none."""
    if len(pair & {"lead-inductance", "stray-capacitance", "cable"}) == 2:
        # a short cable is an inductance before a capacitance; with a further one, a cable of another impedance
        return ("cable",)
    if pair == {"lead-inductance", "series-resistance"}:
        return ("lead-inductance",)  # a wire has both
    return ()


def _absorbed(rng: np.random.Generator, device: DeviceUnderTest) -> tuple[InjectedEffect, ...]:
    """Return an effect that will be made undetectable, or none if a size in the build file will be wrong instead."""
    u = rng.random()
    if u < 0.5:
        return (layered.mass(rng, device),)
    face = layered.face(rng, device)
    return (face,) if u < 0.7 and face.min_scale < _SMALL else ()


def _with_wrong_size(rng: np.random.Generator, device: DeviceUnderTest) -> tuple[float, DeviceUnderTest]:
    """Return the stated diameter and the device; the stated diameter or thickness is wrong by some parts in 1000."""
    wrong = 1 + float(rng.uniform(1e-3, 4e-3)) * (1 if rng.random() < 0.5 else -1)
    if rng.random() < 0.5:
        return device.diameter * wrong, device
    return device.diameter, replace(device, stated_thickness=device.disk.thickness * wrong)


def plan_session(
    rng: np.random.Generator, device: DeviceUnderTest, effects: Sequence[InjectedEffect], kind: str
) -> tuple[SweepSpec, ...]:
    """Return the sweeps of a session: every step, with a repeat downwards or at another level where it is needed."""
    f0 = device.disk.f0
    needs = {effect.needs for effect in effects}
    ranges = [(0.12, 1.5), (0.12, 2.4), (0.117, 3.4)]
    low, high = ranges[int(rng.choice(3, p=[0.2, 0.3, 0.5]))]
    if "the disk alone" in needs:
        low, high = 0.45, 1.55
    if kind == "absorbed":
        low, high = _ABSORBING_BANDS[int(rng.integers(len(_ABSORBING_BANDS)))]
    f = np.round(np.linspace(low * f0, high * f0, _POINTS), 3)
    quiet = bool(rng.random() < 0.9)
    base = SweepSpec("disk", f, noise=2e-4 if quiet else 6e-4, bandwidth=5 if quiet else 3, level_V=0.5)
    sweeps: list[SweepSpec] = []
    chance = rng.random()
    for step in device.steps:
        first = replace(base, step=step)
        if "up and down" in needs or (not needs - {"nothing"} and chance < 0.2):
            first = replace(first, seconds=128.0 if quiet else 60.0)
            sweeps += [first, replace(first, down=True, order=1)]
        elif "levels" in needs or (not needs - {"nothing"} and chance > 0.93):
            sweeps += [replace(first, level_V=0.1), replace(first, level_V=1.0, order=1)]
        elif kind == "one" and device.steps == ("disk",) and chance > 0.75 and not needs - {"nothing"}:
            narrow = np.round(np.linspace(0.75 * f0, 1.3 * f0, _POINTS), 3)
            sweeps += [replace(first, frequency=narrow), replace(first, order=1)]
        else:
            sweeps.append(first)
    return tuple(sweeps)
