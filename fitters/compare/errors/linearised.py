"""A hypothesis at the point where it is linearised, and what the pair says of it there."""

from dataclasses import dataclass

from ....models.base.arrays import Complexes, Impedances, Reals
from .pair_sizes import Sizes


@dataclass(frozen=True, eq=False)
class Linearised:
    """A hypothesis about a pair, linearised at one point: its prediction and derivatives."""

    predicted: Impedances
    through: Complexes
    """d ln Z predicted / d ln Z before, shape (N,)."""
    slopes: Complexes
    """d ln Z predicted / d coordinate, shape (N, P); each coordinate has a unit normal prior."""
    shapes: Complexes
    """d ln Z predicted / d ln of each change's main size, shape (N, K)."""
    x: Reals
    """The coordinates, shape (P,)."""
    inside: tuple[int, ...]
    """Mask of the coordinates of changes in the device."""
    frequency: Reals
    """Hz, shape (N,)."""
    each: Complexes | None = None
    """For changes in the device: derivatives by ln frequency, ln Q, ln strength of each resonance before, (N, 3P)."""
    model: Complexes | None = None
    """Errors of ln Z predicted by the model of a build's device, each of a unit normal prior, shape (N, K)."""
    offset: Reals | None = None
    """Their coefficients about which the model is linearised, shape (K,)."""
    formula: Reals | None = None
    """Coefficients of the errors of the changes' formulas about which they are linearised; None for zeros."""
    exact: tuple[bool, ...] = ()
    """Of each change with sizes, whether the error of its formula is known beyond first order."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """The evidence of a pair for a hypothesis, errors and coordinates integrated out."""

    log_evidence: float
    """Ln evidence, summed over the sizes of the rest."""
    usual: float
    """Fraction of the evidence with a rest of usual size."""
    sizes: Sizes
    """The most probable."""
    x: Reals
    """Posterior mean of the coordinates, shape (P,), by one step from the point of linearisation."""
    covariance: Reals
    """Covariance of the coordinates, shape (P, P)."""
    cost: float
    """chi2 of the pair and all priors at these sizes."""
    left: Complexes
    """Residual that only rest and noise describe, shape (N,)."""
    total: Reals
    """The coordinates including the part imitated by drift, shape (P,)."""
    moved: Reals
    """Drift of each resonance in ln frequency, then in ln Q, then in ln strength, shape (3P,)."""
    model: Reals
    """Coefficients of the errors of a build's device, shape (K,)."""
    formula: Reals
    """Coefficients of the errors of the changes' formulas, shape (K,)."""
    imitated: Reals
    """Part of the coordinates that these errors imitate: `x` is a size with it, shape (P,) for each, (P, K)."""
