"""The user's own materials add to the library's or replace them; mistakes get one sentence."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.files.builds.build_table import BuildError
from pzctl.daemon.files.builds.own_materials import all_materials, find_material, read_materials

OWN = """
[[materials]]
name = "our glue"
kind = "elastic"
source = "measured on 12 samples"
density_kg_m3 = { value = 1150, u = 10 }
c_m_s = { value = 2500, u = 50 }
q = 25

[[materials]]
name = "Pz27"
kind = "piezo"
density_kg_m3 = 7720
c33D_1e10_Pa = { re = 15.1, im = 0.17, u = 0.3 }
h33_1e8_V_m = { value = 19.7, u = 0.3 }
eps33S_r = { re = 850, im = -10, u = 20 }
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    path = tmp_path / "materials.toml"
    path.write_text(OWN)
    return path


def test_own_materials_take_precedence_over_the_library(mine: Path) -> None:
    glue = find_material("our glue")
    assert glue.values["z"].re == pytest.approx(2.875e6)
    assert glue.values["z"].u == pytest.approx(2.875e6 * (1 / 115**2 + 1 / 50**2) ** 0.5, rel=1e-6)
    assert find_material("Pz27").values["density"].re == 7720
    assert [material.name for material in all_materials()].count("Pz27") == 1
    assert find_material("air").values["z"].re == pytest.approx(413, rel=0.02)


def test_a_build_and_the_command_line_use_own_materials(mine: Path) -> None:
    build = parse_build(
        'name = "a"\ndiameter_mm = 10\n[[layers]]\nname = "disk"\nkind = "piezo"\nmaterial = "Pz27"\n'
        'thickness_mm = 0.5\n[[layers]]\nname = "g"\nkind = "elastic"\nmaterial = "our glue"\nthickness_mm = 0.01\n'
        '[load]\nback = "air"\nfront = "air"\n[[steps]]\nname = "s"\nlayers = ["disk", "g"]\n'
    )
    assert build.layer("g").values["c"].source == "measured on 12 samples"
    shown = CliRunner().invoke(app, ["materials", "our glue"])
    assert "measured on 12" in shown.stdout


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[[materials]]\nname = 'x'\nkind = 'wood'\nq = 1", "kind"),
        ("[[materials]]\nname = 'x'\nkind = 'elastic'", "give at least one of"),
        ("[[materials]]\nname = 'x'\nkind = 'elastic'\nspeed = 3", "speed"),
        ("[[materials]\n", "cannot be read as TOML"),
        ("[[materials]]\nc_m_s = { value = 2500,5, u = 1 }\n", "write numbers with a point, not as '2500,5'"),
        ("[[materials]]\nname='x'\nkind='elastic'\nq=1\n[[materials]]\nname='X'\nkind='elastic'\nq=1", "two materials"),
    ],
)
def test_wrong_ones_are_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "materials.toml"
    path.write_text(text)
    with pytest.raises(BuildError, match=sentence) as caught:
        read_materials(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
