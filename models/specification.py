"""Limits for the constants of a transducer, and the required probability of a verdict."""

from collections.abc import Mapping
from dataclasses import dataclass

from .base.errors import PzctlError

USUAL_CONFORMANCE = 0.95
"""Default probability required for a verdict, as in ISO 14253-1:2017."""


class SpecificationError(PzctlError):
    """Impossible limits, or limits of a constant that the transducer does not have."""


@dataclass(frozen=True)
class Limit:
    """The permitted range of a real value in SI units; at least one end is given."""

    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        """Raise SpecificationError if the limit is impossible."""
        if self.low is None and self.high is None:
            raise SpecificationError("a limit needs a min or a max")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise SpecificationError(f"min {self.low:g} is not below max {self.high:g}")


@dataclass(frozen=True)
class Specification:
    """The limits of a transducer's constants."""

    limits: Mapping[str, Limit]
    """By constant: `disk.c33D` for its real part, `disk.c33D.im` for its imaginary part."""
    conformance: float = USUAL_CONFORMANCE
    """Probability with which a value must keep (or violate) its limit for a verdict of pass (or fail)."""

    def __post_init__(self) -> None:
        """Raise SpecificationError if the probability is out of range."""
        if not 0.5 <= self.conformance < 1:
            raise SpecificationError(f"conformance is {self.conformance:g}; 0.5 (no guard band) to below 1 is allowed")
