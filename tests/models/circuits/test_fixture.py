import numpy as np
import pytest
from fixture_path import Fixture, open_short_correction, open_short_load_correction
from hypothesis import given
from hypothesis import strategies as st

from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.circuits.terminals import Scale, Series, Shunt, TransmissionLine

F = np.linspace(1e6, 15e6, 57)
DEVICE = Lumped(1.2e-9, (Branch.from_resonance(4.2e6, 80, 2.2e-10),), tan_delta=0.017)
size = st.floats(0, 1)
paths = st.builds(
    lambda L, R, s, C, G, x, loss: Fixture(
        DEVICE,
        Series(1e-7 * L, R, 0.1 * s),
        Shunt(1e-11 * C, 1e-5 * G),
        TransmissionLine(x, loss=0.01 * loss),
        Shunt(1e-12 * s, 1e-6 * G),
        Series(1e-9 * C, 0.1 * L),
    ),
    size, size, size, size, size, size, size,
)  # fmt: skip


def test_by_default_there_is_no_fixture():
    assert Fixture(DEVICE).impedance(F) == pytest.approx(DEVICE.impedance(F), rel=1e-15)


def test_lead_and_stray_are_the_textbook_circuit():
    seen = Fixture(DEVICE, Series(30e-9, 0.3), Shunt(2e-12, 2e-6)).impedance(F)
    jw = 2j * np.pi * F
    assert seen == pytest.approx(1 / (1 / (DEVICE.impedance(F) + 0.3 + jw * 30e-9) + jw * 2e-12 + 2e-6), rel=1e-13)


def test_the_cable_equals_a_line_of_scikit_rf():
    import skrf  # imported late: it takes half a second, in each process of a test run

    medium = skrf.media.DefinedGammaZ0(
        skrf.Frequency.from_f(F, unit="hz"), z0=75.0, gamma=2j * np.pi * F / 2e8 + 1e-3 * (1 + 1j) * np.sqrt(F / 1e6)
    )
    Z = DEVICE.impedance(F)
    end = skrf.Network(frequency=medium.frequency, s=((Z - 75) / (Z + 75))[:, None, None], z0=75.0)
    expected = (medium.line(1.3, "m") ** end).z[:, 0, 0]
    assert Fixture(DEVICE, cable=TransmissionLine(1.3, 75.0, 2e8, 1e-3)).impedance(F) == pytest.approx(
        expected, rel=1e-11
    )


def test_residue_is_the_handbooks_first_order_formula():
    short, opened = 1e-3 + 2j * np.pi * F * 1e-10, 1e-9 + 2j * np.pi * F * 1e-15
    Z = DEVICE.impedance(F)
    seen = Fixture(DEVICE, open=Shunt(1e-15, 1e-9), short=Series(1e-10, 1e-3), load=Scale(1.002, 30e-12)).impedance(F)
    first_order = 1.002 * np.exp(2j * np.pi * F * 30e-12) * (Z + short - Z**2 * opened)
    assert seen == pytest.approx(first_order, rel=1e-7)


@given(paths)
def test_a_passive_path_does_not_generate_energy(fixture):
    assert (1 / fixture.impedance(F)).real.min() >= 0


@given(paths)
def test_open_short_load_removes_any_path(fixture):
    def seen(C):
        return Fixture(Lumped(C), *list(vars(fixture).values())[1:]).impedance(F)

    standard = Lumped(100e-12)
    found = open_short_load_correction(
        fixture.impedance(F), seen(1e-30), seen(1e6), seen(100e-12), standard.impedance(F)
    )
    assert found == pytest.approx(DEVICE.impedance(F), rel=1e-6)


def test_open_short_removes_series_and_shunt():
    path = {"open": Shunt(5e-12, 1e-6), "short": Series(40e-9, 0.2, 0.05)}
    opened = Fixture(Lumped(1e-30), **path).impedance(F)
    shorted = Fixture(Lumped(1e6), **path).impedance(F)
    found = open_short_correction(Fixture(DEVICE, **path).impedance(F), opened, shorted)
    assert found == pytest.approx(DEVICE.impedance(F), rel=1e-9)
