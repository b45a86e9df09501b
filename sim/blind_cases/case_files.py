"""Cases as files: a build file and recordings for the diagnosis, and a truth that only the scorer opens."""

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
_BIAS = 1e-3
"""An undetectable effect must be listed if it changes a constant of the disk by this fraction or more: a tenth of the
uncertainty that a micrometer leaves."""


def make_case(folder: Path, seed: int, index: int) -> dict[str, Any]:
    """Write the files of case `index` of a seed as `write_case` does; return its name and its truth."""
    return write_case(folder, draw_case(seed, index))


def write_case(folder: Path, case: Case) -> dict[str, Any]:
    """Write the files of one case into its own folder below `folder`; return its name and its truth."""
    case_folder = folder / case.name
    case_folder.mkdir(parents=True, exist_ok=True)
    (case_folder / "build.toml").write_text(_build_text(case), encoding="utf-8")
    rng = np.random.default_rng(case.seed)
    files: dict[str, list[str]] = {}
    for sweep in case.sweeps:
        names = files.setdefault(sweep.step, [])
        names.append(f"{sweep.step}.csv" if not names else f"{sweep.step}-{len(names) + 1}.csv")
        z = noisy(record(case.scenario.device, case.scenario.hidden(sweep.step), sweep), sweep, rng)
        (case_folder / names[-1]).write_text(_csv_text(sweep, z), encoding="utf-8")
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


def _csv_text(sweep: SweepSpec, z: np.ndarray[Any, Any]) -> str:
    """Return a recording with seven digits, its points in the order of the sweep."""
    lines = [f"# bandwidth: {sweep.bandwidth}", f"# oscillator_V: {sweep.level_V}"]
    if sweep.seconds:
        lines.append(f"# sweep_seconds: {sweep.seconds:g}")
    if sweep.down:
        lines.append("# direction: down")
    rows = [f"{f:.3f},{value.real:.6e},{value.imag:.6e}" for f, value in zip(sweep.frequency, z, strict=True)]
    rows = rows[::-1] if sweep.down else rows
    return "\n".join([*lines, "frequency_Hz,R_ohm,X_ohm", *rows]) + "\n"


def _build_text(case: Case) -> str:
    device, omitted = case.scenario.device, case.scenario.omitted
    layers = [layer for layer in device.layers if layer.name not in omitted]
    back = '"air"' if device.back == AIR else f"{{ z_MRayl = {device.back / 1e6!r} }}"
    lines = [
        f'name = "{case.name}"\ndiameter_mm = {case.stated_diameter * 1e3:.7f}\n',
        f'[[layers]]\nname = "disk"\nkind = "piezo"\nmaterial = "Pz27"\n'
        f"thickness_mm = {{ value = {device.stated_thickness * 1e3:.7f}, u = 0.001 }}\n",
        *(_layer_text(layer) for layer in layers),
        f'[load]\nback = {back}\nfront = "air"\n',
    ]
    for step in device.steps:
        names = ["disk", *(layer.name for layer in device.layers_of(step) if layer.name not in omitted)]
        lines.append(f'[[steps]]\nname = "{step}"\nlayers = {json.dumps(names)}\n')
    return "\n".join(lines)


def _layer_text(layer: BondedLayer) -> str:
    if layer.glue:
        return (
            f'[[layers]]\nname = "{layer.name}"\nkind = "elastic"\nz_MRayl = {layer.stated_z / 1e6}\n'
            f"c_m_s = {layer.stated_c:g}\nq = {layer.stated_q:g}\nthickness_mm = {{ value = 0.009, u = 0.004 }}\n"
        )
    return (
        f'[[layers]]\nname = "{layer.name}"\nkind = "elastic"\n'
        f"z_MRayl = {{ value = {layer.stated_z / 1e6}, u = {0.08 * layer.stated_z / 1e6:.3f} }}\n"
        f"c_m_s = {{ value = {layer.stated_c:g}, u = {0.1 * layer.stated_c:g} }}\n"
        f"q = {{ value = {layer.stated_q:g}, u = 25 }}\n"
        f"thickness_mm = {{ value = {layer.thickness * 1e3:.7f}, u = 0.001 }}\n"
    )


def _truth(case: Case) -> dict[str, Any]:
    absorbed = case.kind == "absorbed"
    pairs = zip(case.scenario.effects, case.absorbed_fits, strict=True)
    effects = [_effect_truth(effect, fit.gain) for effect, fit in pairs]
    verdicts = {"none": "no-mismatch", "absorbed": "no-mismatch", "outside": "unexplained"}
    return {
        "kind": case.kind,
        "verdict": verdicts.get(case.kind, "explained"),
        "findings": [] if absorbed else effects,
        "hidden": effects if absorbed else [],
        "not_decidable": [effect.name for effect in _biasing_effects(case)] if absorbed else [],
        "constants": _constants(case.scenario.device),
    }


def _biasing_effects(case: Case) -> list[InjectedEffect]:
    """Return the effects that bias a constant; an undetectable effect without bias need not be listed."""
    true = case.scenario.device.disk

    def bias(fit: AbsorbedFit) -> float:
        return max(abs(getattr(fit.device.disk, name) / getattr(true, name) - 1) for name in _CONSTANTS)

    return [effect for effect, fit in zip(case.scenario.effects, case.absorbed_fits, strict=True) if bias(fit) > _BIAS]


def _effect_truth(effect: InjectedEffect, gain: float) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "accept": list(effect.accept),
        "where": list(effect.where),
        "step": effect.steps[0],
        "scale": effect.scale,
        "base": dict(effect.sizes),
        "gain": gain,
    }


def _constants(device: DeviceUnderTest) -> dict[str, Any]:
    disk = device.disk
    disk_values: dict[str, complex] = {name: getattr(disk, name) for name in _CONSTANTS}
    constants: dict[str, Any] = {f"disk.{name}": [value.real, value.imag] for name, value in disk_values.items()}
    for layer in device.layers:
        values = {"thickness": layer.thickness} if layer.glue else {"z": layer.z, "c": layer.c, "q": layer.q}
        constants |= {f"{layer.name}.{name}": [value, 0.0] for name, value in values.items()}
    return constants
