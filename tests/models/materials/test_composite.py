"""Mixing rules of Smith and Auld for 1-3 composites: their limits, and a published composite."""

import pytest

from pzctl.models.constants.piezo_constants import EPS0
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.materials import find
from pzctl.models.materials.composite import CompositeError, Polymer, composite_1_3

CERAMIC = Tensor6mm(*(find("PZT-5H Erturk").values[name].value for name in Tensor6mm.__dataclass_fields__))
C11 = 3.1e6 * 2680
EPOXY = Polymer(C11, C11 * 0.35 / 0.65, 4 * EPS0, 1157.0)


def test_all_ceramic_is_the_ceramic_and_all_polymer_the_polymer():
    density, mode = composite_1_3(CERAMIC, 7500, EPOXY, 1 - 1e-9)
    assert density == pytest.approx(7500)
    assert mode.kt == pytest.approx(CERAMIC.thickness.kt, rel=1e-6)
    assert mode.c33D == pytest.approx(CERAMIC.thickness.c33D, rel=1e-6)
    density, mode = composite_1_3(CERAMIC, 7500, EPOXY, 1e-9)
    assert density == pytest.approx(1157)
    assert mode.c33D == pytest.approx(C11, rel=1e-6)
    assert mode.eps33S == pytest.approx(4 * EPS0, rel=1e-6)


def test_rods_couple_better_than_the_plate_and_less_than_a_free_rod():
    k33 = (CERAMIC.d[2, 2] / (CERAMIC.sE[2, 2] * CERAMIC.epsT[2, 2]) ** 0.5).real
    for fraction in (0.2, 0.5, 0.8):
        assert CERAMIC.thickness.kt.real < composite_1_3(CERAMIC, 7500, EPOXY, fraction)[1].kt.real < k33


def test_a_published_composite_is_predicted():
    published = find("1-3 composite PZT-5H").values
    fraction = (published["density"].re - 1157) / (7500 - 1157)
    density, mode = composite_1_3(CERAMIC, 7500, EPOXY, fraction)
    assert mode.kt.real == pytest.approx(0.65, rel=0.1)
    assert mode.speed(density).real == pytest.approx(3740, rel=0.1)


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.1, float("nan")])
def test_an_impossible_fraction_is_refused(fraction):
    with pytest.raises(CompositeError, match="volume fraction of the ceramic is"):
        composite_1_3(CERAMIC, 7500, EPOXY, fraction)
