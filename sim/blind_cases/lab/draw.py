"""Draws the cases of the lab world, and decides which planted effects a diagnosis has to find."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .devices.random_specimen import random_specimen
from .devices.specimen import AIR, LabDevice
from .distributions import Random, loguniform
from .planting import families, layered
from .planting.alike import with_other_names
from .planting.imperfections import imperfections
from .planting.plant import LabScenario, LabWorld, Plant
from .planting.visible import ACCURACY, FINDABLE_GAIN, Seen, View
from .recording import ErringAnalyzer, LabSweep
from .session import analyzer_of, plan

KINDS = {
    "instrument": 0.14,
    "imperfect": 0.12,
    "one": 0.38,
    "two": 0.14,
    "three": 0.07,
    "four": 0.03,
    "outside": 0.12,
}
"""`instrument`: a perfect device and an analyzer that errs; `imperfect`: only imperfections of real devices."""

FAMILIES = (
    *((1.5, families.lead), (1.2, families.resistance), (1.0, families.stray), (0.7, families.leakage)),
    *((1.0, families.cable), (0.3, families.polarity), (0.8, families.sheet), (1.0, families.drift)),
    *((0.8, families.softening), (0.7, families.settling), (0.4, layered.mass), (1.0, layered.dot)),
    *((1.2, layered.bond), (1.2, layered.void), (1.5, layered.spread), (1.0, layered.surface)),
    *((1.0, layered.lateral), (1.0, layered.loss), (1.2, layered.dielectric), (1.2, layered.face)),
    *((0.5, layered.viscous), (0.7, layered.backing), (1.0, layered.resonance), (0.6, layered.ageing)),
    (0.6, layered.piezoelectric),
)
"""Weight and family of every effect that a catalogue may have."""

_DRAWS = 3
"""How often a case is drawn at most until one effect dominates; some never do, because the constants absorb them."""
DOMINATING_GAIN = 100.0
"""chi2 gain that a dominating plant needs: ten standard deviations."""
FINDABLE_OVER = 1.0
DOMINATING_OVER = 3.0
"""Change of ln Z, relative to the analyzer's accuracy, that a plant needs to be findable, and to dominate."""


@dataclass(frozen=True)
class LabSession:
    """One recording session and its truth."""

    name: str
    kind: str
    scenario: LabScenario
    sweeps: tuple[LabSweep, ...]
    analyzer: ErringAnalyzer
    seen: tuple[Seen, ...]
    """Visibility of each plant of the scenario."""
    seed: int

    def role(self, index: int) -> str:
        """Return `dominating`, `findable`, `faint`, or `imperfection` and `faint imperfection`."""
        plant, one = self.scenario.plants[index], self.seen[index]
        if plant.minor:
            return "imperfection" if one.gain > FINDABLE_GAIN else "faint imperfection"
        if one.gain < FINDABLE_GAIN or one.moves < FINDABLE_OVER * ACCURACY:
            return "faint"
        far = one.gain >= DOMINATING_GAIN and one.moves >= DOMINATING_OVER * ACCURACY
        return "dominating" if far and self._largest(index) else "findable"

    def _largest(self, index: int) -> bool:
        return all(
            self.seen[index].moves >= other.moves
            for plant, other in zip(self.scenario.plants, self.seen, strict=True)
            if not plant.minor
        )


def draw_case(seed: int, index: int) -> LabSession:
    """Return case number `index` of a seed, the same one every time."""
    rng = np.random.default_rng([seed, index, 20])
    kind = str(rng.choice(list(KINDS), p=np.array(list(KINDS.values())) / sum(KINDS.values())))
    case = _draw(rng, kind, f"lab-{index:03d}")
    for _ in range(_DRAWS - 1):
        if kind in ("instrument", "imperfect") or "dominating" in map(case.role, range(len(case.seen))):
            break
        case = _draw(rng, kind, case.name)
    return case


def _draw(rng: Random, kind: str, name: str) -> LabSession:
    plants, specimen = _drawn(rng, kind, name)
    sweeps = plan(rng, specimen, plants)
    analyzer = analyzer_of(rng, sweeps, specimen)
    minor = () if kind == "instrument" else imperfections(rng, specimen)
    scenario = LabScenario(LabWorld(specimen, fixture=analyzer.fixture), (*plants, *minor))
    view = View(scenario, sweeps, analyzer)
    for k in range(len(plants)):
        view = _grown(rng, view, k, sweeps, analyzer)
    visible = [view.seen(k) for k in range(len(scenario.plants))]
    scenario = with_other_names(view.scenario, view, max(ACCURACY, analyzer.noise))
    return LabSession(name, kind, scenario, sweeps, analyzer, tuple(visible), int(rng.integers(2**31)))


def _grown(rng: Random, view: View, k: int, sweeps: Sequence[LabSweep], analyzer: ErringAnalyzer) -> View:
    """Return the view of a world in which plant k is large enough to be found, where physics allows it."""
    wanted = max(ACCURACY, 2 * analyzer.noise) * loguniform(rng, 4.0, 30.0)
    for _ in range(3):
        plant = view.scenario.plants[k]
        moves = wanted if plant.least >= plant.most else view.seen(k).moves
        larger = plant.at(plant.scale * min(wanted / max(moves, 1e-9), 20.0))
        if moves > 0.7 * wanted or larger.scale == plant.scale:
            break
        view = View(view.scenario.scaled(k, larger.scale), sweeps, analyzer)
    return view


def _drawn(rng: Random, kind: str, name: str) -> tuple[tuple[Plant, ...], LabDevice]:
    """Return effects and a specimen that has the places for them."""
    count = {"one": 1, "two": 2, "three": 3, "four": 4, "outside": 1}.get(kind, 0)
    weights = np.array([weight for weight, _ in FAMILIES])
    weights = weights / weights.sum()
    chosen = [FAMILIES[int(k)][1] for k in rng.choice(len(weights), size=count, replace=False, p=weights)]
    for _ in range(500):
        steps, backed = int(rng.choice([1, 2, 3], p=[0.6, 0.28, 0.12])), bool(rng.random() < 0.15)
        specimen = random_specimen(rng, name, steps, backed, ceramic_only=rng.random() < 0.8)
        if kind == "outside":
            return (families.outside(rng, specimen),), specimen
        found = _placed(rng, chosen, specimen)
        if found is not None:
            return found, specimen
    return _drawn(rng, kind, name)  # two of them exclude each other: draw others


def _placed(rng: Random, chosen: Sequence[object], specimen: LabDevice) -> tuple[Plant, ...] | None:
    """Return the plants, or None if the specimen has no place for one of them or two exclude each other."""
    plants: list[Plant] = []
    for _, family in FAMILIES:
        if family not in chosen:
            continue
        if family in (layered.bond, layered.void, layered.ageing) and not specimen.layers:
            return None
        plants.append(family(rng, specimen))
    needs = {plant.needs for plant in plants}
    names = {plant.effect for plant in plants}
    ceramic = specimen.ceramic
    aspect = specimen.diameter / ceramic.thickness
    plain = len(specimen.steps) == 1 and ceramic.kind == "soft" and 8 < aspect < 13 and specimen.back == AIR
    excluded = (
        ("a plain disk" in needs and not plain)
        or ("a backing" in needs) != (specimen.back > AIR)
        or {"up and down", "levels"} <= needs
        or {"face-load", "viscous-load"} <= names
        or {"bond-layer", "bond-void"} <= names
        or ("lateral-modes" in names and names & _OF_COLUMNS)
    )
    return None if excluded else tuple(plants)


_OF_COLUMNS = frozenset(
    [
        "drive-nonlinearity",
        "local-mass",
        "thickness-variation",
        "surface-layer",
        "loss-dispersion",
        "dielectric-dispersion",
        "piezoelectric-dispersion",
        "face-load",
        "viscous-load",
        "temperature-drift",
        "electrode-mass",
        "sweep-lag",
    ]
)
"""Families that the two-dimensional disk of this world cannot have."""
