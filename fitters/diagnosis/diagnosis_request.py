"""What a diagnosis is asked for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..engine.fitted_model import Diagnosable
from ..interface import FitTask
from .hypotheses.bench_effects import BenchEffect


@dataclass(frozen=True, eq=False)
class DiagnosisRequest:
    """What a diagnosis is asked for; see `diagnose`."""

    effects: tuple[str, ...] | None
    progress: Callable[[str], None]
    hold_out: str
    others: Mapping[str, FitTask]
    learn: bool
    known: tuple[BenchEffect, ...]
    jobs: int
    fitter: Diagnosable | None
    refuse_impossible: bool
