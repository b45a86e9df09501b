"""Names that are suggested in place of an unknown one."""

import time

import pytest

from pzctl.models.base.names import among, likely_meant

KEYS = ("thickness_mm", "c33D_1e10_Pa", "density_kg_m3", "q")


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("thicknes_mm", "thickness_mm"),
        ("Thickness_MM", "thickness_mm"),
        ("thickness", "thickness_mm"),
        ("c33D", "c33D_1e10_Pa"),
        ("Q", "q"),
    ],
)
def test_a_slip_or_a_forgotten_unit_is_recognised(given: str, meant: str) -> None:
    assert likely_meant(given, KEYS) == [meant]


@pytest.mark.parametrize("given", ["nope", "colour", "m", "", "12345"])
def test_a_name_that_resembles_none_gets_no_suggestion(given: str) -> None:
    assert likely_meant(given, (*KEYS, "copper", "mason")) == []


def test_a_megabyte_is_no_slip_of_the_hand() -> None:
    began = time.monotonic()
    assert likely_meant("lead-inductance" * 60_000, KEYS) == []
    assert time.monotonic() - began < 0.5


def test_the_most_similar_name_comes_first() -> None:
    assert likely_meant("pzt5", ("PZT-5A Erturk", "PZT-5A", "PZT-4"), most=3)[0] == "PZT-5A"
    assert among("masn", ("bvd", "mason")) == "there are bvd, mason; did you mean 'mason'?"
