"""build.toml: constants shared by two layers, bounds, and layers that are ground between two steps."""

import pytest

from pzctl.daemon.files.builds.build_file import BuildError, build_from_json, build_to_json, parse_build

HEAD = 'name = "T"\ndiameter_mm = 16\n[load]\nback = "air"\nfront = "air"\n'
DISK = '[[layers]]\nname = "disk"\nkind = "piezo"\nmaterial = "Pz27"\nthickness_mm = 0.5\n'
STEPS = '[[steps]]\nname = "disk"\nlayers = ["disk"]\n[[steps]]\nname = "two"\nlayers = ["disk", "a", "b"]\n'


def layer(name: str, **values: str) -> str:
    given = {"z_MRayl": "3", "c_m_s": "2500", "q": "30", "thickness_um": "10"} | values
    return f'[[layers]]\nname = "{name}"\nkind = "elastic"\n' + "".join(f"{k} = {v}\n" for k, v in given.items())


def text(a: str = "", b: str = "", steps: str = "") -> str:
    return (
        HEAD
        + DISK
        + (a or layer("a", z_MRayl="{ value = 3, u = 0.2, min = 2, max = 4 }"))
        + (b or layer("b"))
        + (STEPS + steps)
    )


GROUND = '[[steps]]\nname = "thin"\nlayers = ["disk", "a", "b"]\n'
GROUND += "reground = { b = { thickness_um = { value = 8, u = 1 } } }\n"


def test_tied_bounded_and_reground_layers() -> None:
    build = parse_build(text(b=layer("b", z_MRayl='{ same_as = "a" }'), steps=GROUND))
    a, b = build.layer("a").values["z"], build.layer("b").values["z"]
    assert (a.same_as, b.same_as) == (None, "a.z")
    assert (b.re, b.u) == (a.re, a.u)
    assert a.bounds == pytest.approx((2e6, 4e6))
    since, thickness = build.reground("thin")["b"]
    assert (since, thickness.re, thickness.u) == ("thin", pytest.approx(8e-6), pytest.approx(1e-6))
    assert build.reground("two") == {}
    assert build_from_json(build_to_json(build)) == build


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        (
            text(b=layer("b", z_MRayl='{ same_as = "c" }')),
            "z of layer 'b': same_as is 'c'; the layers with z are a",
        ),
        (text(layer("a", q='{ same_as = "b" }'), layer("b", q='{ same_as = "a" }')), "which is itself tied to a.q"),
        (text(layer("a", q='{ same_as = "b", u = 1 }')), "is not a known key"),
        (text(layer("a", q="{ value = 3, u = 1, min = 2 }")), "has no max; a bounded value has both min and max"),
        (text(layer("a", q="{ value = 3, u = 1, min = 4, max = 5 }")), "is 4 and max 5; 3 must lie between them"),
        (text(layer("a", q="{ value = 3, u = 1, min = -1, max = 5 }")), "a positive number is needed"),
        (text(steps=GROUND.replace("b = {", "c = {")), "reground names 'c'; the step has disk, a, b"),
        (text(steps=GROUND.replace("thickness_um", "q")), "is not a known key"),
        (
            text().replace('["disk", "a", "b"]', '["disk", "a", "b"]\nreground = { b = { thickness_um = 8 } }'),
            "is new in",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(source: str, sentence: str) -> None:
    with pytest.raises(BuildError) as caught:
        parse_build(source)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
