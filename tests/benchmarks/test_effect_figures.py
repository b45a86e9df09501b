"""How much of each effect survives a refit of the six constants, compared with our notes; run by `make bench`.

A disk of Pz27, 10 mm x 0.5 mm: `rms` is that of the real and imaginary parts of d ln Z in 3.2-5.6 MHz; `surv.` the part
of it that c33D, h33 and eps33S cannot imitate, there (T1) and in 1.5-15 MHz (TW). The notes are to first order, so the
electrodes here are a thousandth of theirs. Our model includes the reactance of the skin effect (rms x sqrt 2), and 25
ohm between oscillator and device, which reduce the drive at the resonance: softening is hidden in one sweep.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from pzctl.models.effects import Conditions, Device, find_effect
from pzctl.models.materials import find
from pzctl.models.stack import VACUUM, Piezo, Stack

T1, TW = np.linspace(3.2e6, 5.6e6, 801), np.linspace(1.5e6, 15e6, 1601)
FREE = [f"disk.{constant}.{part}" for constant in ("c33D", "h33", "eps33S") for part in ("re", "im")]

BLOB = {"fraction": 0.02, "mass": 1.4}
HEAVY = {"mass": 5e-5}
MODE = {"strength": 3e-3, "q": 80.0}
ROWS = (  # our notes: what, effect, place, size, rms in T1 (%), surv. in T1 and TW (%)
    ("series L 30 nH", [("lead-inductance", "terminals", {"inductance": 30e-9})], 4.5, 14, 62),
    ("series R 0.3 ohm", [("series-resistance", "terminals", {"resistance": 0.3})], 1.8, 7, 41),
    ("skin R 0.1 ohm", [("series-resistance", "terminals", {"skin": 0.1})], 1.2, 10, 54),
    ("stray C 2 pF", [("stray-capacitance", "terminals", {"capacitance": 2e-12})], 0.3, 0, 58),
    ("shunt G 2 uS", [("leakage", "terminals", {"conductance": 2e-6})], 0.01, 5, 73),
    ("electrodes 50 mg/m2", [("electrode-mass", f"face:{side}", HEAVY) for side in ("back", "front")], 0.07, 0.2, 0.2),
    ("water one face", [("face-load", "face:front", {"resistance": 1.48e6})], 28, 26, 44),
    ("clamp .05 MRayl", [("face-load", "face:front", {"resistance": 5e4})], 1.4, 0, 40),
    ("clamp 1e12 Pa/m", [("face-load", "face:front", {"stiffness": 1e12})], 1.0, 1, 55),
    ("dead 3 um each face", [("surface-layer", "layer:disk", {"back": 3e-6, "front": 3e-6})], 0.6, 1, 11),
    ("wedge +-0.5 %", [("thickness-variation", "layer:disk", {"variance": 0.005**2 / 3})], 0.9, 62, 66),
    ("blob on 2 %", [("local-mass", "face:front", BLOB)], 2.5, 15, 73),
    ("loss exponent 1", [("loss-dispersion", "layer:disk", {"exponent": 1.0})], 1.5, 3, 65),
    ("dielectric CPE", [("dielectric-dispersion", "layer:disk", {"slope": 2 / np.pi * np.arctan(0.017)})], 0.3, 47, 80),
    ("1 K drift", [("temperature-drift", "sweep", {"relative": -7e-5, "permittivity": 4e-3})], 0.3, 32, 49),
    ("softening 0.2 %", [("drive-nonlinearity", "layer:disk", {"softening": 0.002})], 1.3, 55, 57),
    ("lag 500 Hz", [("sweep-lag", "sweep", {"lag": 500.0})], 0.3, 0.4, 41),
    ("mode at .87 f0", [("spurious-resonance", "layer:disk", MODE | {"frequency": 0.87})], 1.8, 36, 84),
    ("mode at .935 f0", [("spurious-resonance", "layer:disk", MODE | {"frequency": 0.935})], 4.2, 30, 84),
)  # fmt: skip


def disk() -> Stack:
    values = {name: quantity.value for name, quantity in find("Pz27").values.items()}
    constants = (values[name] for name in ("c33D", "h33", "eps33S"))
    layer = Piezo("disk", 0.5e-3, values["density"].real, *constants)
    return Stack((layer,), VACUUM, VACUUM, np.pi * 5e-3**2)


def reals(rows: np.ndarray) -> np.ndarray:
    return np.hstack([rows.real, rows.imag])


def survives(stack: Stack, device: Device, f: np.ndarray) -> tuple[float, float]:
    """Root mean square of d ln Z, and the part of it that the free constants cannot imitate, both to first order."""
    Z, J = stack.jacobian(f, FREE)
    change = reals(np.log(device.impedance(f) / Z))
    Q, _ = np.linalg.qr(reals(J).T)
    left = change - Q @ (Q.T @ change)
    return float(np.sqrt(np.mean(change**2))), float(np.linalg.norm(left) / np.linalg.norm(change))


def sized(stack: Stack, effect: str, values: dict[str, float]) -> dict[str, float]:
    """The sizes of our notes, which are in units of the disk, converted to the model's."""
    layer = stack.layers[0]
    f0 = np.sqrt(layer.c33D.real / layer.density) / (2 * layer.thickness)
    if effect == "spurious-resonance":
        return values | {"frequency": values["frequency"] * f0}
    if effect == "drive-nonlinearity":  # the notes give the softening of c33D at the peak; here it is per strain
        softening = find_effect(effect).effect_parameters(stack, "layer:disk")[0]
        return {"softening": values["softening"] / 1e-3 * softening.typical}
    return values


def test_survival_of_each_effect_compared_with_our_notes() -> None:
    stack = disk()
    print(f"\n{'':22s} rms T1 (notes)     surv. T1 (notes)   surv. TW (notes)   in %")
    for what, effects, *notes in ROWS:
        device = Device(stack, conditions=Conditions(level_V=0.5))
        for effect, where, values in effects:
            device = device.with_effect(find_effect(effect), where, sized(stack, effect, values))
        (rms, narrow), (_, wide) = (survives(stack, device, f) for f in (T1, TW))
        pairs = tuple(zip((100 * rms, 100 * narrow, 100 * wide), notes, strict=True))
        print(f"{what:22s}" + "".join(f"{ours:8.2f} ({theirs:5.2f})   " for ours, theirs in pairs))
        if what.startswith("softening"):  # with a source of 25 ohm the constants absorb it in a single sweep
            assert narrow < 0.15 < wide
            continue
        size = np.sqrt(2) if what.startswith("skin") else 1.0
        limit = 12 if what.startswith("blob") else 6  # percentage points; our notes use another model of the dot
        assert 100 * rms == pytest.approx(size * notes[0], rel=0.3, abs=0.02)
        assert all(abs(ours - theirs) < limit for ours, theirs in pairs[1:])


def graded(stack: Stack, depth: float, f: float) -> complex:
    """Z of the disk with h33(z) = h33 (1 - exp(-z/depth)) at its back, by integrating the wave equation."""
    layer, w = stack.layers[0], 2 * np.pi * f

    def slope(z: float, y: np.ndarray, D: float) -> list[complex]:
        h = layer.h33 * (1 - np.exp(-z / depth))
        stretch = (y[1] + h * D) / layer.c33D
        return [stretch, -(w**2) * layer.density * y[0], D / layer.eps33S - h * stretch]

    ends: list[np.ndarray] = []
    for u, D in ((1e-9, 0.0), (0.0, 1e-3)):
        start = np.array([u, 0, 0j])
        run = solve_ivp(slope, (0, layer.thickness), start, "DOP853", rtol=1e-9, atol=1e-30, args=(D,))
        ends.append(run.y[:, -1])
    free, driven = ends
    return complex((driven[2] - driven[1] / free[1] * free[2]) / (1j * w * 1e-3 * stack.area))


def refitted(device: Device, names: list[str], f: np.ndarray, Z: np.ndarray) -> tuple[Device, float]:
    """Return the device with `names` fitted to Z, and the root mean square residual of ln Z."""
    start = np.array([device.parameters()[name] for name in names])
    size = np.where(start == 0, [1e-6 if name.endswith("depth") else 1e7 for name in names], np.abs(start))

    def at(x: np.ndarray) -> Device:
        return device.replace(dict(zip(names, (start + x * size).tolist(), strict=True)))

    found = least_squares(
        lambda x: reals(np.log(at(x).impedance(f) / Z)),
        0 * start,
        lambda x: reals(at(x).jacobian(f, names)[1]).T * size,
    )
    return at(found.x), float(np.sqrt(2 * found.cost / f.size))


def test_a_graded_layer_as_a_dead_one() -> None:
    """How well a dead layer explains graded piezoelectricity, and the errors of the constants without it."""
    stack, f = disk(), np.linspace(1.5e6, 15e6, 241)
    print("\nh33 (1 - exp(-z/depth)) at one face, 1.5-15 MHz, refitted")
    for depth in (2e-6, 5e-6, 10e-6):
        Z = np.array([graded(stack, depth, one) for one in f])
        _, without = refitted(Device(stack), FREE, f, Z)
        start = Device(stack).with_effect(find_effect("surface-layer"), "layer:disk", {"back": depth})
        found, left = refitted(start, [*FREE, "surface-layer@layer:disk.back"], f, Z)
        dead = found.parameters()["surface-layer@layer:disk.back"]
        told = f"rms {without:.2e} without, {left:.2e} with a dead layer of {dead * 1e6:.2f} um"
        print(f"depth {depth * 1e6:4.0f} um: {told}")
        assert left < without
