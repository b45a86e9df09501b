"""Cases of the lab world as files: build file and recordings for the diagnosis, truth for the judge only."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..waves import Complexes
from .devices.specimen import AIR, Coat, Specimen
from .draw import LabSession, draw_case
from .planting.plant import Plant
from .recording import Take, shown


def make_case(folder: Path, seed: int, index: int) -> dict[str, Any]:
    """Write the files of one case to a folder of its own below `folder`; return its name and its truth."""
    case = draw_case(seed, index)
    place = folder / case.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "build.toml").write_text(build_text(case), encoding="utf-8")
    rng = np.random.default_rng(case.seed)
    files: dict[str, list[str]] = {}
    for take in case.takes:
        of_step = files.setdefault(take.step, [])
        of_step.append(f"{take.step}.csv" if not of_step else f"{take.step}-{len(of_step) + 1}.csv")
        (place / of_step[-1]).write_text(
            _csv_text(take, measured(case, take, rng), case.analyzer.bandwidth), encoding="utf-8"
        )
    return {"name": case.name, **truth(case), "files": files}


def measured(case: LabSession, take: Take, rng: np.random.Generator) -> Complexes:
    """Return one recording of the analyzer: ohm, shape (N,), by rising frequency."""
    world = case.hideout.world(take.step)
    z = shown(world.specimen, world.flaws, take, world.fixture)
    return case.analyzer.noisy(z * case.analyzer.error(take.frequency, z), rng)


def _csv_text(take: Take, z: Complexes, bandwidth: int) -> str:
    """Return a recording in the order of the sweep, with seven digits."""
    lines = [f"# bandwidth: {bandwidth}", f"# oscillator_V: {take.level_V}"]
    if take.seconds:
        lines.append(f"# sweep_seconds: {take.seconds:g}")
    if take.down:
        lines.append("# direction: down")
    rows = [f"{f:.3f},{value.real:.6e},{value.imag:.6e}" for f, value in zip(take.frequency, z, strict=True)]
    rows = rows[::-1] if take.down else rows
    return "\n".join([*lines, "frequency_Hz,R_ohm,X_ohm", *rows]) + "\n"


def build_text(case: LabSession) -> str:
    """Return the build file, which omits every hidden effect."""
    specimen, untold = case.hideout.bare.specimen, case.hideout.untold
    coats = [coat for coat in specimen.coats if coat.name not in untold]
    back = '"air"' if specimen.back == AIR else f"{{ z_MRayl = {specimen.back / 1e6!r} }}"
    told = specimen.told
    diameter = f"{told.diameter * 1e3:.6f}"
    if told.diameter_u:
        diameter = f"{{ value = {diameter}, u = {told.diameter_u * 1e3:.6f} }}"
    lines = [
        f'name = "{case.name}"\ndiameter_mm = {diameter}\n',
        _ceramic_text(specimen),
        *(_coat_text(coat) for coat in coats),
        f'[load]\nback = {back}\nfront = "air"\n',
    ]
    for step in specimen.steps:
        names = ["disk", *(coat.name for coat in specimen.coats_of(step) if coat.name not in untold)]
        lines.append(f'[[steps]]\nname = "{step}"\nlayers = {json.dumps(names)}\n')
    return "\n".join(lines)


def _ceramic_text(specimen: Specimen) -> str:
    told = specimen.told
    lines = ["[[layers]]", 'name = "disk"', 'kind = "piezo"']
    if told.material:
        lines.append(f'material = "{told.material}"')
    lines.append(f"thickness_mm = {{ value = {told.thickness * 1e3:.6f}, u = {told.thickness_u * 1e3:.6f} }}")
    for key, re, im, u in told.values:
        if not (im or u):
            lines.append(f"{key} = {re:g}")
        elif im:
            lines.append(f"{key} = {{ re = {re:.6g}, im = {im:.6g}, u = {u:.4g} }}")
        else:
            lines.append(f"{key} = {{ value = {re:.6g}, u = {u:.4g} }}")
    return "\n".join(lines) + "\n"


def _coat_text(coat: Coat) -> str:
    t, z, c, q = coat.told
    u_t, u_z, u_c, u_q = coat.u

    def quantity(value: float, u: float) -> str:
        return f"{{ value = {value:.6g}, u = {u:.4g} }}" if u else f"{value:.6g}"

    return (
        f'[[layers]]\nname = "{coat.name}"\nkind = "elastic"\nz_MRayl = {quantity(z / 1e6, u_z / 1e6)}\n'
        f"c_m_s = {quantity(c, u_c)}\nq = {quantity(q, u_q)}\nthickness_mm = {quantity(t * 1e3, u_t * 1e3)}\n"
    )


def truth(case: LabSession) -> dict[str, Any]:
    """Return the truth for the judge: findings in the order of their effect on ln Z, and further accepted findings."""
    plants = case.hideout.plants
    entries = [(case.role(k), _entry(case, k)) for k in range(len(plants))]
    entries.sort(key=lambda one: -one[1]["moves"])
    findings = [entry | {"role": role} for role, entry in entries if role in ("dominating", "findable")]
    faint = [entry for role, entry in entries if role == "faint"]
    verdict = "explained" if findings else "no-mismatch"
    if any(entry["effect"] == "unknown" for entry in findings):
        verdict = "unexplained"
    return {
        "kind": case.kind,
        "verdict": verdict,
        "findings": findings,
        "faint": faint,
        "also": [entry for role, entry in entries if role == "imperfection"] + _instrument(case),
        "not_decidable": [],
        "constants": constants(case.hideout.bare.specimen),
        "noise": {"relative": case.analyzer.noise, "colour": case.analyzer.colour},
        "imperfections_move": case.floor,
    }


def _entry(case: LabSession, index: int) -> dict[str, Any]:
    plant: Plant = case.hideout.plants[index]
    one = case.seen[index]
    return {
        "effect": plant.effect,
        "accept": list(plant.accept),
        "where": list(plant.where),
        "step": plant.steps[0],
        "gain": one.gain,
        "moves": one.moves,
        **{name: size * plant.scale for name, size in plant.sizes.items()},
        "shape": dict(plant.shape),
    }


def _instrument(case: LabSession) -> list[dict[str, Any]]:
    """Return the contributions of instrument and fixture, which are accepted as findings."""
    step = case.hideout.bare.specimen.steps[0]
    return [
        {"effect": "analyzer-error", "where": ["sweep", "terminals"], "step": step},
        {"effect": "fixture-residual", "where": ["terminals"], "step": step},
    ]


def constants(specimen: Specimen) -> dict[str, list[float]]:
    """Return the true constants, real and imaginary part, at the ceramic's own resonance.

    A glue acts by its compliance. If the build file states a wrong stiffness as exact, the thickness to be found is the
    one that gives the true compliance with the stated stiffness.
    """
    ceramic = specimen.ceramic
    found = {f"disk.{name}": getattr(ceramic, name) for name in ("c33D", "h33", "eps33S")}
    values = {name: [complex(one).real, complex(one).imag] for name, one in found.items()}
    for coat in specimen.coats:
        _, told_z, told_c, _ = coat.told
        compliant = coat.thickness * told_z * told_c / (coat.z * coat.c)
        known = {"thickness": compliant} if coat.glue else {"z": coat.z, "c": coat.c, "q": coat.q}
        values |= {f"{coat.name}.{name}": [value, 0.0] for name, value in known.items()}
    return values
