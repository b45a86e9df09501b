"""Analyses in Python: the guide works as written, results are those of the commands, and errors are one sentence."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import pzctl
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.drivers.recordings.write import write_csv
from pzctl.fitters.interface import Constant, TaskError
from pzctl.models.effects import EffectError

GUIDE = Path(__file__).parents[3] / "docs" / "python.md"
LEAD = 2e-8


@pytest.fixture(scope="module")
def guide(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The names that the guide's code defines, in a folder with a disk's recordings without and with a longer lead."""
    folder = tmp_path_factory.mktemp("guide")
    (folder / "build.toml").write_text(THESIS_BUILD.read_text(encoding="utf-8"), encoding="utf-8")
    f = np.linspace(1e6, 8e6, 101)
    rng = np.random.default_rng(5)
    Z = pzctl.model(folder / "build.toml", "disk").impedance(f)
    for name, seen in (("disk", Z), ("after", Z + 2j * np.pi * f * LEAD)):
        noise = 3e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        write_csv(pzctl.Sweep(f, seen * np.exp(noise)), folder / f"{name}.csv")
    names: dict[str, Any] = {"folder": folder}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL):
            exec(block, names)  # noqa: S102
    return names


def test_a_fit_shows_its_table_and_its_curves(guide: dict[str, Any]) -> None:
    found = guide["found"]
    true = pzctl.model(guide["folder"] / "build.toml", "disk").parameters()["disk.c33D.re"]
    assert abs(found["disk.c33D"].re - true) < 4 * found["disk.c33D"].u_re
    assert "disk.c33D" in str(found)
    shown = found._repr_html_()
    assert "disk.c33D" in shown
    assert "<svg" in shown
    assert (guide["folder"] / "disk.png").stat().st_size > 10_000
    with pytest.raises(KeyError, match=r"no constant 'disk\.c99'; there are disk\.c33D"):
        found["disk.c99"]


def test_a_fit_takes_the_options_of_the_command(guide: dict[str, Any]) -> None:
    build, disk = guide["folder"] / "build.toml", {"disk": guide["folder"] / "disk.csv"}
    held = pzctl.fit(build, disk, hold=["disk.thickness", "disk.density"])
    assert not held["disk.thickness"].free
    assert held["disk.c33D"].u_re < 0.1 * guide["found"]["disk.c33D"].u_re, "its uncertainty was that of the two"
    narrow = pzctl.fit(build, disk, prior={"disk.thickness": (5.125e-4, 1e-9)}, bound={"disk.density": (7690, 7710)})
    assert narrow["disk.thickness"].re == pytest.approx(5.125e-4, rel=1e-5)
    assert 7690 <= narrow["disk.density"].re <= 7710
    with pytest.raises(TaskError, match="hold, tie, prior and bound name constants of a build"):
        pzctl.fit(None, disk, fitter="bvd", hold=["area"])
    with pytest.raises(TaskError, match=r"glue9\.z"):
        pzctl.fit(build, disk, tie={"glue9.z": "glue1.z"})


def test_a_diagnosis_names_the_lead_with_its_size(guide: dict[str, Any]) -> None:
    (finding,) = guide["diagnosis"].findings
    assert finding.effect == "lead-inductance"
    assert finding.parameters["inductance"].value == pytest.approx(LEAD, rel=0.05)
    assert "lead-inductance" in guide["diagnosis"]._repr_html_()


def test_a_script_computes_with_one_thread_as_the_command_does(guide: dict[str, Any]) -> None:
    """A diagnosis took ten times as long with one thread for each core."""
    seen: set[int] = set()

    def threads(_: str) -> None:
        seen.update(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")

    build, disk = guide["folder"] / "build.toml", {"disk": guide["folder"] / "disk.csv"}
    with threadpool_limits(2, "blas"):
        pzctl.diagnose(build, disk, effects=["lead-inductance"], progress=threads)
        assert seen == {1}
        threads("")
        assert seen == {1, 2}, "what a script has chosen is there again"


def test_a_comparison_names_the_change(guide: dict[str, Any]) -> None:
    assert guide["change"].verdict == "explained"
    assert "<svg" in guide["change"]._repr_html_()


def test_an_error_is_one_sentence(guide: dict[str, Any]) -> None:
    with pytest.raises(TaskError, match=r"no step 'ml9'; it has disk, ml1, ml2$"):
        pzctl.model(guide["folder"] / "build.toml", "ml9")
    with pytest.raises(TaskError, match="no recording is given"):
        pzctl.fit(guide["folder"] / "build.toml", {})


@pytest.fixture(scope="module")
def registry() -> Any:
    return pytest.importorskip("pint").UnitRegistry()


@pytest.mark.parametrize(
    ("unit", "other", "factor"),
    [
        ("Pa", "GPa", 1e-9),
        ("Rayl", "kg/m**2/s", 1),
        ("kg/m3", "g/cm**3", 1e-3),
        ("m2", "mm**2", 1e6),
        ("1", "", 1),
        ("F/m", "pF/m", 1e12),
        ("V/m", "V/mm", 1e-3),
        ("C/N", "pC/N", 1e12),
        ("C/m2", "C/cm**2", 1e-4),
        ("N/m", "N/um", 1e-6),
    ],
)
def test_every_unit_is_one_of_pint(registry: Any, unit: str, other: str, factor: float) -> None:
    lossy = Constant(2.0, 0.5, 0.1, 0.1, unit).quantity(registry)
    assert lossy.to(other).magnitude == pytest.approx((2 + 0.5j) * factor)
    assert isinstance(Constant(2.0, 0.0, 0.1, 0.0, unit).quantity(registry).magnitude, float)


@pytest.mark.parametrize(
    ("recordings", "options", "says"),
    [
        ("disk.csv", {}, "recordings is 'disk.csv'; {step: recording} is needed"),
        (None, {"prior": {"disk.c33D": 1e11}}, "prior of 'disk.c33D' is 100000000000.0; two numbers are needed, value"),
        (None, {"bound": {"disk.c33D": (1e11, None)}}, "bound of 'disk.c33D' is (100000000000.0, None); two numbers"),
        (None, {"free": "disk.c33D"}, "free is the text 'disk.c33D'; a list of names is needed, for example ['disk."),
        (None, {"hold": "area"}, "hold is the text 'area'; a list of names is needed"),
    ],
)
def test_a_slip_in_a_call_is_one_sentence(
    guide: dict[str, Any], recordings: Any, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(TaskError, match=f"^{re.escape(says)}"):
        pzctl.fit(guide["folder"] / "build.toml", recordings or {"disk": guide["folder"] / "disk.csv"}, **options)


@pytest.mark.parametrize(
    ("effects", "kind", "says"),
    [
        (["foo"], EffectError, "effect 'foo' is not known"),
        ("cable", TaskError, "effects is the text 'cable'; a list of names is needed"),
        (
            ["cable", "bond-layer"],
            TaskError,
            "effect 'bond-layer' cannot be tested here: step disk has no place",
        ),
    ],
)
def test_an_effect_that_cannot_be_tested_is_refused(
    guide: dict[str, Any], effects: Any, kind: type[Exception], says: str
) -> None:
    with pytest.raises(kind, match=f"^{says}"):
        pzctl.diagnose(guide["folder"] / "build.toml", {"disk": guide["folder"] / "disk.csv"}, effects=effects)
