"""What a case is drawn to be: nothing hidden, one effect, two, one of no catalogue, one that constants absorb."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import effect_families as families
from . import layer_families as layered
from .detectability import AbsorbedFit, imitate, sized
from .device_under_test import DeviceUnderTest, random_specimen
from .injected_effect import InjectedEffect, Scenario, path_plant
from .node_circuit import OHM_OF_CABLE
from .recording_process import SweepSpec

KINDS = {"none": 0.25, "one": 0.45, "two": 0.15, "outside": 0.10, "absorbed": 0.05}
_UNSEEN = 6.0
"""Gain in chi2 that no test can tell from noise."""
_SHRINKS, _SHRINKINGS = 0.8, 12
"""What an effect that is to be unseen is made smaller by until it is, and how often at most."""
_SMALL = 0.1
"""Part of its base size down to which an effect must go to be unseen: a face in water is wet or is not."""
_POINTS = 801
_CONCEALING = (0.117, 1.46), (0.6, 1.4)
"""Bands, in resonance frequencies, whose one resonance leaves the constants free to absorb what is hidden."""


@dataclass(frozen=True)
class Case:
    """One recording session and its truth."""

    name: str
    kind: str
    hideout: Scenario
    takes: tuple[SweepSpec, ...]
    seen: tuple[AbsorbedFit, ...]
    """Of each plant: how visible it is, the sizes of the others free."""
    told_diameter: float
    """m; the build file's."""
    seed: int


def draw_case(seed: int, index: int) -> Case:
    """Return case number `index` of a seed; the same for ever."""
    rng = np.random.default_rng([seed, index])
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    name = f"case-{index:03d}"
    plants, specimen = _plants(rng, kind, name)
    told = specimen.diameter
    if kind == "absorbed" and not plants:
        told, specimen = _mistold(rng, specimen)
    takes = plan(rng, specimen, plants, kind)
    hideout = Scenario(specimen, plants)
    for k in range(len(plants)):
        hideout, _ = sized(hideout, k, takes, _wanted(rng, kind))
    seen = tuple(imitate(hideout, k, takes) for k in range(len(plants)))
    for _ in range(_SHRINKINGS):
        if kind != "absorbed" or all(one.gain < _UNSEEN for one in seen):
            break
        hideout = replace(hideout, plants=tuple(plant.at(plant.scale * _SHRINKS) for plant in hideout.plants))
        seen = tuple(imitate(hideout, k, takes) for k in range(len(plants)))
    hideout = replace(hideout, plants=by_other_names(hideout, takes))
    return Case(name, kind, hideout, takes, seen, told, int(rng.integers(2**31)))


def by_other_names(hideout: Scenario, takes: Sequence[SweepSpec]) -> tuple[InjectedEffect, ...]:
    """Return the plants with the names that are as right: a cable whose capacitance nobody can see is a lead."""
    plants = hideout.plants
    cables = [k for k, one in enumerate(plants) if one.effect == "cable"]
    if not cables or {one.effect for one in plants} & {"lead-inductance", "stray-capacitance"}:
        return plants  # the latter as `_as_one` has it
    cable = plants[cables[0]]
    inductance = OHM_OF_CABLE * cable.scale * float(cable.sizes["delay"])
    lead = path_plant("lead-inductance", cable.steps, 30.0, inductance=inductance)
    if imitate(Scenario(hideout.specimen, (*plants, lead)), cables[0], takes).gain > _UNSEEN:
        return plants
    together = _as_one({lead.effect if one is cable else one.effect for one in plants})
    return tuple(replace(one, accept=together or ((lead.effect,) if one is cable else ())) for one in plants)


def _wanted(rng: np.random.Generator, kind: str) -> float:
    """Return the gain in chi2 that a plant is to have: from barely detectable to what nobody can overlook."""
    if kind == "absorbed":
        return _UNSEEN / 2
    return float(10 ** rng.uniform(2.2 if kind == "two" else 1.3, 7.0))


def _plants(rng: np.random.Generator, kind: str, name: str) -> tuple[tuple[InjectedEffect, ...], DeviceUnderTest]:
    """Return plants and a specimen that has the places for them."""
    steps = int(rng.choice([1, 2, 3], p=[0.6, 0.28, 0.12]))
    backed = bool(rng.random() < 0.08)
    count = {"none": 0, "one": 1, "two": 2, "outside": 1, "absorbed": 1}[kind]
    weights = np.array([weight for weight, _ in families.CATALOGUE])
    for _ in range(200):
        specimen = random_specimen(rng, name, steps, backed)
        if kind == "outside":
            return (families.outside(rng, specimen),), specimen
        if kind == "absorbed":
            return _absorbed(rng, specimen), specimen
        chosen = rng.choice(len(weights), size=count, replace=False, p=weights / weights.sum())
        found = _drawn(rng, [families.CATALOGUE[int(k)][1] for k in chosen], specimen)
        if found is not None:
            return found, specimen
        steps, backed = int(rng.integers(1, 4)), bool(rng.random() < 0.2)
    return (), random_specimen(rng, name, 1, False)


def _drawn(
    rng: np.random.Generator, chosen: Sequence[families.Family], specimen: DeviceUnderTest
) -> tuple[InjectedEffect, ...] | None:
    """Return the plants, or None where the specimen has no place for one of them."""
    plants: list[InjectedEffect] = []
    for family in chosen:
        if family in families.BOND and not specimen.coats:
            return None
        plant = family(rng, specimen)
        alone = plant.needs == "the disk alone" and (len(specimen.steps) > 1 or len(chosen) > 1)
        wide = plant.needs == "the disk alone" and specimen.diameter / specimen.disk.thickness > 30
        if alone or wide or (plant.needs == "a backing") != (specimen.back > 1e6):
            return None
        plants.append(plant)
    if {"up and down", "levels"} <= {plant.needs for plant in plants}:
        return None  # one session has repeats of one kind
    return tuple(replace(plant, accept=_as_one({one.effect for one in plants})) for plant in plants)


def _as_one(pair: set[str]) -> tuple[str, ...]:
    """Return what two plants are together, where that is one effect of the catalogue."""
    if len(pair & {"lead-inductance", "stray-capacitance", "cable"}) == 2:
        # an inductance in front of a capacitance is what a short cable is; with one more, one of another impedance
        return ("cable",)
    if pair == {"lead-inductance", "series-resistance"}:
        return ("lead-inductance",)  # a wire has both
    return ()


def _absorbed(rng: np.random.Generator, specimen: DeviceUnderTest) -> tuple[InjectedEffect, ...]:
    """Return a plant to be kept below what can be seen, or none where the build file is to be wrong."""
    u = rng.random()
    if u < 0.5:
        return (layered.mass(rng, specimen),)
    face = layered.face(rng, specimen)
    return (face,) if u < 0.7 and face.least < _SMALL else ()


def _mistold(rng: np.random.Generator, specimen: DeviceUnderTest) -> tuple[float, DeviceUnderTest]:
    """Return the diameter that the build file says and the specimen: one size is wrong by some parts in 1000."""
    wrong = 1 + float(rng.uniform(1e-3, 4e-3)) * (1 if rng.random() < 0.5 else -1)
    if rng.random() < 0.5:
        return specimen.diameter * wrong, specimen
    return specimen.diameter, replace(specimen, told_thickness=specimen.disk.thickness * wrong)


def plan(
    rng: np.random.Generator, specimen: DeviceUnderTest, plants: Sequence[InjectedEffect], kind: str
) -> tuple[SweepSpec, ...]:
    """Return the sweeps of a session: every step, with a repeat downwards or at another level where that decides."""
    f0 = specimen.disk.f0
    needs = {plant.needs for plant in plants}
    ranges = [(0.12, 1.5), (0.12, 2.4), (0.117, 3.4)]
    low, high = ranges[int(rng.choice(3, p=[0.2, 0.3, 0.5]))]
    if "the disk alone" in needs:
        low, high = 0.45, 1.55
    if kind == "absorbed":
        low, high = _CONCEALING[int(rng.integers(len(_CONCEALING)))]
    f = np.round(np.linspace(low * f0, high * f0, _POINTS), 3)
    quiet = bool(rng.random() < 0.9)
    base = SweepSpec("disk", f, noise=2e-4 if quiet else 6e-4, bandwidth=5 if quiet else 3, level_V=0.5)
    takes: list[SweepSpec] = []
    chance = rng.random()
    for step in specimen.steps:
        first = replace(base, step=step)
        if "up and down" in needs or (not needs - {"nothing"} and chance < 0.2):
            first = replace(first, seconds=128.0 if quiet else 60.0)
            takes += [first, replace(first, down=True, order=1)]
        elif "levels" in needs or (not needs - {"nothing"} and chance > 0.93):
            takes += [replace(first, level_V=0.1), replace(first, level_V=1.0, order=1)]
        elif kind == "one" and specimen.steps == ("disk",) and chance > 0.75 and not needs - {"nothing"}:
            narrow = np.round(np.linspace(0.75 * f0, 1.3 * f0, _POINTS), 3)
            takes += [replace(first, frequency=narrow), replace(first, order=1)]
        else:
            takes.append(first)
    return tuple(takes)
