"""Cases of the lab world as files: build file and recordings for the diagnosis, truth for the judge only."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..waves import Complexes
from .devices.specimen import AIR, LabDevice, LabLayer
from .draw import LabSession, draw_case
from .planting.plant import Plant
from .recording import LabSweep, shown


def make_case(folder: Path, seed: int, index: int) -> dict[str, Any]:
    """Write the files of one case to a folder of its own below `folder`; return its name and its truth."""
    case = draw_case(seed, index)
    place = folder / case.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "build.toml").write_text(build_text(case), encoding="utf-8")
    rng = np.random.default_rng(case.seed)
    files: dict[str, list[str]] = {}
    for sweep in case.sweeps:
        of_step = files.setdefault(sweep.step, [])
        of_step.append(f"{sweep.step}.csv" if not of_step else f"{sweep.step}-{len(of_step) + 1}.csv")
        (place / of_step[-1]).write_text(
            _csv_text(sweep, measured(case, sweep, rng), case.analyzer.bandwidth), encoding="utf-8"
        )
    return {"name": case.name, **truth(case), "files": files}


def measured(case: LabSession, sweep: LabSweep, rng: np.random.Generator) -> Complexes:
    """Return one recording of the analyzer: ohm, shape (N,), by rising frequency."""
    world = case.scenario.world(sweep.step)
    z = shown(world.specimen, world.flaws, sweep, world.fixture)
    return case.analyzer.noisy(z * case.analyzer.error(sweep.frequency, z), rng)


def _csv_text(sweep: LabSweep, z: Complexes, bandwidth: int) -> str:
    """Return a recording in the order of the sweep, with seven digits."""
    lines = [f"# bandwidth: {bandwidth}", f"# oscillator_V: {sweep.level_V}"]
    if sweep.seconds:
        lines.append(f"# sweep_seconds: {sweep.seconds:g}")
    if sweep.down:
        lines.append("# direction: down")
    rows = [f"{f:.3f},{value.real:.6e},{value.imag:.6e}" for f, value in zip(sweep.frequency, z, strict=True)]
    rows = rows[::-1] if sweep.down else rows
    return "\n".join([*lines, "frequency_Hz,R_ohm,X_ohm", *rows]) + "\n"


def build_text(case: LabSession) -> str:
    """Return the build file, which omits every hidden effect."""
    specimen, untold = case.scenario.bare.specimen, case.scenario.untold
    layers = [layer for layer in specimen.layers if layer.name not in untold]
    back = '"air"' if specimen.back == AIR else f"{{ z_MRayl = {specimen.back / 1e6!r} }}"
    told = specimen.told
    diameter = f"{told.diameter * 1e3:.6f}"
    if told.diameter_u:
        diameter = f"{{ value = {diameter}, u = {told.diameter_u * 1e3:.6f} }}"
    lines = [
        f'name = "{case.name}"\ndiameter_mm = {diameter}\n',
        _ceramic_text(specimen),
        *(_layer_text(layer) for layer in layers),
        f'[load]\nback = {back}\nfront = "air"\n',
    ]
    for step in specimen.steps:
        names = ["disk", *(layer.name for layer in specimen.layers_of(step) if layer.name not in untold)]
        lines.append(f'[[steps]]\nname = "{step}"\nlayers = {json.dumps(names)}\n')
    return "\n".join(lines)


def _ceramic_text(specimen: LabDevice) -> str:
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


def _layer_text(layer: LabLayer) -> str:
    t, z, c, q = layer.told
    u_t, u_z, u_c, u_q = layer.u

    def quantity(value: float, u: float) -> str:
        return f"{{ value = {value:.6g}, u = {u:.4g} }}" if u else f"{value:.6g}"

    return (
        f'[[layers]]\nname = "{layer.name}"\nkind = "elastic"\nz_MRayl = {quantity(z / 1e6, u_z / 1e6)}\n'
        f"c_m_s = {quantity(c, u_c)}\nq = {quantity(q, u_q)}\nthickness_mm = {quantity(t * 1e3, u_t * 1e3)}\n"
    )


def truth(case: LabSession) -> dict[str, Any]:
    """Return the truth for the judge: findings in the order of their effect on ln Z, and further accepted findings."""
    plants = case.scenario.plants
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
        "constants": constants(case.scenario.bare.specimen),
        "noise": {"relative": case.analyzer.noise, "colour": case.analyzer.colour},
    }


def _entry(case: LabSession, index: int) -> dict[str, Any]:
    plant: Plant = case.scenario.plants[index]
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
    step = case.scenario.bare.specimen.steps[0]
    return [
        {"effect": "analyzer-error", "where": ["sweep", "terminals"], "step": step},
        {"effect": "fixture-residual", "where": ["terminals"], "step": step},
    ]


def constants(specimen: LabDevice) -> dict[str, list[float]]:
    """Return the true constants, real and imaginary part, at the ceramic's own resonance.

    A glue acts by its compliance. If the build file states a wrong stiffness as exact, the thickness to be found is the
    one that gives the true compliance with the stated stiffness.
    """
    ceramic = specimen.ceramic
    found = {f"disk.{name}": getattr(ceramic, name) for name in ("c33D", "h33", "eps33S")}
    values = {name: [complex(one).real, complex(one).imag] for name, one in found.items()}
    for layer in specimen.layers:
        _, told_z, told_c, _ = layer.told
        compliant = layer.thickness * told_z * told_c / (layer.z * layer.c)
        known = {"thickness": compliant} if layer.glue else {"z": layer.z, "c": layer.c, "q": layer.q}
        values |= {f"{layer.name}.{name}": [value, 0.0] for name, value in known.items()}
    return values
