"""Disks of finite diameter with a glued matching layer, by general finite elements (scikit-fem): a world for diagnoses.

No code of the project's models: triangles of order four over the section in r and z, finer at the rim and at the edge
of a pocket of air, which takes the place of the glue within a radius in every odd case. Disks, losses and noise are
those of `finite_disk_world`.
"""

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from disk_skfem import VOLT
from finite_disk_world import NOISE, FeDisk, FiniteDiskCase, constants_at, drawn
from stack_skfem import FeLayer, SkfemStack


@dataclass(frozen=True)
class Solid:
    """An isotropic solid, SI units."""

    density: float
    speed: float
    """Of longitudinal waves."""
    poisson: float
    q: float

    @property
    def z(self):
        return self.density * self.speed

    def layer(self, thickness, cells):
        return FeLayer.isotropic(thickness, self.z, self.speed, self.q, self.poisson, cells)


@dataclass(frozen=True)
class GluedDiskCase:
    """Everything that makes the recordings of a disk and of the disk with a matching layer, SI units."""

    disk: FiniteDiskCase
    glue: Solid
    glue_thickness: float
    matching: Solid
    matching_thickness: float
    pocket: float
    """Radius of the pocket of air in the glue over that of the disk; 0 if there is none."""

    @property
    def build(self):
        """The build file: sizes and constants as uncertain as a laboratory knows them."""
        rng = np.random.default_rng([31, self.disk.seed])
        layers = (
            ("glue1", self.glue, self.glue_thickness, 0.25),
            ("ml1", self.matching, self.matching_thickness, 0.01),
        )
        text = ""
        for name, of, thickness, doubt in layers:
            told = thickness * (1 + doubt * rng.uniform(-1, 1))
            z, c = of.z * (1 + 0.04 * rng.uniform(-1, 1)), of.speed * (1 + 0.02 * rng.uniform(-1, 1))
            text += (
                f'[[layers]]\nname = "{name}"\nkind = "elastic"\n'
                f"thickness_mm = {{ value = {1e3 * told:.5f}, u = {1e3 * doubt * thickness:.5f} }}\n"
                f"z_MRayl = {{ value = {1e-6 * z:.4f}, u = {5e-8 * z:.4f} }}\n"
                f"c_m_s = {{ value = {c:.0f}, u = {0.03 * c:.0f} }}\n"
                f"q = {{ value = {of.q * (1 + 0.3 * rng.uniform(-1, 1)):.1f}, u = {0.3 * of.q:.1f} }}\n"
                f"poisson = {of.poisson}\n"
            )
        glued = '[[steps]]\nname = "ml1"\nlayers = ["disk", "glue1", "ml1"]\n'
        return self.disk.build.replace("[load]", text + "[load]") + glued


def drawn_glued(seed):
    """Return a case: odd numbers have a pocket of air, even ones none."""
    rng = np.random.default_rng([30, seed])
    disk = replace(drawn(seed), effect="", size={})
    glue = Solid(1150.0, float(rng.uniform(2300, 2700)), 0.36, float(rng.uniform(15, 40)))
    density, c = float(rng.uniform(1500, 2600)), float(rng.uniform(2200, 2900))
    matching = Solid(density, c, float(rng.uniform(0.3, 0.37)), float(rng.uniform(20, 60)))
    quarter = c / (4 * disk.centre) * float(rng.uniform(0.85, 1.1))
    pocket = float(rng.uniform(0.12, 0.5)) if seed % 2 else 0.0
    return GluedDiskCase(disk, glue, float(rng.uniform(8e-6, 35e-6)), matching, quarter, pocket)


class FeGluedDisk(SkfemStack):
    """The section of a case with its layer, and the disk's constants at each frequency.

    With triangles a fifth of the disk's thickness long Z would be off by nearly the noise, with an eighth by a tenth.
    """

    def __init__(self, case, per_thickness=8):
        disk, radius = case.disk, case.disk.diameter / 2
        layers = [
            FeLayer(disk.thickness, disk.density, tuple(constants_at(disk, disk.centre)), per_thickness),
            case.glue.layer(case.glue_thickness, 1),
            case.matching.layer(case.matching_thickness, 3),
        ]
        super().__init__(radius, layers, per_thickness, (1, case.pocket * radius) if case.pocket else None)
        self.case = case

    def impedance(self, frequency):
        """Return Z in ohm, shape (N,), with the constants of the disk's law of losses."""
        units = np.array([1.0] * 5 + [VOLT] * 3 + [VOLT**2] * 2)
        mass = sum(layer.density * forms[-1] for layer, forms in zip(self.layers, self.forms, strict=True))
        made = []
        for f in frequency:
            tens = [constants_at(self.case.disk, f) if layer.piezo else self.elastic(layer, f) for layer in self.layers]
            A = sum(
                w * form
                for ten, forms in zip(tens, self.forms, strict=True)
                for w, form in zip(ten * units, forms[:-1], strict=True)
                if w
            )
            A = (A - (2 * np.pi * f) ** 2 * mass).tocsr()
            made.append(1 / (2j * np.pi * f * self.driven_by_a_volt(A)))
        return np.array(made)

    def elastic(self, layer, f):
        """Return the constants of another layer: causal where the disk's losses are not the same at all frequencies."""
        own = layer.ten
        if self.case.disk.law == "constant":
            return own
        phase = np.angle(own[0])
        return np.abs(own) * (1j * f / self.case.disk.centre) ** (2 * phase / np.pi)


def written_glued(seed, folder):
    """Return the case with this number; its recordings and build are made in the folder, unless they are there."""
    case, own = drawn_glued(seed), folder / f"case-{seed:03d}"
    if not (own / "ml1.csv").exists():
        own.mkdir(parents=True, exist_ok=True)
        rng, f = np.random.default_rng([32, seed]), case.disk.frequency
        (own / "build.toml").write_text(case.build)
        (own / "truth.json").write_text(json.dumps(asdict(case), indent=1))
        for name, solved in (("disk", FeDisk(case.disk)), ("ml1", FeGluedDisk(case))):
            Z = solved.impedance(f)
            Z = Z * np.exp(NOISE * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))
            rows = np.column_stack([f, Z.real, Z.imag])
            header = "frequency_Hz,R_ohm,X_ohm"
            np.savetxt(own / f"{name}.csv", rows, "%.9e", ",", header=header, comments="")
    return case
