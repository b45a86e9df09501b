"""Statistics of the same constants of several samples: mean, scatter, uncertainty, outliers, and the data sheet.

Mean, variance and standard deviation are (2.28)-(2.30) of E. S. Tjelde, NTNU 2012, as in its tables 4.3-4.6 and 4.9;
the deviation from the data sheet is that of tables 4.1 and 4.2.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.build import Quantity
from ..interface import Constant, FitResult
from .random_effects import RandomEffects, outliers, random_effects

_MISFIT = 1.5  # chi2 per degree of freedom above which model and recording differ
_U_TO_LIMIT = math.sqrt(3)
# A tolerance of +- limit has the standard uncertainty limit/sqrt(3) (JCGM 100:2008, 4.3.7); this is the inverse.


@dataclass(frozen=True)
class SampleValue:
    """A real value of one sample."""

    sample: str
    value: float
    u: float | None
    """Standard uncertainty; None if the fitter gives none."""


@dataclass(frozen=True)
class DataSheet:
    """Comparison of the mean with the data sheet."""

    nominal: float
    percent: float | None
    """100 (mean/nominal - 1); None if nominal is 0."""
    limit: float | None
    """Tolerance: nominal +- limit; None if the sheet states none."""
    outside: tuple[str, ...]
    """Samples whose value is outside the tolerance."""

    @property
    def low(self) -> float | None:
        """Smallest value within the tolerance."""
        return None if self.limit is None else self.nominal - self.limit

    @property
    def high(self) -> float | None:
        """Largest value within the tolerance."""
        return None if self.limit is None else self.nominal + self.limit


@dataclass(frozen=True)
class VarianceShare:
    """The real or the imaginary part of a constant over the samples; units of the constant."""

    values: tuple[SampleValue, ...]
    mean: float
    variance: float | None
    """Variance of the sample values, with n - 1; None for a single sample, which has no scatter."""
    within: float | None
    """Root mean square of the samples' own standard uncertainties; None if a fitter gives none."""
    effects: RandomEffects | None
    """Scatter between samples without the uncertainty within; None for a single sample or without uncertainties."""
    outliers: Mapping[str, float]
    """Samples that do not belong to the rest, with the probability of such a deviation by chance. They are included."""
    sheet: DataSheet | None

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.values)

    @property
    def sd(self) -> float | None:
        """Standard deviation of the sample values; None for a single sample."""
        return None if self.variance is None else math.sqrt(self.variance)


@dataclass(frozen=True)
class Spread:
    """One constant over the samples."""

    unit: str
    re: VarianceShare
    im: VarianceShare | None
    """None if the constant is real, or its imaginary part was held."""


@dataclass(frozen=True)
class Population:
    """All fitted constants over all samples."""

    samples: tuple[str, ...]
    constants: Mapping[str, Spread]
    says: tuple[str, ...]
    """Omissions with their reasons, and sentences that a person must know to read the numbers."""


def population(fits: Mapping[str, FitResult], sheets: Mapping[str, Quantity]) -> Population:
    """Return the statistics over `fits`, by sample, of one fitter; `sheets` are data-sheet values by constant.

    Constants that were held, and fits that did not converge, are omitted and mentioned (fits of a fitter without
    uncertainties are included, because it promises no more). A constant that only some samples have, such as that of a
    later layer, is included with these samples.
    """
    used = {sample: fit for sample, fit in fits.items() if fit.converged or _is_silent(fit)}
    says: list[str] = []
    if left_out := [sample for sample in fits if sample not in used]:
        says.append(f"left out, the fit did not converge: {', '.join(left_out)}")
    if taken := [sample for sample, fit in used.items() if not fit.converged]:
        says.append(f"taken, though the fit did not converge: {', '.join(taken)}")
    constants, notes = spreads({sample: _all_of(fit) for sample, fit in used.items()}, sheets)
    says += notes
    return Population(tuple(used), constants, (*says, *_warnings(used, constants)))


def spreads(
    by_sample: Mapping[str, Mapping[str, Constant]], sheets: Mapping[str, Quantity]
) -> tuple[dict[str, Spread], list[str]]:
    """Return the statistics of every constant that was fitted, and sentences on those that were not."""
    constants: dict[str, Spread] = {}
    says: list[str] = []
    held: list[str] = []
    for name in dict.fromkeys(name for own in by_sample.values() for name in own):
        fitted = {sample: own[name] for sample, own in by_sample.items() if name in own}
        spread = _spread(fitted, sheets.get(name))
        if spread is None:
            held.append(name)
            continue
        constants[name] = spread
        if exact := sorted(fitted.keys() - {value.sample for value in spread.re.values}):
            says.append(f"{name}: without {', '.join(exact)}, where it was held or not determined")
    if held:
        says.append(f"held or not determined, so not in the table: {', '.join(held)}")
    return constants, says


def _all_of(fit: FitResult) -> dict[str, Constant]:
    return {**fit.constants, **{name: one for name, one in fit.derived.items() if name not in fit.constants}}


def _is_silent(fit: FitResult) -> bool:
    """Return whether the fitter gives no uncertainties, as the thesis's procedure."""
    return all(constant.u_re is None for constant in fit.constants.values())


def _spread(constants: Mapping[str, Constant], sheet: Quantity | None) -> Spread | None:
    """Return the statistics of one constant; None where it was held in every sample."""
    re = _fitted([SampleValue(sample, constant.re, constant.u_re) for sample, constant in constants.items()])
    im = _fitted([SampleValue(sample, constant.im, constant.u_im) for sample, constant in constants.items()])
    if not re:
        return None
    complex_ = any(value.value for value in im)
    return Spread(
        unit=next(iter(constants.values())).unit,
        re=_part(re, (sheet.re, sheet.u) if sheet else None),
        im=_part(im, (sheet.im, sheet.u_im) if sheet else None) if complex_ else None,
    )


def _fitted(values: list[SampleValue]) -> list[SampleValue]:
    """Return the values that were fitted: not held as exact, not infinite (Qm of a lossless ceramic), not undetermined.

    A fitter without uncertainties does not say what it held; a value that is exactly the same everywhere counts as
    held.
    """
    moving = [value for value in values if math.isfinite(value.value) and value.u != 0 and value.u != math.inf]
    silent = all(value.u is None for value in moving)
    alike = len(moving) > 1 and len({value.value for value in moving}) == 1
    return [] if silent and alike else moving


def _part(values: list[SampleValue], sheet: tuple[float, float] | None) -> VarianceShare:
    x = np.array([value.value for value in values])
    stated = [value.u for value in values if value.u is not None]
    u = np.array(stated) if len(stated) == len(values) else None
    several = len(values) > 1
    mean = float(np.mean(x))
    strange = outliers(x, np.zeros_like(x) if u is None else u)
    return VarianceShare(
        values=tuple(values),
        mean=mean,
        variance=float(np.var(x, ddof=1)) if several else None,
        within=None if u is None else float(np.sqrt(np.mean(u**2))),
        effects=random_effects(x, u) if several and u is not None else None,
        outliers={values[k].sample: chance for k, chance in strange.items()},
        sheet=None if sheet is None else _against(values, mean, *sheet),
    )


def _against(values: list[SampleValue], mean: float, nominal: float, u: float) -> DataSheet:
    limit = _U_TO_LIMIT * u if u > 0 else None
    outside = [value.sample for value in values if limit is not None and abs(value.value - nominal) > limit]
    percent = 100 * (mean / nominal - 1) if nominal else None
    return DataSheet(nominal, percent, limit, tuple(outside))


def _warnings(used: Mapping[str, FitResult], constants: Mapping[str, Spread]) -> list[str]:
    """Return what a person must know before using the numbers."""
    n = len(used)
    parts = [part for spread in constants.values() for part in (spread.re, spread.im) if part is not None]
    says: list[str] = []
    if n == 0:
        return ["no fit that can be used"]
    if n == 1:
        says.append("a single sample: there is no scatter between samples, and no outlier can be seen")
    elif n < 5:
        percent = 100 * _of_sd(n)
        says.append(f"{n} samples: the scatter itself is uncertain by {percent:.0f} %; only a far outlier can be seen")
    if n > 1 and any(part.within is None for part in parts):
        says.append("this fitter gives no uncertainties: the standard deviation holds both scatter and uncertainty")
    if misfits := [sample for sample, fit in used.items() if fit.chi2_per_dof > _MISFIT]:
        which = "its constants" if len(misfits) == 1 else "their constants"
        says.append(
            f"the model does not describe {', '.join(misfits)} (chi2/dof > {_MISFIT}); {which} count like the others, "
            "but may have a bias: `pzctl diagnose` says what is missing"
        )
    if shared := [name for name, spread in constants.items() if _is_shared(spread.re)]:
        says.append(
            f"{', '.join(shared)}: the samples agree better than chance allows with such uncertainties; so they share "
            "most of it (a data-sheet value, one micrometer), and more samples do not make it smaller"
        )
    return says


def _is_shared(part: VarianceShare) -> bool:
    """Return whether the samples differ less than their uncertainties alone would allow (97.5 %)."""
    return part.effects is not None and part.effects.tau_high == 0


def _of_sd(n: int) -> float:
    """Return the relative standard uncertainty of a standard deviation from n samples (JCGM 100:2008, E.4.3)."""
    c4 = math.sqrt(2 / (n - 1)) * math.exp(math.lgamma(n / 2) - math.lgamma((n - 1) / 2))
    return math.sqrt(1 - c4**2) / c4
