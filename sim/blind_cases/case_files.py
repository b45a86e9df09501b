"""Cases as files: a build file and recordings for who diagnoses, and a truth that only the scorer opens."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from .detectability import AbsorbedFit
from .device_under_test import AIR, BondedLayer, DeviceUnderTest
from .injected_effect import InjectedEffect
from .recording_process import SweepSpec, noisy, record
from .scenario_draw import Case, draw_case

TRUTH = "truth.json"
_CONSTANTS = ("c33D", "h33", "eps33S")
_MATTERS = 1e-3
"""Relative change of a constant of the disk from which something unseen is worth telling: a tenth of what a
micrometer leaves open."""


def make_case(folder: Path, seed: int, index: int) -> dict[str, Any]:
    """Write the files of one case to a folder of its own below `folder`; return its name and its truth."""
    case = draw_case(seed, index)
    place = folder / case.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "build.toml").write_text(_build_text(case))
    rng = np.random.default_rng(case.seed)
    files: dict[str, list[str]] = {}
    for take in case.takes:
        of_step = files.setdefault(take.step, [])
        of_step.append(f"{take.step}.csv" if not of_step else f"{take.step}-{len(of_step) + 1}.csv")
        z = noisy(record(case.hideout.specimen, case.hideout.hidden(take.step), take), take, rng)
        (place / of_step[-1]).write_text(_csv_text(take, z))
    return {"name": case.name, **_truth(case), "files": files}


def seal(folder: Path, truths: list[dict[str, Any]]) -> str:
    """Write the truth of all cases and return the SHA-256 of the file, to be published before anything is diagnosed."""
    data = json.dumps({truth["name"]: truth for truth in truths}, indent=1).encode()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / TRUTH).write_bytes(data)
    return hashlib.sha256(data).hexdigest()


def make_cases(folder: Path, seed: int, count: int) -> str:
    """Write `count` cases of a seed to `folder`/cases and their truth beside them; return the hash of the truth."""
    return seal(folder, [make_case(folder / "cases", seed, index) for index in range(count)])


def _csv_text(take: SweepSpec, z: np.ndarray[Any, Any]) -> str:
    """Return a recording in the order in which it was swept, seven digits."""
    lines = [f"# bandwidth: {take.bandwidth}", f"# oscillator_V: {take.level_V}"]
    if take.seconds:
        lines.append(f"# sweep_seconds: {take.seconds:g}")
    if take.down:
        lines.append("# direction: down")
    rows = [f"{f:.3f},{value.real:.6e},{value.imag:.6e}" for f, value in zip(take.frequency, z, strict=True)]
    rows = rows[::-1] if take.down else rows
    return "\n".join([*lines, "frequency_Hz,R_ohm,X_ohm", *rows]) + "\n"


def _build_text(case: Case) -> str:
    specimen, untold = case.hideout.specimen, case.hideout.untold
    coats = [coat for coat in specimen.coats if coat.name not in untold]
    back = '"air"' if specimen.back == AIR else f"{{ z_MRayl = {specimen.back / 1e6!r} }}"
    lines = [
        f'name = "{case.name}"\ndiameter_mm = {case.told_diameter * 1e3:.7f}\n',
        f'[[layers]]\nname = "disk"\nkind = "piezo"\nmaterial = "Pz27"\n'
        f"thickness_mm = {{ value = {specimen.told_thickness * 1e3:.7f}, u = 0.001 }}\n",
        *(_coat_text(coat) for coat in coats),
        f'[load]\nback = {back}\nfront = "air"\n',
    ]
    for step in specimen.steps:
        names = ["disk", *(coat.name for coat in specimen.coats_of(step) if coat.name not in untold)]
        lines.append(f'[[steps]]\nname = "{step}"\nlayers = {json.dumps(names)}\n')
    return "\n".join(lines)


def _coat_text(coat: BondedLayer) -> str:
    if coat.glue:
        return (
            f'[[layers]]\nname = "{coat.name}"\nkind = "elastic"\nz_MRayl = {coat.told_z / 1e6}\n'
            f"c_m_s = {coat.told_c:g}\nq = {coat.told_q:g}\nthickness_mm = {{ value = 0.009, u = 0.004 }}\n"
        )
    return (
        f'[[layers]]\nname = "{coat.name}"\nkind = "elastic"\n'
        f"z_MRayl = {{ value = {coat.told_z / 1e6}, u = {0.08 * coat.told_z / 1e6:.3f} }}\n"
        f"c_m_s = {{ value = {coat.told_c:g}, u = {0.1 * coat.told_c:g} }}\nq = {{ value = {coat.told_q:g}, u = 25 }}\n"
        f"thickness_mm = {{ value = {coat.thickness * 1e3:.7f}, u = 0.001 }}\n"
    )


def _truth(case: Case) -> dict[str, Any]:
    hides = case.kind == "absorbed"
    plants = [_planted(plant, seen.gain) for plant, seen in zip(case.hideout.plants, case.seen, strict=True)]
    verdicts = {"none": "no-mismatch", "absorbed": "no-mismatch", "outside": "unexplained"}
    return {
        "kind": case.kind,
        "verdict": verdicts.get(case.kind, "explained"),
        "findings": [] if hides else plants,
        "hidden": plants if hides else [],
        "not_decidable": [plant.effect for plant in _that_matter(case)] if hides else [],
        "constants": _constants(case.hideout.specimen),
    }


def _that_matter(case: Case) -> list[InjectedEffect]:
    """Return the plants that a constant has to pay for: one that neither shows nor moves anything is nothing."""
    true = case.hideout.specimen.disk

    def moved(seen: AbsorbedFit) -> float:
        return max(abs(getattr(seen.specimen.disk, name) / getattr(true, name) - 1) for name in _CONSTANTS)

    return [plant for plant, seen in zip(case.hideout.plants, case.seen, strict=True) if moved(seen) > _MATTERS]


def _planted(plant: InjectedEffect, gain: float) -> dict[str, Any]:
    return {
        "effect": plant.effect,
        "accept": list(plant.accept),
        "where": list(plant.where),
        "step": plant.steps[0],
        "scale": plant.scale,
        "base": dict(plant.sizes),
        "gain": gain,
    }


def _constants(specimen: DeviceUnderTest) -> dict[str, Any]:
    disk = specimen.disk
    of_disk: dict[str, complex] = {name: getattr(disk, name) for name in _CONSTANTS}
    found: dict[str, Any] = {f"disk.{name}": [value.real, value.imag] for name, value in of_disk.items()}
    for coat in specimen.coats:
        values = {"thickness": coat.thickness} if coat.glue else {"z": coat.z, "c": coat.c, "q": coat.q}
        found |= {f"{coat.name}.{name}": [value, 0.0] for name, value in values.items()}
    return found
