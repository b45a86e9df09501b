"""A quality factor that a recording does not determine is said so in every table of constants."""

from dataclasses import replace
from io import StringIO

import numpy as np
from rich.console import Console

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.page.page_json import fitted_json
from pzctl.daemon.report.document.report_sections import constants
from pzctl.daemon.report.tables.fit_tables import print_fit
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.fitters.layered.nelder_mead import MasonNelderMead
from pzctl.models.build import Quantity
from pzctl.models.sweep import Sweep


def test_a_layer_without_losses_has_no_quality_factor() -> None:
    """The thesis's procedure ends at 1.5e13, which stood in the table, 2.5e13 % off the data sheet."""
    build, f = read_build(THESIS_BUILD), np.linspace(1e6, 15e6, 801)
    lossless = replace(
        build,
        layers=tuple(
            replace(one, values={**one.values, "q": Quantity(1e9)}) if one.name == "ml1" else one
            for one in build.layers
        ),
    )
    rng = np.random.default_rng(1)
    noise = [1e-3 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)) for _ in range(2)]
    impedances = [
        stack_of(lossless, step).impedance(f) * np.exp(n) for step, n in zip(build.steps, noise, strict=False)
    ]
    sweeps = {step.name: (Sweep(f, z),) for step, z in zip(build.steps, impedances, strict=False)}
    fit = MasonNelderMead().fit(FitTask(build, sweeps))
    printed = StringIO()
    console = Console(width=160, file=printed)
    assert fit.constants["ml1.q"].re > 1e6
    assert fit.says[0] == "ml1.q is not determined: the fit finds no losses in 'ml1'."
    print_fit(console, fit, build)
    (row,) = (line for line in printed.getvalue().splitlines() if "ml1.q" in line and "│" in line)
    assert [cell.strip() for cell in row.split("│")[1:-1]] == ["ml1.q", "not determined", "1", "60(30)", ""]
    assert "<td>ml1.q</td><td>not determined</td>" in constants(fit, build).replace("\n", "")
    assert fitted_json(fit, "ml1")["undetermined"] == ["ml1.q"]
