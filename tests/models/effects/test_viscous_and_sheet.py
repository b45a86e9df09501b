"""A viscous liquid and the resistance of an electrode, against theory and a resistor network that share no code."""

import numpy as np

from pzctl.models.effects import Device, find_effect
from pzctl.models.effects.electrode_sheet import spread
from pzctl.models.stack import HalfSpace, Piezo, Stack


def test_water_lowers_a_quartz_crystal_as_kanazawa_and_gordon_say() -> None:
    c66, density, f0 = 2.947e10, 2651.0, 5e6
    crystal = Piezo("quartz", np.sqrt(c66 / density) / (2 * f0), density, c66 * (1 + 1e-6j), 2.4e9 + 0j, 3.99e-11 + 0j)
    stack = Stack((crystal,), HalfSpace("vacuum", 0.0), HalfSpace("vacuum", 0.0), 2e-5)
    effect = find_effect("viscous-load")
    water = np.sqrt(np.pi * f0 * 998.2 * 1.002e-3)
    f = np.linspace(f0 - 1500, f0 + 500, 4001)
    peaks = []
    for size in (0.0, water):
        device = Device(stack).with_effect(effect, "face:front", {"resistance": size})
        peaks.append(f[np.argmax(device.impedance(f).real)])
    expected = -(f0**1.5) * np.sqrt(998.2 * 1.002e-3 / (np.pi * c66 * density))
    assert np.isclose(peaks[1] - peaks[0], expected, rtol=0.02)


def test_current_spreads_over_an_electrode_as_over_a_network_of_rings() -> None:
    sheet, contact, rings = 2.0, 0.15, 4000
    edges = np.linspace(contact, 1.0, rings + 1)
    for Z in (50 - 30j, 1.5 + 0.4j, 0.2 - 0.1j):
        areas = np.diff(edges**2)
        steps = sheet / (2 * np.pi) * np.log(edges[1:] / edges[:-1])
        seen = np.inf + 0j
        for area, step in zip(areas[::-1], steps[::-1], strict=True):
            inside = 1 / (area / Z + 1 / (seen + step / 2)) if np.isfinite(seen) else Z / area
            seen = inside + step / 2
        expected = 1 / (contact**2 / Z + 1 / seen)
        found, slope = spread(np.array([Z]), sheet, contact)
        assert np.isclose(found[0], expected, rtol=1e-3)
        higher, _ = spread(np.array([Z * (1 + 1e-6)]), sheet, contact)
        assert np.isclose((higher[0] - found[0]) / (1e-6 * Z), slope[0], rtol=1e-5)


def test_a_thin_sheet_is_a_resistance_that_vanishes_with_it() -> None:
    Z = np.array([20 - 15j])
    sizes = np.array([1e-6, 1e-3])
    more = np.array([spread(Z, size, 0.1)[0][0] - Z[0] for size in sizes])
    assert np.allclose(more.real / sizes, more.real[0] / sizes[0], rtol=1e-3)
    assert np.isclose(more[0].real / sizes[0], (np.log(10) - 0.75 + 0.01 - 0.01**2 / 4) / (2 * np.pi), rtol=1e-2)
