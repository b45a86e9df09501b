"""A fit result as JSON, the object of `pzctl fit --json`, with its curves as raw columns."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np

from ...fitters.interface import Budget, Constant, Curve, FitResult, Noise
from .frames import Array, ColumnHeader, WireError, pack

CURVE_PARTS = ("frequency", "measured", "start", "fitted")
"""The columns of one curve: frequency in Hz, impedances in ohm."""
EXPLAINED = "explained"
"""A column that a curve may have: the fit with the most probable errors, ohm."""

LARGEST_CURVES = 12 << 20
"""Greatest size in bytes of the curves of one message; a request has at most 16 MiB. The 200,000 points of the largest
measurement take 11 MB without `explained`."""

T = TypeVar("T")


class NoiseReport(msgspec.Struct, frozen=True):
    """Relative noise per point, and the source of this value."""

    relative: float
    source: str = msgspec.field(name="from")


class FitReport(msgspec.Struct, frozen=True):
    """A fit's result; SI units."""

    build: str
    fitter: str
    version: str
    steps: tuple[str, ...]
    noise: NoiseReport
    chi2_per_dof: float
    constants: dict[str, Constant]
    derived: dict[str, Constant]
    correlation: tuple[tuple[str, str, float], ...]
    rms_log_error: float
    converged: bool
    evaluations: int
    seconds: float
    says: tuple[str, ...] = ()
    budget: Budget | None = None
    """The contributions to the uncertainties; None if the fitter gives none."""
    chosen: dict[str, Any] | None = None
    """The choices of a manual fit: `by`, `free`, `values`, `bands` (Hz), `effects`."""


def report_of(result: FitResult) -> FitReport:
    """Return the result without its curves."""
    fields = {name: getattr(result, name) for name in FitReport.__struct_fields__ if name != "noise"}
    return FitReport(noise=NoiseReport(result.noise.relative, result.noise.source), **fields)


def result_of(report: FitReport, curves: Sequence[Curve] = ()) -> FitResult:
    """Return the report and its curves as a fit result."""
    fields: dict[str, Any] = {name: getattr(report, name) for name in FitReport.__struct_fields__}
    fields["noise"] = Noise(report.noise.relative, report.noise.source)
    return FitResult(**fields, curves=tuple(curves))


def curve_columns(curves: Sequence[Curve]) -> tuple[tuple[ColumnHeader, ...], tuple[bytes, ...]]:
    """Return the columns of all curves, named `0.frequency`, `0.measured` ..., and their bytes.

    Curves beyond `LARGEST_CURVES` keep every second point, or every third ...: they are for pictures.
    """
    size = sum(getattr(curve, part).nbytes for curve in curves for part in _parts(curve))
    every = max(1, math.ceil(size / LARGEST_CURVES))
    packed = [
        pack(f"{k}.{part}", "Hz" if part == "frequency" else "ohm", getattr(curve, part)[::every])
        for k, curve in enumerate(curves)
        for part in _parts(curve)
    ]
    return tuple(column for column, _ in packed), tuple(frame for _, frame in packed)


def _parts(curve: Curve) -> tuple[str, ...]:
    return CURVE_PARTS if curve.explained is None else (*CURVE_PARTS, EXPLAINED)


def curves_of(steps: Sequence[str], arrays: Mapping[str, Array]) -> tuple[Curve, ...]:
    """Return the curves. Raises WireError if a column is missing, or differs in length from its frequencies."""
    curves: list[Curve] = []
    for k, step in enumerate(steps):
        missing = [part for part in CURVE_PARTS if f"{k}.{part}" not in arrays]
        if missing:
            raise WireError(f"message: curve {k} ({step}) has no column {missing[0]!r}")
        present = (*CURVE_PARTS, EXPLAINED) if f"{k}.{EXPLAINED}" in arrays else CURVE_PARTS
        f, *z = (arrays[f"{k}.{part}"] for part in present)
        if any(f.ndim != 1 or part.shape != f.shape for part in z):
            raise WireError(f"message: the columns of curve {k} ({step}) differ in length")
        curves.append(Curve(step, f.real, *(np.asarray(part, dtype=np.complex128) for part in z)))
    return tuple(curves)
