"""Disks of finite diameter with one further effect, by general finite elements (scikit-fem): a world for diagnoses.

No formula and no code of the project's models: elements of order seven over the section in r and z, a dot of solder, a
dead layer and printed electrodes as parts of the mesh, leads and cables as circuits, and losses by three laws. Every
recording is a function of its number.
"""

import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import splu
from skfem import Basis, ElementQuadP, MeshQuad

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from disk_skfem import VOLT, forms_of

EPS0 = 8.8541878e-12
NAMES = ("c11E", "c12E", "c13E", "c33E", "c44E", "e31", "e33", "e15", "eps11S", "eps33S")
CERAMICS = {
    "Pz27": (147e9, 105e9, 93.7e9, 113e9, 23.0e9, -3.09, 16.0, 11.64, 1130, 914, 7700),
    "PZT-5A": (121e9, 75.4e9, 75.2e9, 111e9, 21.1e9, -5.4, 15.8, 12.3, 916, 830, 7750),
    "PZT-4": (139e9, 77.8e9, 74.3e9, 115e9, 25.6e9, -5.2, 15.1, 12.7, 730, 635, 7500),
    "PZT-5H": (126e9, 79.5e9, 84.1e9, 117e9, 23.0e9, -6.5, 23.3, 17.0, 1700, 1470, 7500),
}
"""Published constants (Ferroperm; Berlincourt et al.): Pa, C/m2, relative permittivities, kg/m3."""
SOLDER = {"density": 8500.0, "stiffness": 40e9, "poisson": 0.36, "loss": 0.01}
SILVER = {"density": 8000.0, "stiffness": 40e9, "poisson": 0.37, "loss": 0.02}
"""A printed and fired paste, with pores."""
LAWS = ("causal", "constant", "power")
EFFECTS = ("lead-inductance", "stray-capacitance", "local-mass", "cable", "series-resistance")
LATER = ("lead-inductance", "surface-layer", "cable", "electrode-mass", "local-mass")
"""Effects of the cases from number 400 on."""
NEAR_DOT = (0.06, 0.01)
"""Ends of elements beside the edge of a dot of solder, over the thickness of the disk."""
NOISE = 2e-4
POINTS = 401


@dataclass(frozen=True)
class FiniteDiskCase:
    """Everything that makes a recording, SI units."""

    seed: int
    material: str
    diameter: float
    thickness: float
    density: float
    constants: tuple[float, ...]
    """Real parts at the thickness resonance."""
    elastic_loss: float
    dielectric_loss: float
    law: str
    exponent: float
    effect: str
    """Empty if there is none."""
    size: dict[str, float] = field(default_factory=dict)

    @property
    def centre(self):
        """Thickness resonance in Hz, roughly."""
        c33, e33, eps = (self.constants[k] for k in (3, 6, 9))
        return np.sqrt((c33 + e33**2 / eps) / self.density) / (2 * self.thickness)

    @property
    def frequency(self):
        return np.linspace(0.45 * self.centre, 1.35 * self.centre, POINTS)

    @property
    def build(self):
        return (
            f'name = "disk-{self.seed}"\n'
            f"diameter_mm = {1e3 * self.diameter:.6f}\n"
            f'[[layers]]\nname = "disk"\nkind = "piezo"\nmaterial = "{self.material}"\n'
            f"thickness_mm = {{ value = {1e3 * self.thickness:.6f}, u = 0.001 }}\n"
            f"density_kg_m3 = {{ value = {CERAMICS[self.material][-1]}, u = {0.005 * self.density:.0f} }}\n"
            '[load]\nback = "air"\nfront = "air"\n'
            '[[steps]]\nname = "disk"\nlayers = ["disk"]\n'
        )


def drawn(seed):
    """Return a case: odd numbers have the next of EFFECTS or LATER, even ones none; a third each of LAWS."""
    rng = np.random.default_rng([21, seed])
    material = str(rng.choice(list(CERAMICS)))
    *ten, density = CERAMICS[material]
    off = 1 + rng.uniform(0.03, 0.08, 10) * rng.choice([-1, 1], 10)
    real = np.array(ten) * np.array([1.0] * 8 + [EPS0] * 2) * off
    thickness = 1e-3 * rng.uniform(0.8, 2.2)
    diameter = thickness * rng.uniform(7, 18)
    kinds = EFFECTS if seed < 400 else LATER
    effect = kinds[seed // 2 % len(kinds)] if seed % 2 else ""
    law = LAWS[seed // 2 % len(LAWS)]
    case = FiniteDiskCase(
        seed,
        material,
        round(float(diameter), 7),
        round(float(thickness), 8),
        float(density * (1 + 0.005 * rng.normal())),
        tuple(real.tolist()),
        float(np.exp(rng.uniform(np.log(1 / 300), np.log(1 / 60)))),
        float(rng.uniform(0.003, 0.02)),
        law,
        float(rng.choice([-1, 1]) * rng.uniform(0.3, 0.8)) if law == "power" else 0.0,
        effect,
    )
    return FiniteDiskCase(**{**asdict(case), "size": _size(case, rng)})


def _size(case, rng):
    """Return the size of a case's effect; reactances are taken relative to that of the disk at its resonance."""
    C = case.constants[9] * np.pi * case.diameter**2 / 4 / case.thickness
    w = 2 * np.pi * case.centre
    part = float(np.exp(rng.uniform(np.log(0.02), np.log(0.1))))
    if case.effect == "lead-inductance":
        return {"inductance": part / (w**2 * C), "resistance": 0.02}
    if case.effect == "stray-capacitance":
        return {"capacitance": part * C}
    if case.effect == "series-resistance":
        return {"resistance": 0.5 * part / (w * C)}
    if case.effect == "cable":
        delay = float(rng.uniform(0.5, 2.0)) / 2e8  # 0.5 to 2 m of coaxial line
        return {"delay": delay, "impedance": 50.0, "loss_per_root_MHz": 5e-3}
    if case.effect == "local-mass":
        return {"radius": float(rng.uniform(0.06, 0.15)) * case.diameter / 2, "height": 0.25 * case.thickness}
    if case.effect == "surface-layer":
        return {"depth": float(np.exp(rng.uniform(np.log(4e-6), np.log(3e-5))))}
    if case.effect == "electrode-mass":
        return {"height": float(rng.uniform(4e-6, 1.5e-5)), "other": float(rng.uniform(0.6, 1.0))}
    return {}


class FeDisk:
    """The section of a disk, with a dot of solder, a dead layer or electrodes if it has them.

    Quadrangles half a thickness long, of order 7; triangles of order 4, a fifth as long, were off by more than the
    noise, which moved constants by up to 6 u. Of a disk that is alike above and below its middle, the upper half.
    """

    def __init__(self, case, order=7, per_thickness=2):
        a, t, size = case.diameter / 2, case.thickness, case.size
        self.alike = case.effect not in ("local-mass", "surface-layer", "electrode-mass")
        ground = t / 2 if self.alike else 0.0
        cells = int(np.ceil(a / t * per_thickness))
        r = np.linspace(0, a, cells + 1)
        z = np.linspace(0, t, per_thickness + 1)
        edge, low, high = size.get("radius", 0.0), ground, t
        if case.effect == "local-mass":
            # waves in solder are half as long as in the ceramic, and stress is singular at its edge
            near, within = np.array(NEAR_DOT) * t, np.linspace(0, edge, int(np.ceil(4 * edge / t)) + 1)
            r = np.sort(np.concatenate([within, edge - near, edge + near, r[r > edge + 0.3 * a / cells]]))
            z = np.sort(np.concatenate([z, t - near, t + near]))
            high = t + size["height"]
        elif case.effect == "electrode-mass":
            low, high = -size["height"] * size["other"], t + size["height"]
        live = t - size.get("depth", 0.0)
        mesh = MeshQuad.init_tensor(r, np.unique([low, *z[z >= ground], live, high]))
        middle = mesh.p[:, mesh.t].mean(axis=1)
        if case.effect == "local-mass":
            mesh = mesh.restrict(np.flatnonzero((middle[1] < t) | (middle[0] < edge)))
            middle = mesh.p[:, mesh.t].mean(axis=1)
        element, inside = ElementQuadP(order), (middle[1] > 0) & (middle[1] < t)
        kinds = {"disk": inside & (middle[1] < live), "dead": inside & (middle[1] > live), "metal": ~inside}
        self.forms = {
            kind: forms_of(Basis(mesh, element, elements=np.flatnonzero(own), intorder=2 * order + 2))
            for kind, own in kinds.items()
            if own.any()
        }
        whole = Basis(mesh, element, intorder=2 * order + 2)
        x, n = _places(whole), whole.N
        every, tiny = np.arange(n), 1e-9 * t
        held = np.abs(x[1] - ground) < tiny if self.alike else np.zeros(n, dtype=bool)
        inner = (x[1] > ground + tiny) & (x[1] < t - tiny)
        self.free = np.concatenate([every[x[0] > tiny], n + every[~held], 2 * n + every[inner]])
        corners = whole.nodal_dofs.ravel()  # all else is zero where a potential is the same everywhere
        self.driven = 2 * n + corners[x[1, corners] > t - tiny]  # metal is part of the electrode that it is on
        self.case = case

    def impedance(self, frequency):
        """Return Z in ohm, shape (N,), without what is outside of the disk."""
        units = np.array([1.0] * 5 + [VOLT] * 3 + [VOLT**2] * 2)
        metal = SOLDER if self.case.effect == "local-mass" else SILVER
        made = []
        for f in frequency:
            live = constants_at(self.case, f)
            of = {"disk": live, "dead": unpoled_of(live), "metal": _isotropic(metal)}
            density = {"disk": self.case.density, "dead": self.case.density, "metal": metal["density"]}
            A = sum(
                w * form
                for kind, forms in self.forms.items()
                for w, form in zip(of[kind] * units, forms, strict=False)
                if w
            )
            A = A - (2 * np.pi * f) ** 2 * sum(density[kind] * forms[-1] for kind, forms in self.forms.items())
            A = A.tocsr()
            x = np.zeros(A.shape[0], complex)
            x[self.driven] = (0.5 if self.alike else 1.0) / VOLT
            right = -(A @ x)[self.free]
            x[self.free] = splu(A[self.free][:, self.free].tocsc()).solve(right)
            halves = 2 if self.alike else 1
            made.append(1 / (2j * np.pi * f * -2 * np.pi * halves * (x @ (A @ x))))
        return np.array(made)


def _places(basis):
    """Return where the unknowns of a field are, those of edges and cells in their middle, m, shape (2, N)."""
    mesh, x = basis.mesh, np.empty((2, basis.N))
    x[:, basis.nodal_dofs] = mesh.p[:, None]
    x[:, basis.facet_dofs] = mesh.p[:, mesh.facets].mean(axis=1)[:, None]
    x[:, basis.interior_dofs] = mesh.p[:, mesh.t].mean(axis=1)[:, None]
    return x


def _isotropic(of):
    E, nu = of["stiffness"] * (1 + 1j * of["loss"]), of["poisson"]
    first, second = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    return np.array([first + 2 * second, first, first, first + 2 * second, second, 0, 0, 0, 0, 0])


def unpoled_of(live):
    """Return the constants of the same ceramic with its grains in all directions, by Voigt's mean of cE and cD."""
    c11, c12, c13, c33, c44, e31, e33, e15, eps11, eps33 = live
    c11, c12, c13, c33, c44 = np.array([c11, c12, c13, c33, c44]) + 0.5 * np.array(
        [e31**2 / eps33, e31**2 / eps33, e31 * e33 / eps33, e33**2 / eps33, e15**2 / eps11]
    )
    bulk = (2 * c11 + c33 + 2 * c12 + 4 * c13) / 9
    shear = (2 * c11 + c33 - c12 - 2 * c13 + 6 * c44 + 3 * (c11 - c12) / 2) / 15
    lame = bulk - 2 * shear / 3
    eps = (2 * eps11 + eps33) / 3
    return np.array([lame + 2 * shear, lame, lame, lame + 2 * shear, shear, 0, 0, 0, eps, eps])


def constants_at(case, f):
    """Return the ten complex constants at a frequency in Hz, shape (10,)."""
    x = f / case.centre
    loss = np.array([case.elastic_loss] * 5 + [0.0] * 3 + [-case.dielectric_loss] * 2)
    real = np.array(case.constants)
    if case.law == "constant":
        return real * (1 + 1j * loss)
    if case.law == "causal":
        return (
            real
            * np.abs(1 + 1j * loss)
            * (1j * x) ** (2 / np.pi * np.arctan(loss))
            / (1j ** (2 / np.pi * np.arctan(loss)))
            * np.exp(1j * np.arctan(loss))
        )
    n = np.array([case.exponent] * 5 + [0.0] * 5)
    with np.errstate(invalid="ignore"):
        power = np.where(n == 0, 2 / np.pi * np.log(x), (x**n - 1) / np.tan(np.where(n == 0, 1, n) * np.pi / 2))
    return real * (1 + loss * (power + 1j * x**n))


def recorded(case, Z):
    """Return the impedance as recorded: with what is between disk and analyzer, and noise."""
    f = case.frequency
    w, size = 2 * np.pi * f, case.size
    if case.effect == "lead-inductance":
        Z = Z + size["resistance"] + 1j * w * size["inductance"]
    elif case.effect == "stray-capacitance":
        Z = Z / (1 + 1j * w * size["capacitance"] * Z)
    elif case.effect == "series-resistance":
        Z = Z + size["resistance"]
    elif case.effect == "cable":
        gamma = 1j * w * size["delay"] + size["loss_per_root_MHz"] * np.sqrt(f / 1e6) * (1 + 1j)
        tanh, Z0 = np.tanh(gamma), size["impedance"]
        Z = Z0 * (Z + Z0 * tanh) / (Z0 + Z * tanh)
    rng = np.random.default_rng([22, case.seed])
    return Z * np.exp(NOISE * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)))


def written(seed, folder):
    """Return the case with this number; its recording and build are made in the folder, unless they are there."""
    case, own = drawn(seed), folder / f"case-{seed:03d}"
    if not (own / "disk.csv").exists():
        own.mkdir(parents=True, exist_ok=True)
        f, Z = case.frequency, recorded(case, FeDisk(case).impedance(case.frequency))
        (own / "build.toml").write_text(case.build)
        (own / "truth.json").write_text(json.dumps(asdict(case), indent=1))
        table = np.column_stack([f, Z.real, Z.imag])
        np.savetxt(own / "disk.csv", table, "%.9e", ",", header="frequency_Hz,R_ohm,X_ohm", comments="")
    return case
