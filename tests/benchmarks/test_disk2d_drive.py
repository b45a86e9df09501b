"""The two radial modes of the disk of 35 by 2 mm with ten constants and softening by the strain, fitted together.

A hypothesis: the level at which the recording was made is not stated. Compliances rise in proportion to the strain,
with the loss of a Rayleigh loop (as `models/effects/drive_nonlinearity.py` has it in one dimension); piezoelectric
constants d and free permittivities stay. The strain is that of the recording, from what current it has beyond the
clamped disk.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq
from scipy.special import j0, j1

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.bare_disk import bare_disk
from pzctl.fitters.disk.two_d.disk2d import Disk2DFitter
from pzctl.fitters.disk.two_d.reduced_disk_cache import reduced_disk
from pzctl.fitters.disk.two_d.tensor_coordinates import COORDINATES, tensor_block
from pzctl.fitters.disk.two_d.tensor_start import tensor_priors
from pzctl.fitters.engine.descent import descend
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.parameters.coordinates import Coordinates, positive
from pzctl.fitters.engine.recording import Recording
from pzctl.fitters.interface import FitTask
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.materials import find
from pzctl.models.stack import CausalConstantQ

from .test_disk2d_figures import THICKNESS, build

pytestmark = pytest.mark.timeout(1800)
DENSITY = 7743.0
LOOP = 1 - 4j / (3 * np.pi)
MOST = 4e-3  # softening up to which the curves between nodes are accurate to 1e-5
NODES = MOST * (1 - np.cos(np.pi * (np.arange(4) + 0.5) / 4)) / 2
LEVEL = 3e-3  # misfit that counts as noise


def softer(tensor, s):
    """Return the ceramic whose compliances are 1 + s times as large, with a complex s."""
    c = {name: complex(getattr(tensor, name)) for name in CONSTANTS}
    free = c["eps11S"] + c["e15"] ** 2 / c["c44E"], tensor.radial.eps33T
    made = {name: value / (1 + s) for name, value in c.items() if not name.startswith("eps")}
    for name, T in zip(("eps11S", "eps33S"), free, strict=True):
        made[name] = T - (T - c[name]) / (1 + s)
    return Tensor6mm(*(made[name] for name in CONSTANTS))


@dataclass(frozen=True)
class SoftDisk:
    """A disk that softens by the strain it has at each frequency. Satisfies `Model`.

    The reduced disk needs constants that are smooth over an octave, so curves are computed for evenly softer disks and
    interpolated at each frequency.
    """

    disk: Disk2D
    softening: dict[str, float]
    strain: dict[str, tuple[np.ndarray, np.ndarray]]  # frequency, and strain over the largest, by softening

    def parameters(self):
        return {**self.disk.parameters(), **self.softening}

    def replace(self, values):
        own = {name: value for name, value in values.items() if name in self.softening}
        rest = {name: value for name, value in values.items() if name not in own}
        return replace(self, disk=self.disk.replace(rest), softening={**self.softening, **own})

    def between(self, frequency, curves, slope=False):
        """Return `curves`, shape (4, N, ...), interpolated to the softening at each frequency."""
        at = sum(self.softening[name] * np.interp(frequency, *own) for name, own in self.strain.items())
        lagrange = BarycentricInterpolator(NODES, np.eye(NODES.size))
        weights = lagrange.derivative(at) if slope else lagrange(at)
        return np.einsum("nk,kn...->n...", weights, curves)

    def softened(self):
        return [replace(self.disk, constants=softer(self.disk.constants, s * LOOP)) for s in NODES]

    def impedance(self, frequency):
        return np.exp(self.between(frequency, unwound([each.impedance(frequency) for each in self.softened()])))

    def jacobian(self, frequency, names):
        own = [name for name in names if name not in self.softening]
        assert own == [f"disk.{name}.{part}" for name in CONSTANTS for part in ("re", "im")]
        made = [each.jacobian(frequency, own) for each in self.softened()]
        logs = unwound([Z for Z, _ in made])
        by = np.array([J.T @ by_hard(self.disk.constants, s * LOOP) for s, (_, J) in zip(NODES, made, strict=True)])
        rows = [*self.between(frequency, by).T]
        slope = self.between(frequency, logs, slope=True)
        rows += [slope * np.interp(frequency, *self.strain[name]) for name in names if name in self.softening]
        return np.exp(self.between(frequency, logs)), np.array(rows)


def by_hard(tensor, s):
    """Return the derivatives of the real and imaginary parts of `softer` by those of `tensor`, shape (20, 20)."""
    c = np.array([complex(getattr(tensor, name)) for name in CONSTANTS])

    def parts(constants):
        soft = softer(Tensor6mm(*constants), s)
        return np.array([complex(getattr(soft, name)) for name in CONSTANTS]).view(float)

    columns = []
    for k, size in enumerate(1e-6 * np.abs(c)):
        for direction in (1.0, 1j):
            step = np.where(np.arange(c.size) == k, size * direction, 0.0)
            columns.append((parts(c + step) - parts(c - step)) / (2 * size))
    return np.column_stack(columns)


def unwound(curves):
    """Return ln Z of neighbouring curves without jumps of 2 pi between them."""
    return np.log(curves[0]) + np.log(np.array(curves) / curves[0])


def local_over_mean(sigma, low, high):
    """Return the softening of a radial mode of a thin disk, relative to that of its mean strain over the area.

    Stiffness falls in proportion to the local strain, weighed by local energy; `low`, `high`: about the mode's root.
    """
    eta = brentq(lambda x: x * j0(x) / j1(x) - 1 + sigma, low, high)
    r = np.linspace(1e-4, 1, 4001)
    around = j1(eta * r) / r
    along = eta * j0(eta * r) - around
    energy = along**2 + around**2 + 2 * sigma * along * around
    return np.sum(energy**1.5 * r) / np.sum(energy * r) / abs(2 * around[-1])


def per_part(ratio):
    return 100 * np.sqrt(np.mean(np.abs(ratio) ** 2) / 2)


def test_ten_constants_and_softening_by_the_strain_of_both_radial_modes_together(recordings):
    sweeps = tuple(read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2))
    nominal = Tensor6mm(*(find("PZT-5A").values[name].value for name in CONSTANTS))
    given = build(35e-3, nominal, DENSITY)
    task = FitTask(given, {"disk": sweeps})
    result = Disk2DFitter().fit(task)
    tensor = Tensor6mm(*(complex(c.re, c.im) for c in (result.constants[f"disk.{name}"] for name in CONSTANTS)))
    low, high = sweeps[0].frequency[0], sweeps[1].frequency[-1]
    reduced = reduced_disk(17.5, lambda _: None)[1]
    disk = Disk2D("disk", tensor, given.area.re, THICKNESS, DENSITY, reduced, CausalConstantQ(np.sqrt(low * high)))
    priors = tensor_priors(bare_disk(task, "disk2d", round_one=True, frees=True))
    f, Z = (np.concatenate([getattr(s, part) for s in sweeps]) for part in ("frequency", "impedance"))
    first = f <= sweeps[0].frequency[-1]

    def fitted(model):
        """Return the residual of each mode and of both in each part of ln Z, in per cent, and the model."""
        blocks = (tensor_block("disk"), *(positive(name) for name in model.parameters() if name.startswith("soft")))
        names = (*(f"disk.{name}" for name in COORDINATES), *(name for name in model.parameters() if "soft" in name))
        coordinates = Coordinates(blocks, model.parameters(), names)
        parts = [Recording("disk", s, model, np.full(s.frequency.size, LEVEL)) for s in sweeps]
        last = descend(Objective(parts, coordinates, priors), coordinates.x, 1e-6, 150)
        found = model.replace(coordinates.forward(last.x)[0])
        ratio = np.log(found.impedance(f) / Z)
        return [per_part(ratio[first]), per_part(ratio[~first]), per_part(ratio)], found, last

    made = {"no softening": fitted(disk)}
    print(f"\nno softening: {np.round(made['no softening'][0], 3)} % {made['no softening'][2].evaluations}")
    one, two = (local_over_mean(tensor.radial.sigma_p.real, *about) for about in ((1.8, 2.4), (5.0, 5.6)))
    print(f"softening by a current, second mode over first: {two / one:.2f} by the shapes of a thin disk")
    for source in (0.0, 25.0):
        motional = np.abs(1 / (2j * np.pi * f * Z) - tensor.radial.eps33p * disk.area / THICKNESS)
        strain = motional * np.abs(Z / (Z + source))
        for modes in ((first | ~first,), (first, ~first)):
            wheres = {
                f"soft{k}": (f, np.where(where, strain / strain[where].max(), 0.0)) for k, where in enumerate(modes, 1)
            }
            soft = SoftDisk(disk, dict.fromkeys(wheres, 5e-4), wheres)
            left, found, last = made[f"{source:g} ohm, {len(modes)}"] = fitted(soft)
            told = 1e3 * np.array([*found.softening.values()])
            far = [getattr(found.disk.constants, name).real / getattr(tensor, name).real - 1 for name in CONSTANTS]
            print(
                f"source of {source:g} ohm, {len(modes)} number(s): {np.round(left, 3)} %, softest {np.round(told, 3)} "
                f"permille; constants moved by up to {100 * np.abs(far).max():.1f} %; {last.evaluations} evaluations",
                flush=True,
            )
        per_current = told / np.array([strain[where].max() for where in modes])
        print(f"softening by a current, second mode over first: {per_current[1] / per_current[0]:.2f} as fitted")
    best = min(left[2] for left, _, _ in made.values())
    assert best < 0.75 * made["no softening"][0][2]
    assert all(0 < s < MOST for _, found, _ in list(made.values())[1:] for s in found.softening.values())
