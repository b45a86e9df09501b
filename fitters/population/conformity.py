"""Whether fitted constants keep their limits, decided with their uncertainty by the rule of ISO 14253-1.

A value passes if it keeps its limits with the probability that the specification requires (0.95: ISO 14253-1:2017), and
fails if it violates them with that probability. Between the two, in the guard band of 1.645 u around a limit, the
measurement decides nothing.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from ...models.build import Build
from ...models.specification import Limit, Specification
from ..interface import Constant, FitResult

Verdict = Literal["pass", "undecided", "fail"]


@dataclass(frozen=True)
class Conformity:
    """One constant compared with its limit; SI units."""

    constant: str
    """`disk.c33D`, or `disk.c33D.im` for the imaginary part."""
    value: float | None
    """None if the fit has no such constant."""
    u: float | None
    unit: str
    min: float | None
    max: float | None
    guard: float | None
    """Width of the guard band: a value that is further inside than this passes."""
    probability: float | None
    """Probability that the true value keeps the limit."""
    verdict: Verdict
    says: str = ""
    """Reason for an undecided result."""


@dataclass(frozen=True)
class SampleVerdict:
    """The verdict on a sample: the worst of its constants'."""

    verdict: Verdict
    conformance: float
    limits: tuple[Conformity, ...]


def judged(result: FitResult, build: Build | None) -> SampleVerdict | None:
    """Return the verdict on a fit by the limits of its build, or None if none of them applies to the fitted steps."""
    if build is None or build.specification is None:
        return None
    there = {layer for step in build.steps if step.name in result.steps for layer in step.layers}
    limits = _compared(result, build.specification, there)
    return (
        SampleVerdict(worst([one.verdict for one in limits]), build.specification.conformance, limits)
        if limits
        else None
    )


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the overall verdict: fail if a part fails, pass if all parts pass."""
    return "fail" if "fail" in verdicts else "undecided" if "undecided" in verdicts else "pass"


def keeping_probability(value: float, u: float, limit: Limit) -> float:
    """Return the probability that the true value keeps the limit, for a normally distributed error."""
    from scipy.special import ndtr  # imported late: slow to load, and only for a build with limits

    if u == 0:
        return float((limit.low is None or value >= limit.low) and (limit.high is None or value <= limit.high))
    above = 1.0 if limit.high is None else float(ndtr((limit.high - value) / u))
    below = 0.0 if limit.low is None else float(ndtr((limit.low - value) / u))
    return max(0.0, above - below)


def _compared(result: FitResult, specification: Specification, layers: Collection[str]) -> tuple[Conformity, ...]:
    """Return the comparison of each constant that belongs to one of these layers."""
    return tuple(
        _one(name, limit, result, specification.conformance)
        for name, limit in specification.limits.items()
        if name.split(".")[0] in layers
    )


def _one(name: str, limit: Limit, result: FitResult, conformance: float) -> Conformity:
    bare = name.removesuffix(".im")
    constant = result.constants.get(bare) or result.derived.get(bare)
    if constant is None:
        return _undecided(name, limit, None, None, "", f"{result.fitter} does not determine it")
    value, u = (constant.im, constant.u_im) if name != bare else (constant.re, constant.u_re)
    from scipy.special import ndtri

    why = _open(constant, value, u, result)
    if why or u is None:
        return _undecided(name, limit, value if math.isfinite(value) else None, u, constant.unit, why)
    kept = keeping_probability(value, u, limit)
    verdict: Verdict = "pass" if kept >= conformance else "fail" if kept <= 1 - conformance else "undecided"
    says = "" if verdict != "undecided" else "within the guard band"
    guard = float(ndtri(conformance)) * u
    return Conformity(name, value, u, constant.unit, limit.low, limit.high, guard, kept, verdict, says)


def _open(constant: Constant, value: float, u: float | None, result: FitResult) -> str:
    """Return why a value cannot be compared with a limit, or an empty text."""
    if u is None:
        return f"{result.fitter} gives no uncertainty"
    if not math.isfinite(value) or not math.isfinite(u):
        return "not determined by this recording"
    if u == 0 and not constant.free:
        return "held as exact, so it was not measured"
    return "" if result.converged else "the fit did not converge"


def _undecided(name: str, limit: Limit, value: float | None, u: float | None, unit: str, says: str) -> Conformity:
    return Conformity(name, value, u, unit, limit.low, limit.high, None, None, "undecided", says)
