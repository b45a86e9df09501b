"""How a hypothesis is to be fitted: where the fit begins, and how far it goes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from ....models.effects.base.corrected_constants import Corrections
from ...error_model.error_sizes import ErrorSizes
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate


@dataclass(frozen=True, eq=False)
class Plan:
    """Start of a fit with these effects."""

    effects: tuple[Candidate, ...]
    values: Mapping[str, float]
    sizes: tuple[ErrorSizes, ...]
    near: bool = False
    rounds: int = 3
    fixed: bool = False
    """Whether errors have the first of these sizes."""
    others: tuple[Mapping[str, float], ...] = ()
    """Further values from which it may start."""
    compared: bool = False
    """Whether its evidence has to settle; a first fit only shows whether it is worth while."""
    about: Corrections | None = None
    """Corrections about which the errors of a fit are linear that ended at `values`."""

    @classmethod
    def after(cls, one: Hypothesis, sizes: tuple[ErrorSizes, ...], rounds: int = 3, *, fixed: bool = False) -> Self:
        """Return the continuation of a fit."""
        about = one.fit.minimum.corrections
        return cls(one.effects, one.values, sizes, near=True, rounds=rounds, fixed=fixed, compared=True, about=about)
