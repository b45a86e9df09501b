"""Error sentences of fitters whose recordings and options do not fit: what was found, and what is allowed."""

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters import plugins
from pzctl.fitters.disk.critical_frequencies import ImmittanceTrace, critical
from pzctl.fitters.disk.direct_methods import drawn
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.disk.sherrit_radial import SherritRadial
from pzctl.fitters.disk.sherrit_thickness import SherritThickness, _constants
from pzctl.fitters.disk.two_d.disk2d import Disk2DFitter
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.engine.start import disk_starts
from pzctl.fitters.interface import FitError, FitTask, Options
from pzctl.fitters.layered.bvd import ButterworthVanDyke
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.layered.nelder_mead import MasonNelderMead
from pzctl.fitters.uncertainty.bootstrap import Draws
from pzctl.fitters.uncertainty.intervals import with_draws
from pzctl.models.build import Build, Quantity
from pzctl.models.disk.round_disk import RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.sweep import Sweep

GLUED = """
name = "G"
area_mm2 = 201.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = 0.5
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = { value = 10.3, u = 0.5 }
c_m_s = 2455
q = { same_as = "ml2" }
thickness_mm = 0.139
[[layers]]
name = "ml2"
kind = "elastic"
z_MRayl = 3
c_m_s = 2455
q = { value = 60, u = 30 }
thickness_mm = 0.139
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "thin"
layers = ["disk"]
reground = { disk = { thickness_mm = 0.45 } }
[[steps]]
name = "ml1"
layers = ["disk", "ml1"]
[[steps]]
name = "ml2"
layers = ["disk", "ml1", "ml2"]
"""
WIDE = np.linspace(1e6, 15e6, 801)
LOW = np.arange(100e3, 700e3, 200.0)


@pytest.fixture
def glued() -> Build:
    return parse_build(GLUED)


@pytest.fixture
def recorded(glued: Build, swept: Callable[..., Sweep]) -> Callable[..., FitTask]:
    """Tasks of some steps of the glued build."""

    def make(*steps: str, **wishes: object) -> FitTask:
        sweeps = {step: (swept(stack_of(glued, glued.step(step)), WIDE),) for step in steps}
        return FitTask(glued, sweeps, **wishes)  # type: ignore[arg-type]

    return make


def refused(fitter: object, task: FitTask) -> str:
    """The error sentence of a fitter."""
    with pytest.raises(FitError) as caught:
        fitter.fit(task)  # type: ignore[attr-defined]
    return str(caught.value)


KT2 = Options(objective="kt2")


@pytest.mark.parametrize(
    ("fitter", "steps", "wishes", "says"),
    [
        (ButterworthVanDyke, ("disk", "ml1"), {}, "`bvd` fits one recording; 2 were given"),
        (Mason, (), {}, "no recording of any step of build 'G' was given"),
        (
            Mason,
            ("disk", "ml1"),
            {"options": KT2},
            "the objective kt2 is about the bare piezo disk alone; steps disk, ml1 were given",
        ),
        (
            Mason,
            ("thin",),
            {"options": KT2},
            "the objective kt2 is about the disk as it came; before step 'thin' it was ground",
        ),
        (Mason, ("ml2",), {"free": ("ml1.q",)}, "cannot free 'ml1.q': it is tied to ml2.q; free that"),
        (
            SherritThickness,
            ("disk",),
            {"free": ("disk.c33D",)},
            "`sherrit-thickness` reads all constants off the recording: it cannot free disk.c33D alone",
        ),
        (
            MasonNelderMead,
            ("disk",),
            {"free": ("disk.c33D",)},
            "the procedure of `mason-nelder-mead` is fixed: it cannot free disk.c33D alone",
        ),
        (
            MasonNelderMead,
            ("ml1",),
            {},
            "mason-nelder-mead begins with the bare piezo disk; no recording of such a step was given",
        ),
        (
            SherritThickness,
            ("ml1",),
            {},
            "`sherrit-thickness` needs the bare piezo disk; the recordings are of ml1, which hold glued layers",
        ),
        (
            SherritRadial,
            ("disk",),
            {},
            "`sherrit-radial` needs a round disk: build 'G' gives area_mm2; write diameter_mm if it is round",
        ),
    ],
)
def test_a_wish_that_this_build_does_not_grant(
    recorded: Callable[..., FitTask], fitter: type, steps: tuple[str, ...], wishes: dict[str, object], says: str
) -> None:
    assert refused(fitter(), recorded(*steps, **wishes)) == says


@pytest.mark.parametrize("fitter", [SherritRadial, RadialLeastSquares, Disk2DFitter])
def test_a_ring_is_for_stack2d(recorded: Callable[..., FitTask], fitter: type) -> None:
    task = recorded("disk")
    sizes = {"diameter": Quantity(16e-3), "hole_diameter": Quantity(4e-3)}
    assert refused(fitter(), replace(task, build=replace(task.build, **sizes))) == (
        f"`{fitter.name}` covers disks without a hole; build 'G' gives hole_diameter_mm: fit it with stack2d"
    )


def radial_disk(build: Build) -> RadialDisk:
    layer = build.layer("disk").values
    return RadialDisk.of("disk", SHERRIT_RADIAL, build.area.re, layer["thickness"].re, layer["density"].re)


@pytest.mark.parametrize(
    ("fitter", "thickness", "free", "says"),
    [
        (RadialLeastSquares, 0.5, ("disk.c33D",), "cannot free 'disk.c33D': `radial` has "),
        (Disk2DFitter, 1.0, ("disk.x",), "cannot free 'disk.x': `disk2d` has "),
        (
            Disk2DFitter,
            1.0,
            ("disk.c11E",),
            "`disk2d` frees all ten constants together; 'disk.c12E' is not among those to free",
        ),
    ],
)
def test_a_constant_that_this_fitter_does_not_free_alone(
    disk_build, swept, fitter: type, thickness: float, free: tuple[str, ...], says: str
) -> None:
    build = disk_build("PZT-5A", (10.0, thickness, 7800.0))
    task = FitTask(build, {"disk": (swept(radial_disk(build), LOW),)}, free)
    assert refused(fitter(), task).startswith(says)


def test_a_band_too_near_the_resonance_to_show_a_permittivity(disk_build, swept) -> None:
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0))
    near = FitTask(build, {"disk": (swept(stack_of(build, build.steps[0]), np.arange(3.4e6, 4.65e6, 1e3)),)})
    assert refused(SherritThickness(), near) == (
        "the recording ends at 4.649 MHz, too near the resonance to show eps33S; sweep up to 8.62 MHz, or down to "
        "3.09 MHz"
    )
    unknown = disk_build("PZT-5H", (10.0, 0.5, 7800.0))  # a material without a known radial permittivity
    bands = (np.arange(186e3, 250e3, 100.0), np.arange(496e3, 540e3, 100.0))
    parts = tuple(swept(radial_disk(build), band) for band in bands)
    assert refused(SherritRadial(), FitTask(unknown, {"disk": parts})) == (
        "the recordings hold no frequency far enough from the resonances to show eps33T; add one down to 98.6 kHz, or "
        "give eps33T_r in build.toml"
    )


def test_bands_without_what_a_fitter_looks_for(disk_build, swept) -> None:
    build = disk_build("PZT-5A", (10.0, 0.5, 7800.0))
    cut = FitTask(build, {"disk": (swept(radial_disk(build), np.arange(100e3, 200e3, 100.0)),)})
    assert refused(RadialLeastSquares(), cut).startswith("no antiresonance of the first radial mode in 100-199.9 kHz: ")
    f = np.linspace(1e5, 2e5, 101)
    capacitor = FitTask(build, {"disk": (Sweep(f, (1 - 0.02j) / (2j * np.pi * f * 1e-9), id="c.csv"),)})
    assert refused(ButterworthVanDyke(), capacitor) == "c.csv shows no resonance with an antiresonance above it"


def test_a_recording_of_something_that_gives_power(disk_build, swept) -> None:
    build = disk_build("Pz27", (16.0, 0.5, 7700.0))
    sweep = swept(stack_of(build, build.steps[0]), WIDE)
    active = replace(sweep, impedance=sweep.impedance - 3 * np.abs(sweep.impedance))
    says = "sweep has a negative resistance at 100% of its points; no passive device has that"
    assert refused(Mason(), FitTask(build, {"disk": (active,)})) == says


def test_a_peak_that_is_no_resonance() -> None:
    f = np.linspace(1e6, 1.1e6, 401)
    x = (f - 1.05e6) / 2e3
    peak = 1 / (1 - 1j * x)  # conjugated, so that its reactance has the opposite slope
    with pytest.raises(FitError, match=r"for a resonance they lie below and above it"):
        critical(ImmittanceTrace(f, peak, np.full(f.size, 1e-4)), 200, "fs")


def test_extremes_that_too_few_points_show() -> None:
    f = np.linspace(1e6, 1.1e6, 401)
    width = 4.0 * 250  # points 250 Hz apart: enough to see a width, too few for a polynomial at its flank
    x = (f - 1.05e6) / width
    peak = 1 / (1 + 1j * x)
    gap = (np.abs(f - 1.05e6 - width) > 3.5 * 250) | (np.abs(f - 1.05e6) < 600)
    trace = ImmittanceTrace(f[gap], peak[gap], np.full(int(gap.sum()), 1e-4))
    with pytest.raises(FitError, match=r"^fs near .* kHz: too few points there to see where its extremes are$"):
        critical(trace, int(np.argmax(trace.values.real)), "fs")


def test_critical_frequencies_that_say_nothing() -> None:
    with pytest.raises(FitError, match="most values within their noise belong to no possible material"):
        drawn(lambda rng: {"kt": complex(np.nan if rng.random() < 0.9 else 0.5)})
    f = np.linspace(1e6, 2e6, 11)
    far = f, 1 / (2j * np.pi * f * 1e-9), 1e-4
    sizes = {"thickness": 5e-4, "area": 2e-4, "density": 7700.0}
    with pytest.raises(FitError, match=r"the resonance lies at 4.1e.06 Hz, above the antiresonance at 4e.06 Hz"):
        _constants(4.1e6 + 0j, 4.0e6 + 0j, far, 1.0 + 0j, sizes)
    capacitor = Sweep(f, (1 - 0.02j) / (2j * np.pi * f * 1e-9), id="c.csv")
    with pytest.raises(
        FitError, match=r"^c\.csv shows no resonance with an antiresonance above it between 1 and 2 MHz"
    ):
        disk_starts(capacitor, 5e-4, 7700.0, 2e-4)


def test_a_bootstrap_whose_fits_hardly_converge() -> None:
    says = "bootstrap: 4 of 5 repeated fits did not converge; no interval can be given"
    with pytest.raises(FitError, match=says):
        with_draws({}, {}, (), Draws(({"disk.c33D.re": 1e11},), 4))


def test_a_fitter_that_does_not_load(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = EntryPoint("broken", "no_such_module:Fitter", plugins.GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [broken])
    with pytest.raises(plugins.PluginError, match=r"fitter 'broken' of .* does not load: ModuleNotFoundError"):
        plugins.load_fitter("broken")


class _Demanding:
    """A fitter with the documented signature that raises its own exception."""

    name, version, summary = "demanding", "1", "asks for progress"

    def fit(self, task, progress):
        progress("dividing")
        return 1 / 0


def test_an_exception_of_a_documented_fitter_is_one_sentence() -> None:
    heard: list[str] = []
    with pytest.raises(plugins.PluginError, match=r"^fitter 'demanding' failed: ZeroDivisionError: division by zero$"):
        plugins.run(_Demanding(), FitTask(None, {}), heard.append)
    assert heard == ["dividing"]
