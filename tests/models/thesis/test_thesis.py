from pathlib import Path

import pytest

from pzctl.models.thesis import page, printed, rebuilt
from pzctl.models.thesis.errata import errata

DOCS = Path(__file__).resolve().parents[3] / "docs" / "thesis.md"


def test_the_page_is_up_to_date():
    assert DOCS.read_text(encoding="utf-8") == page()


def test_the_formulas_of_the_thesis_give_its_digits_and_corrected_ones_sherrits():
    sample, sherrit = printed.TABLE_A_1, printed.SHERRIT_A_1
    wrong, right = rebuilt.thesis_formulas(sample), rebuilt.corrected(sample)
    assert wrong["s11E"].real == pytest.approx(1.4628e-11, rel=3e-5)
    assert wrong["s12E"] == pytest.approx(-5.4894e-12 * (1 - 0.02280j), rel=3e-5)
    assert wrong["d31"].real == pytest.approx(-205.9e-12, rel=3e-4)
    for name in rebuilt.RADIAL_NAMES:
        there, truth = getattr(right, name), getattr(sherrit, name)
        assert there.real == pytest.approx(truth.real, rel=3e-3), name
        assert there.imag == pytest.approx(truth.imag, rel=4e-3), name


@pytest.mark.parametrize("sample", printed.TABLE_4_8, ids=lambda s: s.name)
def test_table_4_8_is_reproduced_by_the_wrong_formulas(sample):
    wrong = rebuilt.thesis_formulas(sample)
    assert wrong["s11E"] == pytest.approx(sample.s11E, rel=1e-4)
    assert wrong["s12E"] == pytest.approx(sample.s12E, rel=2e-4)
    assert wrong["d31"].real == pytest.approx(sample.d31.real, rel=2e-3)


def test_table_4_8_corrected():
    right = [rebuilt.corrected(sample) for sample in printed.TABLE_4_8]
    assert [r.s12E.real * 1e12 for r in right] == pytest.approx([-5.81, -9.36, -8.08], abs=0.005)
    assert [r.d31.real * 1e12 for r in right] == pytest.approx([-166.1, -148.2, -150.3], abs=0.06)
    assert [r.kp.real for r in right] == pytest.approx([0.579, 0.565, 0.530], abs=5e-4)


@pytest.mark.parametrize("name", printed.TABLE_4_9)
def test_table_4_9_follows_from_table_4_8(name):
    unit = printed.UNITS_4_9[name]
    computed = [value / unit for value in rebuilt.table_4_9(right=False)[name]]
    for one, other in zip(computed, printed.TABLE_4_9[name], strict=True):
        assert (one.real, one.imag) == pytest.approx((other.real, other.imag), abs=1e-4)


def test_table_4_1_has_the_right_deviations():
    for row in printed.TABLE_4_1:
        assert 100 * abs(row.simulated / row.datasheet - 1) == pytest.approx(row.percent, abs=0.006), row.name


def test_sherrits_constants_are_recovered_from_their_spectrum():
    for row in rebuilt.recovered_radial():
        assert row.found.real == pytest.approx(row.truth.real, rel=1e-3), row.name


def test_every_erratum_has_all_four_parts():
    assert len(errata()) > 25
    for erratum in errata():
        assert all(text and "|" not in text for text in vars(erratum).values()), erratum.where
