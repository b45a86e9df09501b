"""`pzctl compare` through the real command line, on files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pzctl.daemon.cli import main
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.drivers.recordings import write_csv
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.models.effects import Device, find_effect
from pzctl.models.sweep import Sweep

F = np.linspace(0.9e6, 1.2e6, 61)


def recorded(path: Path, *, f0: float = 1.02e6, henry: float = 0.0, seed: int = 0) -> str:
    """Write a recording of a device with one resonance, with a wire or a coil in series."""
    rng = np.random.default_rng(seed)
    jw = 2j * np.pi * F
    Y = jw * 5e-10 * (1 + 0.08 / (1 - (F / f0) ** 2 + 1j * F / f0 / 80))
    noise = 1e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    write_csv(Sweep(F, (1 / Y + jw * henry) * np.exp(noise)), path)
    return str(path)


def said(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> tuple[int, str, str]:
    monkeypatch.setattr("sys.argv", ["pzctl", "compare", *words])
    status = 0
    try:
        main()
    except SystemExit as end:
        status = int(end.code or 0)
    told = capsys.readouterr()
    return status, told.out, told.err


def test_json_has_the_form_of_a_diagnosis_and_the_picture_is_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before, after = recorded(tmp_path / "b.csv"), recorded(tmp_path / "a.csv", henry=3e-5, seed=1)
    picture = tmp_path / "change.png"
    status, out, err = said(capsys, monkeypatch, before, after, "--json", "--picture", str(picture))
    found: dict[str, Any] = json.loads(out)
    assert status == 0
    assert found["verdict"] == "explained"
    assert {"baseline", "final", "findings", "not_decidable", "leftover", "remaining", "remarks"} < found.keys()
    assert found["final"].keys() == {"chi2_per_dof", "held_out", "constants"}
    assert found["leftover"] == {"bands_Hz": [], "chi2_per_dof": found["final"]["chi2_per_dof"]}
    (finding,) = found["findings"]
    assert finding["effect"] == "series-coil"
    assert finding["where"] == "terminals"
    assert finding["parameters"]["inductance"]["value"] == pytest.approx(3e-5, rel=0.05)
    assert finding["parameters"]["inductance"]["unit"] == "H"
    assert finding["held_out_after"] < finding["held_out_before"]
    assert picture.stat().st_size > 10_000
    assert "picture:" in err


@pytest.mark.long
def test_the_common_difference_is_the_coil_and_the_outlier_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    places = [1.01e6, 1.02e6, 1.03e6, 1.04e6]
    before = [recorded(tmp_path / f"b{k}.csv", f0=f0, seed=k) for k, f0 in enumerate(places)]
    sizes = [3e-5, 3.03e-5, 2.97e-5, 5.4e-5]
    after = [
        recorded(tmp_path / f"a{k}.csv", f0=f0, henry=size, seed=10 + k)
        for k, (f0, size) in enumerate(zip(places, sizes, strict=True))
    ]
    status, out, _ = said(capsys, monkeypatch, "--before", *before, "--after", *after, "--json")
    found: dict[str, Any] = json.loads(out)
    assert status == 0
    assert [one["effect"] for one in found["common"]] == ["series-coil"]
    assert found["common"][0]["devices"] == [0, 1, 2, 3]
    assert found["common"][0]["parameters"]["inductance"]["value"] == pytest.approx(3e-5, rel=0.02), (
        "without the outlier"
    )
    assert found["outliers"] == [after[3]]


@pytest.mark.long
def test_with_a_build_a_change_inside_is_named_by_its_layer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    build = read_build(THESIS_BUILD)
    device = Device(stack_of(build, build.step("disk")))
    loaded = device.with_effect(find_effect("face-load"), "face:front", {"resistance": 3e5})
    f, rng = np.linspace(3e6, 5e6, 61), np.random.default_rng(3)
    for name, one in (("b.csv", device), ("a.csv", loaded)):
        noise = 1e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        write_csv(Sweep(f, one.impedance(f) * np.exp(noise)), tmp_path / name)
    words = [str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--build", str(THESIS_BUILD), "--step", "disk", "--json"]
    status, out, _ = said(capsys, monkeypatch, *words)
    found: dict[str, Any] = json.loads(out)
    assert status == 0
    (finding,) = found["findings"]
    assert finding["effect"] == "face-load"
    assert finding["step"] == "disk"
    assert "it would look the same" in finding["says"], "a bare disk does not tell its faces apart"
    assert found["described_by"]["build"] == "thesis"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["b.csv"], "1 file(s) given; two are compared"),
        (["b.csv", "a.csv", "--sample", "S4"], "--sample S4: give either a sample or files, not both"),
        (["--step", "disk"], "--step disk: of which sample or build? Give --sample NAME or --build FILE as well"),
        (["b.csv", "a.csv", "--build", str(THESIS_BUILD)], "has the steps disk, ml1, ml2; say which was recorded"),
        ([], "nothing to compare: give two files, or --before FILE... --after FILE..."),
        (["b.csv", "--after", "a.csv"], "give two files, or --before FILE... --after FILE..., not both"),
    ],
)
def test_what_does_not_say_what_to_compare_is_refused(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    status, _, err = said(capsys, monkeypatch, *words)
    assert status == 2
    assert sentence in err
