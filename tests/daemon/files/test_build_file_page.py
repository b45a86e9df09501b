"""The page of the keys of build.toml and materials.toml, and their JSON schemas, agree with what is read."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from files_page import schemas, written
from jsonschema import Draft202012Validator

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, BuildError, parse_build
from pzctl.daemon.files.builds.own_materials import read_materials

DOCS = Path(__file__).resolve().parents[3] / "docs"
BUILD = THESIS_BUILD.read_text(encoding="utf-8")
MATERIAL = '[[materials]]\nname = "glue"\nkind = "elastic"\nz_MRayl = { value = 2.8, u = 0.1 }\nc_m_s = 2450\n'


def _faults(file: str, text: str) -> list[str]:
    """Return what an editor would mark."""
    validator: Any = Draft202012Validator(schemas()[file])
    return [str(fault.message) for fault in validator.iter_errors(tomllib.loads(text))]


def test_page_and_schemas_in_the_docs_are_those_of_the_code() -> None:
    for name, text in written().items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, f"write {name} anew: make docs"


@pytest.mark.parametrize("file", ["build", "materials"])
def test_the_schemas_are_valid(file: str) -> None:
    Draft202012Validator.check_schema(schemas()[file])


@pytest.mark.parametrize(
    ("here", "instead"),
    [
        ('back = "air"', "back = { z_MRayl = { value = 3, u = 0.2 } }"),
        ("diameter_mm = 16.0", "area_mm2 = { value = 201, u = 1 }"),
        ("diameter_mm = 16.0", "diameter_mm = 16.0\nhole_diameter_mm = 5"),
        ("q = 13", 'q = { same_as = "ml1" }'),
        ("bandwidth = 5", 'bandwidth = 1\ndirection = "down"\n[measurement]\nsupplier = "x"\ntemperature_C = 23'),
        ("bandwidth = 5", "bandwidth = 5\n[limits]\nconformance = 0.9\n[limits.disk]\nkt = { min = 0.45 }"),
        (
            "bandwidth = 5",
            'bandwidth = 5\n[[effects]]\neffect = "lead-inductance"\nwhere = "terminals"\ninductance_H = 5e-8',
        ),
        ('name = "ml1"\nlayers', 'name = "ml1"\nmass_g = { value = 1.2, u = 0.01 }\nlayers'),
    ],
)
def test_a_file_that_is_read_has_no_faults(here: str, instead: str) -> None:
    assert here in BUILD
    text = BUILD.replace(here, instead, 1)
    parse_build(text)
    assert not _faults("build", text)


@pytest.mark.parametrize(
    ("here", "instead"),
    [
        ("diameter_mm = 16.0", "diameter_mm = 0"),
        ("diameter_mm = 16.0", "diameter_mm = 16\narea_mm2 = 201"),
        ("diameter_mm = 16.0", "diameter_cm = 1.6"),
        ("diameter_mm = 16.0", "area_mm2 = 201\nhole_diameter_mm = 5"),
        ('kind = "piezo"', 'kind = "ceramic"'),
        ("q = 13", "q = { same_as = 1 }"),
        ("q = 13", "kp = 0.5"),
        ("u = 0.005 }", "u = -0.005 }"),
        ("bandwidth = 5", "bandwidth = 6"),
        ("bandwidth = 5", "point_delay_s = -1"),
        ("oscillator_V = 0.5", "oscillator_V = 0"),
        ("points = 801", "points = 1"),
        ('[load]\nback = "air"', "[load]\nbehind = 'air'"),
        ("bandwidth = 5", "bandwidth = 5\n[sample]\nmax_bias_V = -1"),
        ("bandwidth = 5", "bandwidth = 5\n[limits.disk]\nkt = { least = 0.45 }"),
        ('material = "Pz27"', 'material = "Pz27"\neps33S_r = { re = 900, im = 10 }'),
    ],
)
def test_a_mistake_is_marked_by_editors_and_refused_by_the_reader(here: str, instead: str) -> None:
    assert here in BUILD
    text = BUILD.replace(here, instead, 1)
    with pytest.raises(BuildError):
        parse_build(text)
    assert _faults("build", text)


@pytest.mark.parametrize(
    ("here", "instead", "right"),
    [
        ("c_m_s", "density_kg_m3", True),
        ('kind = "elastic"', 'kind = "piezo"', False),
        ("c_m_s", "thickness_mm", False),
        ('name = "glue"\n', "", False),
    ],
)
def test_the_schema_of_materials_agrees_with_their_reader(here: str, instead: str, right: bool, tmp_path: Path) -> None:
    text = MATERIAL.replace(here, instead)
    (tmp_path / "materials.toml").write_text(text, encoding="utf-8")
    assert bool(_faults("materials", text)) is not right
    if right:
        assert read_materials(tmp_path / "materials.toml")
        return
    with pytest.raises(BuildError):
        read_materials(tmp_path / "materials.toml")
