"""`pzctl effects` as a user calls it."""

import json

import pytest
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app
from pzctl.models.effects import EffectError, Stage, catalogue


def test_the_list_names_every_effect() -> None:
    shown = CliRunner().invoke(app, ["effects"])
    assert shown.exit_code == 0
    for effect in catalogue():
        assert effect.name in shown.stdout


def test_json_describes_each_effect_its_places_and_its_signature() -> None:
    told = json.loads(CliRunner().invoke(app, ["effects", "--json"]).stdout)["effects"]
    assert [effect["name"] for effect in told] == [effect.name for effect in catalogue()]
    mass = next(effect for effect in told if effect["name"] == "electrode-mass")
    assert mass["where"] == ["face:back", "face:front", "interface"]
    assert mass["parameters"][0] | {"typical": 0, "limits": []} == {
        "name": "mass", "key": "mass_kg_m2", "unit": "kg/m2", "null": 0.0, "typical": 0, "limits": [],
    }  # fmt: skip
    assert "weigh" in mass["separates"]


def test_keys_of_a_build_are_shown_of_those_effects_that_a_build_may_state() -> None:
    """An effect of the sweep has none: `pzctl fit` refuses a build that states it."""
    told = json.loads(CliRunner().invoke(app, ["effects", "--json"]).stdout)["effects"]
    keys = {effect["name"]: [knob["key"] for knob in effect["parameters"]] for effect in told}
    of_a_sweep = {effect.name for effect in catalogue() if effect.stage == Stage.ACQUISITION}
    assert {"temperature-drift", "self-heating"} < of_a_sweep
    assert {name for name, stated in keys.items() if set(stated) <= {None}} == of_a_sweep
    shown = " ".join(CliRunner().invoke(app, ["effects", "self-heating"]).stdout.split())
    assert "none: it belongs to a sweep, not to a sample" in shown


def test_one_effect_is_described_and_an_unknown_one_is_refused() -> None:
    shown = " ".join(CliRunner().invoke(app, ["effects", "sweep-lag"]).stdout.split())
    assert "before the device had settled" in shown.replace("│ │ ", "")
    void = " ".join(CliRunner().invoke(app, ["effects", "bond-void"]).stdout.split())
    assert "Part of the bond at interface:disk|glue transmits" in void
    refused = CliRunner().invoke(app, ["effects", "gremlins"]).exception
    assert isinstance(refused, EffectError)
    assert "'gremlins'" in str(refused)


@pytest.mark.parametrize("name", ["learned", "unknown"])
def test_a_name_that_only_findings_have_is_explained(name: str) -> None:
    refused = CliRunner().invoke(app, ["effects", name]).exception
    assert "`pzctl diagnose --learn`" in str(refused)
    assert "is not known" not in str(refused)
