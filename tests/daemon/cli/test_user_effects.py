"""Effects of the user's own: learned laws are added, listed, tried by a diagnosis beside the catalogue, and removed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.diagnosis.learning.learned_effect import Learning
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.models.base.errors import PzctlError
from pzctl.models.effects import catalogue

BUILD = """
name = "S2"
diameter_mm = 16.0
layers = [{ name = "film", kind = "piezo", material = "Pz27", thickness_mm = 0.6 }]
load = { back = "air", front = "air" }
steps = [{ name = "disk", layers = ["film"] }]
"""
LAW = """
[[effects]]
effect = "learned"
where = "layer:disk"
quantity = "permittivity"
law = "debye"
reference_Hz = 4229005.77
size = { value = 0.18507838, u = 0.0188 }
at_Hz = { value = 4320394.07, u = 3.99e+05 }
"""
STRENGTH, AT = 0.25, 4.9e6
EFFECTS = "polarity,relaxation"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "home"))
    Path("law.toml").write_text(LAW, encoding="utf-8")
    return tmp_path


def run(*words: str) -> Result:
    return CliRunner().invoke(app, words)


def refused(*words: str) -> str:
    done = run(*words)
    assert isinstance(done.exception, PzctlError)
    return str(done.exception)


def recorded() -> None:
    """Write build and recording of a sample whose permittivity relaxes, computed separately at each frequency."""
    build = parse_build(BUILD)
    stack = stack_of(build, build.step("disk"))
    (film,) = stack.layers
    f = np.linspace(1.5e6, 7.5e6, 51)
    relaxing = [replace(film, eps33S=film.eps33S * (1 + STRENGTH / (1 + 1j * at / AT))) for at in f]
    Z = np.array(
        [replace(stack, layers=(one,)).impedance(np.array([at]))[0] for one, at in zip(relaxing, f, strict=True)]
    )
    random = np.random.default_rng(2)
    Z = Z * np.exp(2e-4 * (random.normal(size=f.size) + 1j * random.normal(size=f.size)))
    rows = [f"{at:.1f},{z.real:.9g},{z.imag:.9g}" for at, z in zip(f, Z, strict=True)]
    Path("S2.csv").write_text("\n".join(["frequency_Hz,R_ohm,X_ohm", *rows, ""]), encoding="utf-8")
    Path("S2.toml").write_text(BUILD, encoding="utf-8")


def test_a_learned_law_is_added_listed_and_removed(here: Path) -> None:
    assert run("effects", "--add", "law.toml", "relaxation").stdout.startswith("added: relaxation (")
    told = {one["name"]: one for one in json.loads(run("effects", "--json").stdout)["effects"]}
    assert set(told) == {"relaxation", *(effect.name for effect in catalogue())}
    assert [name for name, one in told.items() if one["own"]] == ["relaxation"]
    assert told["relaxation"]["physics"].startswith(
        "The permittivity of disk relaxes at 4.3(4)e6 Hz with strength 0.185(19)."
    )
    assert "relaxation" in run("effects").stdout
    assert run("effects", "--remove", "relaxation").stdout.startswith("removed: relaxation (")
    assert [one["name"] for one in json.loads(run("effects", "--json").stdout)["effects"]] == [
        effect.name for effect in catalogue()
    ]


def test_a_build_is_told_how_it_states_a_law_of_the_users_own(here: Path) -> None:
    """Its page showed keys, but under which name a build has them it did not say, nor did the refusal of a build."""
    run("effects", "--add", "law.toml", "relaxation")
    stated = 'effect = "learned", quantity = "permittivity", law = "debye", reference_Hz = 4229005.77'
    section = '[[effects]]\neffect = "relaxation"\nwhere = "layer:film"\nsize = 0.2\nat_Hz = 4e6\n'
    with pytest.raises(PzctlError) as refused:
        parse_build(f"{BUILD}\n{section}")
    assert str(refused.value).endswith(f"a build states it as {stated}")
    (told,) = json.loads(run("effects", "relaxation", "--json").stdout)["effects"]
    assert told["stated"] == {
        "effect": "learned",
        "quantity": "permittivity",
        "law": "debye",
        "reference_Hz": 4229005.77,
    }
    page = " ".join(run("effects", "relaxation").stdout.replace("│", " ").split())
    assert all(key in page for key in (*stated.split(", "), "at_Hz"))


def test_a_diagnosis_of_another_sample_names_it_and_its_build_needs_no_catalogue(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The layer of the other sample has another name, and its relaxation another size."""
    run("effects", "--add", "law.toml", "relaxation")
    recorded()
    monkeypatch.setattr(Learning, "learned", lambda _self, conclusion, _tried: (conclusion, ()))  # that takes 10 s
    words = ("--jobs", "1", "--effects", EFFECTS, "--learn", "--json")
    told = run("diagnose", "--build", "S2.toml", "disk=S2.csv", *words)
    (finding,) = json.loads(told.stdout)["findings"]
    assert (finding["effect"], finding["where"]) == ("relaxation", "layer:film")
    assert finding["probability"] > 0.85
    size, at = finding["parameters"]["size"], finding["parameters"]["at"]
    assert size["value"] == pytest.approx(STRENGTH, abs=3 * size["u"])
    assert at["value"] == pytest.approx(AT, abs=3 * at["u"])
    assert "The permittivity of film relaxes at" in finding["says"]
    assert "written to S2.toml: relaxation at layer:film" in told.stderr.replace("learned at", "relaxation at")
    assert not list(here.glob("*.png"))
    run("effects", "--remove", "relaxation")
    (stated,) = parse_build(Path("S2.toml").read_text(encoding="utf-8")).effects
    assert (stated.effect, stated.quantity, stated.law, stated.reference) == (
        "learned",
        "permittivity",
        "debye",
        4229005.77,
    )
    again = json.loads(run("fit", "--build", "S2.toml", "disk=S2.csv", "--json").stdout)
    assert again["constants"]["learned@layer:film.at"]["re"] == pytest.approx(AT, rel=0.2)


ECHO = """
[[effects]]
effect = "learned"
where = "face:back"
quantity = "load"
law = "echo"
reference_Hz = 4229005.77
size = { value = 0.2, u = 0.02 }
delay_s = { value = 4e-6, u = 1e-8 }
"""
CONTACT = """
[[effects]]
effect = "learned"
where = "terminals"
quantity = "series"
law = "resistance+inertance"
reference_Hz = 4229005.77
size_ohm = { value = 0.3, u = 0.01 }
size_2_ohm = { value = 0.08, u = 0.004 }
"""


def test_an_echo_in_a_backing_and_a_sum_are_added(here: Path) -> None:
    Path("law.toml").write_text(ECHO, encoding="utf-8")
    assert run("effects", "--add", "law.toml").stdout.startswith("added: load-echo (")
    assert "depth in water 0.002966(7) m" in run("effects", "load-echo", "--json").stdout
    Path("law.toml").write_text(CONTACT, encoding="utf-8")
    assert run("effects", "--add", "law.toml").stdout.startswith("added: series-resistance-and-inertance (")
    assert "inductance 3.01(15)e-9 H" in run("effects", "series-resistance-and-inertance", "--json").stdout


def test_the_laws_of_a_build_have_their_own_names_or_the_one_given(here: Path) -> None:
    Path("build.toml").write_text(BUILD + LAW.replace("layer:disk", "layer:film"), encoding="utf-8")
    assert run("effects", "--add", "build.toml").stdout.startswith("added: permittivity-debye (")
    both = LAW + LAW.replace('"debye"', '"power"').replace("at_Hz", "exponent").replace("4320394.07", "0.1")
    Path("law.toml").write_text(both, encoding="utf-8")
    assert refused("effects", "--add", "law.toml", "mine") == (
        "law.toml: 2 laws were learned, and 'mine' can be the name of one only"
    )
    assert refused("effects", "--add", "law.toml").startswith(
        "the catalogue has an effect 'permittivity-debye' already"
    )
    assert not (here / "home" / "effects" / "permittivity-power.toml").exists(), "all or none"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('"learned"', '"lead-inductance"'), 'law.toml: no section [[effects]] has effect = "learned"'),
        (("[[effects]]", "[[effects"), "law.toml is no TOML file: "),
        (('quantity = "permittivity"\n', ""), "law.toml: effects[0]: quantity is missing"),
        (('"permittivity"', '"permitivity"'), "law.toml: effects[0]: quantity is 'permitivity'; there are stiffness"),
        (("layer:disk", "terminals"), "where is 'terminals'; the place of a law of permittivity is layer:NAME"),
        (('"debye"', '"deby"'), "there is no law 'deby' for the permittivity of disk; there are power"),
        (("reference_Hz = 4229005.77\n", ""), "reference_Hz is missing, the frequency at which the law has its size"),
        (("4229005.77", "-1"), "reference_Hz is -1; a frequency above 0 is needed"),
        (("4229005.77", '"4 MHz"'), "reference_Hz is '4 MHz'; a number is needed"),
        (("at_Hz", "at"), "at is not a known key; there are effect, where"),
        (("value = 0.18507838, ", ""), "size has u; write size = { value = ..., u = ... }"),
        (("0.18507838", "-0.2"), "size is -0.2 with u = 0.0188; allowed is 0 to inf, above 0"),
    ],
)
def test_a_law_that_cannot_be_used_is_refused_with_one_sentence(here: Path, change: tuple[str, str], says: str) -> None:
    assert change[0] in LAW
    Path("law.toml").write_text(LAW.replace(*change), encoding="utf-8")
    assert says in refused("effects", "--add", "law.toml")
    assert not (here / "home").exists()


def test_names_that_cannot_be_used(here: Path) -> None:
    assert "the name 'My law' cannot be used; allowed are up to 40" in refused("effects", "--add", "law.toml", "My law")
    assert "the name 'learned' cannot be used" in refused("effects", "--add", "law.toml", "learned")
    assert refused("effects", "--add", "law.toml", "leakage").startswith(
        "the catalogue has an effect 'leakage' already"
    )
    assert refused("effects", "--remove", "leakage") == (
        "effect 'leakage' is part of pzctl; only effects of your own can be removed"
    )
    assert refused("effects", "--remove", "mine") == "effect 'mine' is none of your own; there is none"
    assert refused("effects", "--add", "none.toml") == "none.toml cannot be read: No such file or directory"


def test_a_spoilt_file_of_the_catalogue_says_so_and_can_be_removed(here: Path) -> None:
    run("effects", "--add", "law.toml", "relaxation")
    file = here / "home" / "effects" / "relaxation.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("debye", "kramers"), encoding="utf-8")
    assert refused("effects").startswith(f"{file}: effects[0]: ")
    assert refused("effects").endswith("; correct the file or delete it")
    assert run("effects", "--remove", "relaxation").exit_code == 0
    assert run("effects").exit_code == 0
