"""build.toml: its values are read, and every mistake in it gets one sentence."""

import contextlib
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.daemon.files.builds.build_check import check_build
from pzctl.daemon.files.builds.build_file import BuildError, build_from_json, build_to_json, parse_build, read_build
from pzctl.models.base.errors import PzctlError
from pzctl.models.constants.piezo_constants import EPS0
from pzctl.models.materials import find

S4 = """\
name = "S4"
diameter_mm = { value = 16.0, u = 0.1 }

[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.512, u = 0.001 }
c33D_1e10_Pa = { re = 14.4, im = 0.1, u = 0.3 }
eps33S_r = { re = 914, im = -15, u = 40, u_im = 5 }

[[layers]]
name = "glue1"
kind = "elastic"
material = "epoxy"
thickness_um = 10

[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = { value = 10.3, u = 0.5 }
c_m_s = 2455
q = { value = 60, u = 30 }
thickness_mm = 0.139

[load]
back = "air"
front = { z_MRayl = 1.5 }

[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "glue1", "ml1"]

[sweep]
segments = [ { start_MHz = 1, stop_MHz = 6, points = 801 }, { start_kHz = 500, stop_MHz = 15.5, points = 401 } ]
oscillator_V = 0.5
bandwidth = 3
"""


def test_every_value_arrives_in_si_with_its_uncertainty_and_source() -> None:
    build = parse_build(S4)
    disk, glue, ml1 = build.layers
    assert build.diameter is not None
    assert build.diameter.re == pytest.approx(0.016)
    assert build.area.re == pytest.approx(math.pi * 0.008**2)
    assert build.area.u / build.area.re == pytest.approx(2 * 0.1 / 16)
    assert disk.values["thickness"].re == pytest.approx(0.512e-3)
    assert disk.values["thickness"].u == pytest.approx(1e-6)
    assert disk.values["c33D"].value == pytest.approx(14.4e10 + 0.1e10j)
    assert (disk.values["c33D"].u, disk.values["c33D"].u_im) == pytest.approx((3e9, 3e9)), "u is that of both parts"
    assert disk.values["eps33S"].u_im == pytest.approx(5 * EPS0)
    assert glue.values["thickness"].re == pytest.approx(10e-6)
    assert ml1.values["z"].re == pytest.approx(10.3e6)
    assert ml1.values["c"].u == 0, "a bare number is taken as exact"
    assert ml1.values["c"].source == "build.toml"
    assert build.front.z.re == pytest.approx(1.5e6)
    assert build.plan is not None
    assert [s.start_Hz for s in build.plan.segments] == pytest.approx([1e6, 500e3])
    assert (build.plan.bandwidth, build.plan.segments[1].points) == (3, 401)


def test_a_ring_has_the_area_between_its_circles() -> None:
    build = parse_build(S4.replace("[[layers]]", "hole_diameter_mm = { value = 6, u = 0.2 }\n[[layers]]", 1))
    assert build.hole_diameter is not None
    assert build.hole_diameter.re == pytest.approx(6e-3)
    assert build.area.re == pytest.approx(math.pi * (0.008**2 - 0.003**2))
    assert build.area.u == pytest.approx(math.pi / 2 * math.hypot(16e-3 * 1e-4, 6e-3 * 2e-4))
    assert build_from_json(build_to_json(build)) == build


def test_missing_values_come_from_the_library() -> None:
    disk = parse_build(S4).layer("disk")
    pz27 = find("Pz27").values
    assert disk.values["h33"] == pz27["h33"]
    assert disk.nominal == pz27, "the data sheet stays beside the values given"
    assert disk.nominal["c33D"] != disk.values["c33D"]


@pytest.mark.parametrize(
    ("load", "front"), [("", "air"), ("[load]", "air"), ("[load]\nfront = { z_MRayl = 1.5 }", "given")]
)
def test_a_face_that_is_not_named_borders_on_air(load: str, front: str) -> None:
    build = parse_build(S4.replace('[load]\nback = "air"\nfront = { z_MRayl = 1.5 }', load))
    assert (build.back.name, build.front.name) == ("air", front)
    assert build.back.z == find("air").values["z"]


def test_density_replaces_the_impedance_of_an_elastic_layer() -> None:
    text = S4.replace("z_MRayl = { value = 10.3, u = 0.5 }", "density_kg_m3 = { value = 4000, u = 40 }")
    z = parse_build(text).layer("ml1").values["z"]
    assert z.re == pytest.approx(4000 * 2455)
    assert z.u == pytest.approx(40 * 2455)


def test_all_open_cases_are_read(cases: Path) -> None:
    files = sorted(cases.glob("*/build.toml"))
    assert len(files) == 10
    for file in files:
        assert read_build(file).name == file.parent.name


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "S4"', 'nam = "S4"', "nam is not a known key; did you mean name?"),
        ('name = "S4"', 'name = "../S4"', "name is '../S4'; allowed are letters"),
        ('name = "S4"', "name = 4", "name is 4; a text in quotes is needed"),
        ('name = "S4"', "name = S4", "not TOML: Invalid value (at line 1, column 8)"),
        ("{ value = 16.0, u = 0.1 }", "16,5", "write numbers with a point, not as '16,5'"),
        ("{ value = 16.0, u = 0.1 }", "{ value = 16.0, u = 0,1 }", "write numbers with a point, not as '0,1'"),
        ("{ value = 16.0, u = 0.1 }", "{ value = 16,0, u = 0,1 }", "write numbers with a point, not as '16,0'"),
        ("diameter_mm = { value = 16.0, u = 0.1 }", "", "the file has no size; write diameter_mm = ... or area_mm2"),
        ("diameter_mm = {", "area_mm2 = 2\ndiameter_mm = {", "area_mm2 is given beside diameter_mm"),
        (
            "diameter_mm = { value = 16.0, u = 0.1 }",
            "area_mm2 = 200\nhole_diameter_mm = 5",
            "hole_diameter_mm is given beside area_mm2; a ring needs diameter_mm",
        ),
        (
            "diameter_mm = {",
            "hole_diameter_mm = 16\ndiameter_mm = {",
            "hole_diameter_mm is 16; more than 0 and less than 16, the diameter, is needed",
        ),
        (
            "thickness_mm = 0.139",
            "thickness_mm = -0.139",
            "thickness_mm (of layer 'ml1') is -0.139; a positive",
        ),
        (
            "thickness_mm = 0.139",
            "thickness_mm = 0.139\npoisson = 0.5",
            "poisson (of layer 'ml1') is 0.5; a number below",
        ),
        ("value = 16.0", "value = 1e200", "diameter_mm.value is 1e+200; a size from 1e-50 to 1e+50 is needed, or zero"),
        ("points = 801", "points = 1" + "0" * 400, "a whole number of at most 9007199254740992 is needed"),
        ("thickness_mm = 0.139", "thickness_mm = nan", "layers[2].thickness_mm (of layer 'ml1') is nan; a finite"),
        ("thickness_mm = 0.139", "thickness_mm = true", "is true; a number is needed"),
        ("thickness_mm = 0.139", "thickness_mm = '0.139'", "is '0.139'; a number is needed"),
        ("thickness_mm = 0.139", "thickness_mm = 1" + "0" * 400, "a finite number is needed"),
        ("thickness_mm = 0.139", "thickness_mm = 1" + "0" * 5000, "a number too long"),
        ("thickness_mm = 0.139", "", "layers[2] (layer 'ml1') has no thickness; give thickness_mm or thickness_um"),
        ("thickness_mm = 0.139", "thicknes_mm = 0.139", "did you mean thickness_mm?"),
        ("thickness_mm = 0.139", "thickness_mm = 1\nthickness_um = 1", "thickness_um (of layer 'ml1') is given beside"),
        ("thickness_mm = 0.139", "thickness_mm = {value=1, u=-1}", "layers[2].thickness_mm.u (of layer 'ml1') is -1"),
        ("thickness_mm = 0.139", "thickness_mm = {value=1, sd=1}", "thickness_mm.sd (of layer 'ml1') is not a known"),
        (
            "thickness_mm = 0.139",
            "thickness_mm = {re=1, im=1}",
            "thickness_mm.re (of layer 'ml1') is not a known key; allowed",
        ),
        ("thickness_mm = 0.139", "thickness_mm = {u=1}", "layers[2].thickness_mm (layer 'ml1') has no value"),
        ("c_m_s = 2455", "c_m_s = 2455\ndensity_kg_m3 = 1", "density_kg_m3 (of layer 'ml1') is given beside z_MRayl"),
        ("im = 0.1", "im = -0.1", "imaginary part -0.1, a gain"),
        ("im = -15", "im = 15", "is x (1 - j tan d)"),
        (
            'kind = "piezo"',
            'kind = "ceramic"',
            "layers[0].kind (of layer 'disk') is 'ceramic'; ",
        ),
        ('kind = "piezo"\nmaterial = "Pz27"', 'kind = "piezo"', "has no density; give density_kg_m3; or name a"),
        ('material = "Pz27"', 'material = "Pz72"', "layers[0].material (of layer 'disk') is 'Pz72': "),
        ('material = "epoxy"', 'material = "Pz27"', "layers[1] (layer 'glue1') has no z; give z_MRayl"),
        ('name = "glue1"', 'name = "disk"', "layers[1].name is 'disk', which layers[0] has already"),
        ('name = "glue1"', 'name = "glue.1"', "layers[1].name is 'glue.1'; allowed are letters"),
        ('name = "glue1"', 'name = "back"', "layers[1].name is 'back', which is reserved"),
        ('name = "ml1"\nlayers', 'name = "disk"\nlayers', "steps[1].name is 'disk', which steps[0] has already"),
        ('"glue1", "ml1"]', '"glue", "ml1"]', "names 'glue'; the layers are disk, glue1, ml1"),
        ('"glue1", "ml1"]', '"ml1", "glue1"]', "in the order of [[layers]]: disk, glue1, ml1"),
        ('"disk", "glue1", "ml1"]', '"glue1", "ml1"]', "lacks disk; without a piezo layer"),
        ('layers = ["disk"]', 'layers = ["disk", "glue1", "ml1"]\n[[steps]]\nname="x"\nlayers=["disk"]', "lacks glue1"),
        ('layers = ["disk"]', "layers = [1]", "steps[0].layers[0] (of step 'disk') is 1; a text in quotes"),
        ('back = "air"', 'back = "Pz27"', "load.back is 'Pz27', which has no z in the library"),
        ("z_MRayl = 1.5 }", "z = 1.5 }", "load.front.z is not a known key; allowed here: z_MRayl"),
        ("z_MRayl = 1.5 }", "z_MRayl = 1e300 }", "load.front.z_MRayl is 1e+300; a size from 1e-50 to 1e+50 is needed"),
        (
            "z_MRayl = 1.5 }",
            "z_MRayl = { value = 1.5, u = 1e-300 } }",
            "is 1e-300; a size from 1e-50 to 1e+50 is needed",
        ),
        ("stop_MHz = 6", "stop_MHz = 0.6", "sweep.segments[0]: segment: stop 600000 Hz is not above start 1e+06 Hz"),
        ("stop_MHz = 6", "stop_MHz = 6, stop_kHz = 6000", "sweep.segments[0] has no single stop"),
        ("points = 401", "points = 1.5", "sweep.segments[1].points is 1.5; a whole number"),
        ("bandwidth = 3", "bandwidth = 6", "sweep.bandwidth is 6; 1 (fast) to 5"),
        (
            "bandwidth = 3",
            "oscillator_mA = 5",
            "sweep.oscillator_mA is given beside oscillator_V; the device is driven",
        ),
        ("oscillator_V = 0.5", "oscillator_mA = 0", "sweep.oscillator_mA is 0; a positive number is needed"),
        ("bandwidth = 3", "point_delay_s = -1", "sweep.point_delay_s is -1; 0 s (none) or more is needed"),
    ],
)
def test_anything_wrong_is_one_sentence_that_names_the_place(old: str, new: str, says: str) -> None:
    assert old in S4
    with pytest.raises(BuildError) as caught:
        parse_build(S4.replace(old, new, 1), "my/build.toml")
    sentence = str(caught.value)
    assert sentence.startswith("my/build.toml: ")
    assert says in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "S4"', "name = S4  # mine", 'a text needs quotes: name = "S4"'),
        ('material = "Pz27"', "material = Pz27", 'a text needs quotes: material = "Pz27"'),
        ("[[layers]]", "[layers]", "write [[layers]] in double brackets, not [layers]"),
        ("[[steps]]", "[steps]", "write [[steps]] in double brackets, not [steps]"),
    ],
)
def test_usual_slips_get_a_hint(old: str, new: str, says: str) -> None:
    assert old in S4
    for count in (1, -1):
        with pytest.raises(BuildError) as caught:
            parse_build(S4.replace(old, new, count))
        assert says in str(caught.value)


def test_a_section_alone_in_single_brackets_gets_the_hint_too() -> None:
    with pytest.raises(BuildError, match=r"layers is one table; write \[\[layers\]\] in double brackets before each"):
        parse_build('name = "S"\ndiameter_mm = 16\n[load]\nback = "air"\nfront = "air"\n[layers]\nname = "disk"\n')


def test_a_key_in_capitals_gets_the_one_in_small_letters_as_a_hint() -> None:
    with pytest.raises(BuildError, match=r"Q \(of layer 'glue1'\) is not a known key; did you mean q\?"):
        parse_build(S4.replace('name = "glue1"', 'name = "glue1"\nQ = 13', 1))


def test_a_plan_can_have_current_drive_and_delays() -> None:
    plan = parse_build(
        S4.replace("oscillator_V = 0.5", "oscillator_mA = 5\npoint_delay_s = 0.01\nsweep_delay_s = 2")
    ).plan
    assert plan is not None
    assert (plan.oscillator_A, plan.point_delay_s, plan.sweep_delay_s) == (0.005, 0.01, 2.0)


def test_a_build_without_piezo_layer_is_refused() -> None:
    elastic = S4.replace('kind = "piezo"\nmaterial = "Pz27"', 'kind = "elastic"\nmaterial = "epoxy"')
    elastic = "\n".join(line for line in elastic.splitlines() if "c33D" not in line and "eps33S" not in line)
    with pytest.raises(BuildError, match="no piezo layer"):
        parse_build(elastic)


SECOND = """
[[layers]]
name = "disk2"
kind = "piezo"
material = { same_as = "disk" }
polarity = -1
thickness_mm = { value = 0.51, u = 0.001 }

[electrical]
connection = "parallel"

[load]"""
TWIN = S4.replace("[load]", SECOND, 1).replace('"glue1", "ml1"]', '"glue1", "ml1", "disk2"]')


def test_a_second_piezo_layer_shares_the_ceramic_it_names_and_nothing_else() -> None:
    build = parse_build(TWIN)
    first, second = build.layer("disk"), build.layer("disk2")
    assert (build.connection, second.polarity, second.material) == ("parallel", -1, "Pz27")
    for name in ("c33D", "h33", "eps33S", "density"):
        assert second.values[name] == replace(first.values[name], same_as=f"disk.{name}")
    assert second.values["thickness"].re == 0.51e-3
    assert build_from_json(json.loads(json.dumps(build_to_json(build)))) == build


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("polarity = -1", "polarity = 2", "polarity .* is 2; 1 .poled towards the front. or -1"),
        (
            "polarity = -1",
            "polarity = -1\nc33D_GPa = 140",
            "c33D_GPa .* is given beside material",
        ),
        ('same_as = "disk"', 'same_as = "glue1"', "same_as is 'glue1'; the layers with c33D are disk"),
        ('same_as = "disk"', 'like = "disk"', "like .* is not a known key"),
        ("thickness_mm = { value = 0.51, u = 0.001 }", "", "has no thickness; .* material does not share it"),
        ('"parallel"', '"bridge"', 'electrical.connection is \'bridge\'; "series" or "parallel" is needed'),
        ('[electrical]\nconnection = "parallel"', "", "no \\[electrical\\]; .* disk, disk2 are several piezo layers"),
        ('kind = "elastic"\nmaterial', 'kind = "elastic"\npolarity = 1\nmaterial', "polarity .* is not a known key"),
    ],
)
def test_a_mistake_about_a_second_piezo_layer_is_one_sentence(old: str, new: str, says: str) -> None:
    assert old in TWIN
    with pytest.raises(BuildError, match=says):
        parse_build(TWIN.replace(old, new, 1))


SANDWICH = (Path(__file__).resolve().parents[3] / "examples" / "langevin.toml").read_text(encoding="utf-8")
BOLT = '[bolt]\nbetween = ["tail", "head"]\nstiffness_kN_mm = { value = 400, u = 80 }\n'


def test_a_bolt_is_read_with_its_two_layers() -> None:
    build = parse_build(f"{SANDWICH}\n{BOLT}")
    assert build.bolt is not None
    assert (build.bolt.behind, build.bolt.before) == ("tail", "head")
    assert (build.bolt.stiffness.re, build.bolt.stiffness.u) == (4e8, 8e7)
    assert build_from_json(json.loads(json.dumps(build_to_json(build)))) == build


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('["tail", "head"]', '["tail"]', r"bolt.between names 1 layers; the two that hold the ends"),
        ('["tail", "head"]', '["tail", "nut"]', "bolt.between names 'nut'; the layers are tail, ring1, ring2, head"),
        ('["tail", "head"]', '["head", "tail"]', "a piezo layer must lie between them, and the one further back"),
        ("stiffness_kN_mm = { value = 400, u = 80 }", "", "has no stiffness; give stiffness_N_m or stiffness_kN_mm"),
        ("value = 400", "value = -1", "stiffness_kN_mm.* a positive number is needed"),
    ],
)
def test_a_mistake_about_the_bolt_is_one_sentence(old: str, new: str, says: str) -> None:
    assert old in BOLT
    with pytest.raises(BuildError, match=says):
        parse_build(f"{SANDWICH}\n{BOLT.replace(old, new)}")


def test_a_transducer_without_a_step_is_refused() -> None:
    with pytest.raises(BuildError, match=r"steps is empty; at least one \[\[steps\]\] is needed"):
        check_build(replace(parse_build(S4), steps=()), "S4.toml")


def test_what_is_no_text_file_is_said(tmp_path: Path) -> None:
    file = tmp_path / "build.toml"
    for content, says in (
        (b"", "empty"),
        (b"\xff\xfe\x00", "byte 1 is not UTF-8"),
        (b"x=" + b"[" * 9000, "TOML|nested"),
    ):
        file.write_bytes(content)
        with pytest.raises(BuildError, match=says):
            read_build(file)
    with pytest.raises(BuildError, match="is a folder"):
        read_build(tmp_path)
    with pytest.raises(BuildError, match="No such file"):
        read_build(tmp_path / "absent.toml")


def test_a_byte_order_mark_and_crlf_are_accepted(tmp_path: Path) -> None:
    file = tmp_path / "build.toml"
    file.write_bytes(b"\xef\xbb\xbf" + S4.replace("\n", "\r\n").encode())
    assert read_build(file) == parse_build(S4)


def test_a_build_survives_a_json_round_trip() -> None:
    build = parse_build(S4)
    assert build_from_json(json.loads(json.dumps(build_to_json(build)))) == build


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("area", "re"), "big", r"Expected `float`, got `str` - at `\$\.area\.re`"),
        (("name",), "a/b", "name is 'a/b'"),
        (("steps", 0, "layers"), ["nothing"], "names 'nothing'"),
        (("plan", "segments", 0, "points"), 1, "1 points; at least 2"),
    ],
)
def test_json_that_is_no_build_is_refused(path: tuple[str | int, ...], value: object, says: str) -> None:
    obj = build_to_json(parse_build(S4))
    place = json.loads(json.dumps(obj))
    target = place
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    with pytest.raises(BuildError, match=says):
        build_from_json(place)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(S4) - 1), st.sampled_from('"[]{}=,.-1e#\n\x00aé')), max_size=4))
def test_a_damaged_file_never_shows_a_traceback(changes: list[tuple[int, str]]) -> None:
    text = S4
    for place, letter in changes:
        text = text[:place] + letter + text[place + 1 :]
    with contextlib.suppress(PzctlError):  # any other exception fails the test
        check_build(parse_build(text), "again")
