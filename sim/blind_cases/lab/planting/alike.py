"""Alternative names of a plant: effects that no recording of the case could distinguish from it.

A rival effect with one size replaces the plant, with its size and all constants free. If the remaining difference
changes ln Z by no more than the analyzer's accuracy, or gains no more than noise could, its name is accepted too.
"""

from collections.abc import Callable
from dataclasses import replace

from ..devices.specimen import LabDevice
from .plant import LabScenario, LabWorld, Plant
from .visible import FINDABLE_GAIN, View

Put = Callable[[LabWorld, float], LabWorld]


def _terminals(put: Put, effect: str) -> Callable[[Plant, LabDevice], Plant]:
    def rival(plant: Plant, _: LabDevice) -> Plant:
        return Plant(effect, ("terminals",), plant.steps, put)

    return rival


def _inside(put: Put, effect: str) -> Callable[[Plant, LabDevice], Plant]:
    def rival(plant: Plant, _: LabDevice) -> Plant:
        return Plant(effect, ("layer:disk",), plant.steps, put)

    return rival


_LEAD = _terminals(lambda w, k: w.wired(inductance=w.flaws.wiring.inductance + 1e-8 * k), "lead-inductance")
_RESISTANCE = _terminals(lambda w, k: w.wired(resistance=w.flaws.wiring.resistance + 0.1 * k), "series-resistance")
_CABLE = _terminals(lambda w, k: w.wired(delay=w.flaws.wiring.delay + 2e-10 * k), "cable")
_SHEET = _terminals(lambda w, k: w.with_flaws(sheet=(0.1 * k, 0.1)), "electrode-sheet")
_LEAKAGE = _terminals(lambda w, k: w.wired(conductance=w.flaws.wiring.conductance + 1e-6 * k), "leakage")
_STRAY = _terminals(lambda w, k: w.wired(capacitance=w.flaws.wiring.capacitance + 1e-12 * k), "stray-capacitance")


_LOSS = _inside(lambda w, k: w.with_flaws(viscosity=("disk", 0.1 * k, 1.0)), "loss-dispersion")
_MASS = _inside(lambda w, k: w.with_flaws(electrodes=(0.0, 1e-3 * k)), "electrode-mass")
_SURFACE = _inside(lambda w, k: w.with_flaws(surface=(1e-7 * k, "front", 1.0, 1.0)), "surface-layer")


def _resting(effect: str, kind: str) -> Callable[[Plant, LabDevice], Plant]:
    def rival(plant: Plant, _: LabDevice) -> Plant:
        side = "back" if plant.where[0] == "face:back" else "front"
        return Plant(effect, plant.where, plant.steps, lambda w, k: w.with_flaws(face=(side, kind, 1e4 * k, 0.0)))

    return rival


_RIVALS: dict[str, tuple[Callable[[Plant, LabDevice], Plant], ...]] = {
    "lead-inductance": (_CABLE,),
    "cable": (_LEAD,),
    "series-resistance": (_SHEET,),
    "electrode-sheet": (_RESISTANCE,),
    "stray-capacitance": (_CABLE,),
    "face-load": (_resting("viscous-load", "viscous"), _LOSS),
    "viscous-load": (_resting("face-load", "pad"), _LOSS),
    "surface-layer": (_MASS,),
    "electrode-mass": (_SURFACE,),
    "unknown": (_RESISTANCE, _LEAKAGE, _STRAY),
}
"""By effect: rivals with one size that have been mistaken for it."""
_LINE = frozenset({"lead-inductance", "stray-capacitance", "cable"})


def with_other_names(scenario: LabScenario, view: View, floor: float) -> LabScenario:
    """Return the scenario with all accepted names of its plants; `floor`: change of ln Z that nobody can rely on."""
    plants = list(scenario.plants)
    whole = together({plant.effect for plant in plants})
    for index, plant in enumerate(scenario.plants):
        if plant.minor:
            continue
        names = [*plant.accept, *(whole if plant.effect in _LINE else ())]
        for make in _RIVALS.get(plant.effect, ()):
            rival = make(plant, scenario.bare.specimen)
            left = view.with_rival(rival).seen(index)
            if left.gain < FINDABLE_GAIN or left.moves < floor:
                names.append(rival.effect)
        names = [name for name in names if name != plant.effect]
        plants[index] = replace(plant, accept=tuple(dict.fromkeys(names)))
    return replace(scenario, plants=tuple(plants))


def together(names: set[str]) -> tuple[str, ...]:
    """Return the single catalogue effect (a short cable) that several terminal effects together amount to."""
    return ("cable",) if len(names & _LINE) > 1 else ()
