"""Fits, diagnoses and comparisons for scripts and notebooks: results that draw and show themselves."""

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeAlias

from rich.console import Console

from ...drivers.recordings import read_recording
from ...fitters.compare.compare import compare as run_comparison
from ...fitters.compare.comparison import Comparison
from ...fitters.diagnosis.diagnose import diagnose as run_diagnosis
from ...fitters.diagnosis.diagnose import fitter_to_diagnose
from ...fitters.diagnosis.findings import Diagnosis, Finding
from ...fitters.engine.on_cores import available_cores
from ...fitters.engine.parameters.assembly import stack_of
from ...fitters.engine.parameters.overrides import Amendments, amended
from ...fitters.interface import Constant, FitResult, FitTask, Options, TaskError
from ...fitters.plugins import DEFAULT, load_fitter, run
from ...fitters.user_effects import find_any_effect
from ...models.build import Build
from ...models.stack import Stack
from ...models.sweep import Sweep
from ..files.builds.build_file import read_build
from .json_output.comparison_json import comparison_json
from .json_output.fit_json import fit_json
from .pictures.comparison_picture import comparison_figure
from .pictures.diagnosis_picture import diagnosis_figure
from .pictures.fit_pictures import fit_figure
from .pictures.svg_pictures import svg_of
from .tables.comparison_output import print_comparison
from .tables.diagnosis_output import diagnosis_curves, diagnosis_json, print_constants, print_diagnosis
from .tables.fit_tables import print_fit

_threadpoolctl: Any = import_module("threadpoolctl")  # it has no types

Recording: TypeAlias = Sweep | str | Path
"""A sweep, or the file of one."""
Recordings: TypeAlias = Recording | Sequence[Recording]
"""One or more; several are repeats or further segments."""

_NEEDED = "{step: recording} is needed, for example {'disk': 'disk.csv'}"
_WIDTH = 120
"""Characters of a line of a table."""


@dataclass(frozen=True, eq=False)
class FitAnalysis:
    """Result of a fit. In a notebook it shows its table and its curves."""

    result: FitResult
    build: Build | None

    @property
    def constants(self) -> Mapping[str, Constant]:
        """Fitted, held and derived constants by name (`disk.c33D`), SI."""
        return {**self.result.constants, **self.result.derived}

    def __getitem__(self, name: str) -> Constant:
        """Return a constant. Raises KeyError with the names that there are."""
        return _by_name(self.constants, name)

    @property
    def chi2_per_dof(self) -> float:
        """Misfit in units of the noise."""
        return self.result.chi2_per_dof

    def to_json(self) -> dict[str, Any]:
        """Return the object that `pzctl fit --json` prints."""
        return fit_json(self.result, self.build)

    def plot(self) -> Any:
        """Return a Matplotlib figure of measured and fitted curves and the residual."""
        return fit_figure(self.result)

    def __str__(self) -> str:
        return _text(lambda console: print_fit(console, self.result, self.build))

    def _repr_html_(self) -> str:
        return _html(lambda console: print_fit(console, self.result, self.build), self.plot(), "fit")


@dataclass(frozen=True, eq=False)
class DiagnosisAnalysis:
    """Result of a diagnosis. In a notebook it shows its findings, constants and curves."""

    result: Diagnosis
    build: Build | None

    @property
    def verdict(self) -> str:
        """`no-mismatch`, `explained`, `partly-explained` or `unexplained`."""
        return self.result.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The effects that the model lacks, the most important first."""
        return self.result.findings

    @property
    def constants(self) -> Mapping[str, Constant]:
        """Constants fitted with the findings, by name, SI."""
        return self.result.final.constants

    def __getitem__(self, name: str) -> Constant:
        """Return a constant. Raises KeyError with the names that there are."""
        return _by_name(self.constants, name)

    def to_json(self) -> dict[str, Any]:
        """Return the object that `pzctl diagnose --json` prints."""
        return diagnosis_json(self.result)

    def plot(self) -> Any:
        """Return a Matplotlib figure of the curves with and without the findings."""
        return diagnosis_figure(self.to_json(), diagnosis_curves(self.result), self.build)

    def _print(self, console: Console) -> None:
        shown = self.to_json()
        print_diagnosis(console, shown)
        print_constants(console, shown)

    def __str__(self) -> str:
        return _text(self._print)

    def _repr_html_(self) -> str:
        return _html(self._print, self.plot(), "diagnosis")


@dataclass(frozen=True, eq=False)
class ComparisonAnalysis:
    """Result of a comparison. In a notebook it shows what changed, with the curves."""

    result: Comparison

    @property
    def verdict(self) -> str:
        """`unchanged`, `explained`, `partly-explained` or `unexplained`."""
        return self.result.verdict

    def to_json(self) -> dict[str, Any]:
        """Return the object that `pzctl compare --json` prints."""
        return comparison_json(self.result)

    def plot(self) -> Any:
        """Return a Matplotlib figure of both recordings, the change and its explanation."""
        return comparison_figure(self.to_json(), self.result.curve)

    def __str__(self) -> str:
        return _text(lambda console: print_comparison(console, self.to_json()))

    def _repr_html_(self) -> str:
        return _html(lambda console: print_comparison(console, self.to_json()), self.plot(), "comparison")


def read(path: str | Path, columns: str | None = None) -> Sweep:
    """Read a recording: 4294A and E4990A exports, tables, Touchstone, NetCDF, HDF5. Raises RecordingError.

    `columns`: names of the columns of a table without header row, such as `frequency_Hz,R_ohm,X_ohm`.
    """
    return read_recording(Path(path), columns)


def model(build: Build | str | Path, step: str) -> Stack:
    """Return the model of a step with the build's values: `.impedance(f)`, `.replace({"disk.c33D.re": 1.4e11})`.

    Raises TaskError if the build has no such step.
    """
    known = _build(build)
    names = [one.name for one in known.steps]
    if step not in names:
        raise TaskError(f"build {known.name!r} has no step {step!r}; it has {', '.join(names)}")
    return stack_of(known, known.step(step))


def fit(
    build: Build | str | Path | None,
    recordings: Mapping[str, Recordings],
    *,
    fitter: str = DEFAULT,
    free: Iterable[str] | None = None,
    hold: Iterable[str] = (),
    tie: Mapping[str, str] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    bound: Mapping[str, tuple[float, float]] | None = None,
    objective: Literal["log", "thesis", "kt2"] = "log",
    uncertainty: Literal["covariance", "profile", "bootstrap"] = "covariance",
    procedure: Literal["joint", "sequential", "frozen"] = "joint",
) -> FitAnalysis:
    """Fit the complex constants of a build, or of its file, to the recordings of its steps.

    `free`: names of the constants to fit; None for all that have an uncertainty. `hold`: names of constants to hold.
    `tie`: the constant that another equals, `{"glue2.z": "glue1.z"}`. `prior`: value and standard uncertainty, `bound`:
    lowest and highest value, SI. `objective`, `uncertainty`, `procedure`: see `Options`. Raises FitError, TaskError,
    RecordingError, PluginError or BuildError with one sentence.
    """
    changes = Amendments(
        _names("hold", hold),
        tuple((tie or {}).items()),
        _pairs("prior", "value and standard uncertainty", prior or {}),
        _pairs("bound", "lowest and highest value", bound or {}),
    )
    if build is None and changes != Amendments():
        raise TaskError("hold, tie, prior and bound name constants of a build; give a build as well")
    known = None if build is None else amended(_build(build), changes)
    names = None if free is None else _names("free", free)
    task = FitTask(known, _sweeps(recordings), names, Options(objective, uncertainty, procedure))
    with _one_thread():
        return FitAnalysis(run(load_fitter(fitter), task), known)


def diagnose(
    build: Build | str | Path | None,
    recordings: Mapping[str, Recordings],
    *,
    effects: Iterable[str] | None = None,
    learn: bool = False,
    fitter: str = DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
) -> DiagnosisAnalysis:
    """Say where recordings and model differ, and which physics is missing.

    `effects`: the effects to consider; None for all of the catalogue. `learn`: whether to look for a law of what none
    of them explains. `fitter`: whose model is diagnosed, `mason` or, for what is no stack, `radial`, `disk`, `disk2d`
    or `bvd`; only `bvd` needs no build. Uses all cores. Raises FitError, TaskError, RecordingError, EffectError,
    PluginError or BuildError with one sentence.
    """
    known = None if build is None else _build(build)
    chosen = None if effects is None else tuple(find_any_effect(name).name for name in _names("effects", effects))
    task = FitTask(known, _sweeps(recordings))
    model = fitter_to_diagnose(fitter)
    with _one_thread():
        found = run_diagnosis(
            task, chosen, progress, learn=learn, jobs=available_cores(), fitter=model, refuse_impossible=True
        )
    return DiagnosisAnalysis(found, known)


def compare(before: Recordings, after: Recordings) -> ComparisonAnalysis:
    """Say what changed between recordings of a device, of which nothing else need be known.

    Raises TaskError or RecordingError with one sentence.
    """
    with _one_thread():
        return ComparisonAnalysis(run_comparison(_all(before), _all(after)))


def _one_thread() -> AbstractContextManager[object]:
    """Return a context with one thread for linear algebra: on small matrices several only wait for each other.

    A diagnosis took ten times as long with them. The command line sets it before NumPy is loaded; a script may have
    loaded it long ago.
    """
    return _threadpoolctl.threadpool_limits(limits=1, user_api="blas")


def _build(build: Build | str | Path) -> Build:
    return build if isinstance(build, Build) else read_build(build)


def _names(option: str, given: Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple. Raises TaskError for a text, whose letters would be taken as names."""
    if isinstance(given, str):
        raise TaskError(f"{option} is the text {given!r}; a list of names is needed, for example [{given!r}]")
    return tuple(given)


def _pairs(option: str, needed: str, given: Mapping[str, Any]) -> tuple[tuple[str, float, float], ...]:
    """Return the names with their two numbers. Raises TaskError for anything else."""
    pairs: list[tuple[str, float, float]] = []
    for name, numbers in given.items():
        try:
            first, second = numbers
            pairs.append((name, float(first), float(second)))
        except (TypeError, ValueError):
            raise TaskError(f"{option} of {name!r} is {numbers!r}; two numbers are needed, {needed}, SI") from None
    return tuple(pairs)


def _sweeps(recordings: Mapping[str, Recordings]) -> dict[str, tuple[Sweep, ...]]:
    if not isinstance(recordings, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TaskError(f"recordings is {recordings!r}; {_NEEDED}")
    if not recordings:
        raise TaskError(f"no recording is given; {_NEEDED}")
    return {step: _all(of_step) for step, of_step in recordings.items()}


def _all(recordings: Recordings) -> tuple[Sweep, ...]:
    several = [recordings] if isinstance(recordings, Sweep | str | Path) else recordings
    return tuple(one if isinstance(one, Sweep) else read(one) for one in several)


def _by_name(constants: Mapping[str, Constant], name: str) -> Constant:
    if name not in constants:
        raise KeyError(f"no constant {name!r}; there are {', '.join(constants)}")
    return constants[name]


def _text(show: Callable[[Console], None]) -> str:
    console = Console(file=io.StringIO(), width=_WIDTH, record=True, markup=False, emoji=False)
    show(console)
    return console.export_text()


def _html(show: Callable[[Console], None], figure: Any, prefix: str) -> str:
    """Return what is printed, with the figure below it."""
    console = Console(file=io.StringIO(), width=_WIDTH, record=True, markup=False, emoji=False)
    show(console)
    printed = console.export_html(inline_styles=True, code_format="<pre style='line-height:1.2'>{code}</pre>")
    return f"<div>{printed}{svg_of(figure, prefix)}</div>"
