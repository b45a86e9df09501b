"""No table breaks a name or a number, or cuts it, in a terminal of 60, 80 or 120 columns."""

import io
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from pzctl.daemon.cli.analysis import effects, fitters, materials
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.report import terminal
from pzctl.daemon.report.tables.budget_table import print_budget
from pzctl.daemon.report.tables.comparison_output import print_many
from pzctl.daemon.report.tables.diagnosis_output import diagnosis_json, print_constants, print_diagnosis
from pzctl.daemon.report.tables.fit_tables import print_fit
from pzctl.daemon.report.tables.population_table import print_population
from pzctl.daemon.samples.sample_selection import sheets_of
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.findings import Alternative, Diagnosis, NotDecidable, Size
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitResult, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.population.population_statistics import population
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
Printer = Callable[[Console], None]
NOTE = {"not", "shown", "at", "this", "width:"}
"""Beginning of the line that says which columns are left out."""


def swept(step: str, lead: float = 0.0) -> Sweep:
    f = np.linspace(1e6, 8e6, 201)
    rng = np.random.default_rng(5)
    Z = stack_of(BUILD, next(one for one in BUILD.steps if one.name == step)).impedance(f) + 2j * np.pi * f * lead
    return Sweep(f, Z * np.exp(3e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))))


@pytest.fixture(scope="module")
def fit() -> FitResult:
    steps = BUILD.steps[:2]
    return Mason().fit(FitTask(BUILD, {step.name: (swept(step.name),) for step in steps}))


@pytest.fixture(scope="module")
def diagnosis() -> Diagnosis:
    found = diagnose(FitTask(BUILD, {"disk": (swept("disk", 2e-8),)}), ["lead-inductance"])
    (finding, *_) = found.findings
    rivals = (Alternative("dielectric-dispersion", "layer:disk", 0.021), Alternative("cable", "terminals", 0.012))
    sizes = {**finding.parameters, "resistance": Size(2e-12, 1.9e-11, "ohm")}
    hidden = NotDecidable(
        "thickness-variation",
        "interface:glue1|ml1",
        {"capacitance": Size(1.234e-11, 1e-12, "F")},
        {"disk.eps33S.im": 0.0213, "disk.h33": -0.001},
        "a sweep of 12-15 MHz at 801 points, or the weight of the electrode",
    )
    told = replace(finding, parameters=sizes, alternatives=rivals, bands_Hz=((4.1e6, 15e6), (1e6, 2.25e6)))
    return replace(found, findings=(told,), not_decidable=(hidden,))


MANY: dict[str, Any] = {
    "says": ["Two devices changed."],
    "common": [],
    "outliers": ["before-and-after-the-oven.csv"],
    "devices": [
        {
            "file": "before-and-after-the-oven.csv",
            "verdict": "partly-explained",
            "change": 0.01234,
            "findings": [
                {
                    "effect": "shunt-inductance",
                    "removed": True,
                    "parameters": {"inductance": {"value": 2e-12, "u": 1.9e-11, "unit": "H"}},
                }
            ],
            "resonances": [],
        }
    ],
}


def words(show: Printer, width: int) -> set[str]:
    """Return the words that are printed, without frames; no line may be longer than the terminal is wide."""
    paper = io.StringIO()
    show(Console(file=paper, width=width, markup=False))
    lines = paper.getvalue().splitlines()
    assert max(len(line.rstrip()) for line in lines) <= width
    return set(re.sub(r"[━─│┃┡┩┏┓┗┛└┘├┤┼╇┳┻╋┴┬╈]", " ", "\n".join(lines)).split())


def of_command(monkeypatch: pytest.MonkeyPatch, command: Callable[..., None], *arguments: Any) -> Printer:
    def show(screen: Console) -> None:
        monkeypatch.setattr(terminal, "console", lambda: screen)
        command(*arguments)

    return show


@pytest.fixture(params=["fit", "diagnosis", "constants", "budget", "population", "many", "effects", "one effect"])
def table(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Printer:
    match request.param:
        case "fit" | "budget" | "population" as kind:
            fit: FitResult = request.getfixturevalue("fit")
            if kind == "fit":
                return lambda screen: print_fit(screen, fit, BUILD)
            if kind == "budget":
                return lambda screen: print_budget(screen, fit)
            statistics = population({"S4": fit, "S5": fit, "S6": fit}, sheets_of((BUILD, BUILD)))
            return lambda screen: print_population(screen, statistics)
        case "diagnosis" | "constants" as kind:
            diagnosis: Diagnosis = request.getfixturevalue("diagnosis")
            told = diagnosis_json(diagnosis)
            return lambda screen: (print_constants if kind == "constants" else print_diagnosis)(screen, told)
        case "many":
            return lambda screen: print_many(screen, MANY)
        case "effects":
            return of_command(monkeypatch, effects.effects, None, None, None, False)
        case _:
            return of_command(monkeypatch, effects.effects, "bond-void", None, None, False)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_a_narrow_terminal_breaks_no_word(table: Printer, width: int) -> None:
    assert words(table, width) - NOTE <= with_semicolon(words(table, 1000))


def with_semicolon(known: set[str]) -> set[str]:
    """Return the words as they stand in a table, and as heads that a line lists which are left out."""
    return known | {f"{word};" for word in known}


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_lists_break_no_name(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for command, *arguments in (
        (materials.materials, "Pz27", False),
        (materials.materials, None, False),
        (fitters.fitters,),
    ):
        show = of_command(monkeypatch, command, *arguments)
        assert words(show, width) - NOTE <= with_semicolon(words(show, 1000))


def test_a_fit_keeps_all_its_columns_at_80_and_says_what_60_leave_out(fit: FitResult) -> None:
    paper = {60: io.StringIO(), 80: io.StringIO()}
    for width, sheet in paper.items():
        print_fit(Console(file=sheet, width=width, markup=False), fit, BUILD)
    assert "not shown" not in paper[80].getvalue()
    assert "not shown at this width: data sheet, build" in paper[60].getvalue()
