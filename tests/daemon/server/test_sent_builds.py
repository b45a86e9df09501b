"""Builds that no file describes: the daemon refuses them before it measures, so that no fitter fails on them."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from pzctl import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.files.builds.build_table import BuildError
from pzctl.daemon.files.builds.sent_build import check_sent_build
from pzctl.fitters.interface import FitError
from pzctl.models.build import BoltSpec, Build, EffectSpec, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.specification import Limit, Specification


def with_value(build: Build, name: str, **changes: object) -> Build:
    """Return the build with another value of a constant of its first layer."""
    disk = build.layers[0]
    values = {**disk.values, name: msgspec.convert({**msgspec.to_builtins(disk.values[name]), **changes}, Quantity)}
    return replace(build, layers=(replace(disk, values=values), *build.layers[1:]))


NONSENSE: dict[str, Callable[[Build], Build]] = {
    "layers has no piezo layer": lambda b: replace(b, layers=()),
    "steps[0].layers (of step 'disk') names 'nope'": lambda b: replace(b, steps=(Step("disk", ("nope",)),)),
    "steps[0].layers (of step 'disk') lacks disk": lambda b: replace(b, steps=(Step("disk", ()),)),
    "steps[2].name is 'disk', which steps[0] has already": lambda b: replace(b, steps=(*b.steps, b.steps[0])),
    "layers[2].name is 'disk', which layers[0] has already": lambda b: replace(b, layers=(*b.layers, b.layers[0])),
    "layers[2].name is 'area', which is reserved": lambda b: replace(
        b, layers=(*b.layers, replace(b.layers[1], name="area"))
    ),
    "layers[0].polarity is 7": lambda b: replace(b, layers=(replace(b.layers[0], polarity=7), b.layers[1])),
    "20002 layers; at most 500 are allowed": lambda b: replace(
        b, layers=(*b.layers, *(LayerSpec(f"l{k}", "elastic", {}) for k in range(20_000)))
    ),
    "20000 steps; at most 500 are allowed": lambda b: replace(
        b, steps=tuple(Step(f"s{k}", ("disk",)) for k in range(20_000))
    ),
    "layers[0].values.thickness.re is -1; a positive": lambda b: with_value(b, "thickness", re=-1.0),
    "layers[0].values.thickness.re is 1e+308; a size": lambda b: with_value(b, "thickness", re=1e308),
    "layers[0].values.c33D.im is -1e+10, a gain": lambda b: with_value(b, "c33D", im=-1e10),
    "layers[0].values.h33 has the uncertainty -1": lambda b: with_value(b, "h33", u=-1.0),
    "layers[0].values.thickness.bounds is 2 to 1": lambda b: with_value(b, "thickness", bounds=(2.0, 1.0)),
    "same_as is 'zz'; the layers with thickness are ml1": lambda b: with_value(b, "thickness", same_as="zz.thickness"),
    "which is itself tied to disk.thickness": lambda b: with_value(b, "thickness", same_as="disk.thickness"),
    "thickness.same_as is 'ml1.z'; thickness of another": lambda b: with_value(b, "thickness", same_as="ml1.z"),
    "area.re is 0; a positive": lambda b: replace(b, area=Quantity(0.0)),
    "hole_diameter is given and no diameter": lambda b: replace(b, diameter=None, hole_diameter=Quantity(1e-3)),
    "hole_diameter_mm is -1; more than 0": lambda b: replace(b, diameter=Quantity(1e-2), hole_diameter=Quantity(-1e-3)),
    "back.z.re is -5; zero or a positive": lambda b: replace(b, back=LoadSpec("air", Quantity(-5.0))),
    "steps[0].mass.re is -1; a positive": lambda b: replace(b, steps=(replace(b.steps[0], mass=Quantity(-1.0)),)),
    "steps[0].reground names 'ml1'": lambda b: replace(
        b, steps=(replace(b.steps[0], reground={"ml1": Quantity(1e-3)}),)
    ),
    "bolt.between names 'a'": lambda b: replace(b, bolt=BoltSpec("a", "b", Quantity(1e6))),
    "limits.nope: the build has no such layer": lambda b: replace(
        b, specification=Specification({"nope.c33D": Limit(1.0)})
    ),
}


@pytest.mark.parametrize("says", NONSENSE)
def test_a_build_that_no_device_can_have_is_refused_in_one_sentence(build: Build, says: str) -> None:
    began = time.monotonic()
    with pytest.raises(BuildError) as refused:
        check_sent_build(NONSENSE[says](build), "build")
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)
    assert time.monotonic() - began < 1


def test_the_daemon_measures_no_such_build(start_daemon: Callable[..., Location], build: Build) -> None:
    start_daemon()
    with connect() as lab:
        before = lab.status().seq
        for nonsense in (with_value(build, "thickness", re=-1.0), replace(build, layers=())):
            with pytest.raises(DaemonError) as refused:
                lab.begin(nonsense, "disk")
            assert refused.value.code == "bad-build"
        with pytest.raises(DaemonError, match="source of thickness of layers"):
            lab.begin(with_value(build, "thickness", source="\x1b[2J"), "disk")
        assert lab.status().seq == before, "nothing was accepted"
        assert lab.measure(build, "disk").sweeps


def test_unknown_effects_and_missing_constants_are_left_to_the_fitter(
    start_daemon: Callable[..., Location], build: Build
) -> None:
    where = start_daemon(names=("mason",))
    only_measured = replace(build.layers[0], values={"thickness": build.layers[0].values["thickness"]})
    with connect() as lab:
        for sent, says in (
            (replace(build, effects=(EffectSpec("x", "terminals", {}),)), r"^effect 'x' is not known; there are "),
            (replace(build, layers=(only_measured, *build.layers[1:])), r"^layer 'disk' of .* has no density, c33D"),
        ):
            measurement = lab.begin(sent, "disk")
            with pytest.raises(FitError, match=says):
                lab.wait_fit("mason", measurement)
    log = Path(where.log).with_name("fitter-mason.log")
    assert "Traceback" not in log.read_text(encoding="utf-8")


def test_the_build_of_a_file_is_accepted() -> None:
    check_sent_build(read_build(THESIS_BUILD), "build")
