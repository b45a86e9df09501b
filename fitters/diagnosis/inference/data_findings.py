"""Findings of the data checks: recordings with wrong polarity, and disturbed recordings."""

from math import sqrt

from ...polarity import turned_says
from ..data_quality.data_gates import Gated
from ..data_quality.data_issues import DataCheck
from ..findings import Finding, Verdict
from ..hypotheses.instrument_artefacts import ANY, UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.refit import Refit

_SURE = 0.99
"""Probability of a disturbance that the data checks report."""
_BESIDE = 2.0
"""Distance, in widths of a disturbance, within which a fitted line counts as part of it."""
_SPELLED = 3
"""Largest number of disturbances described in words."""

POLARITY = "polarity"
"""Effect that is put right before any fit, in every diagnosis."""


def of_the_data(gated: Gated, chi2: float, held_out: float) -> list[Finding]:
    """Return the findings about the data; `chi2` and `held_out` are those of the fit to the corrected data."""
    turned = [
        _finding(
            *(POLARITY, "terminals", step, 0.995, ()),
            moves=float("nan"),
            says=turned_says(step, how),
            chi2=(float("inf"), chi2),
            held_out=(float("inf"), held_out),
        )
        for step, how in gated.turned.items()
    ]
    disturbed = [
        _finding(
            *(UNKNOWN, ANY, check.step, _SURE, tuple(one.band_Hz for one in check.abrupt)),
            moves=sqrt(sum(one.moves**2 for one in check.abrupt)),
            says=_says(check),
            chi2=(chi2, chi2),
            held_out=(held_out, held_out),
        )
        for check in gated.bad
    ]
    return [*turned, *disturbed]


def where_disturbed(gated: Gated, effect: Candidate, found: Refit) -> bool:
    """Return whether an effect is a line at a disturbance, and thus only a remnant of the excluded points."""
    bands = [one.band_Hz for check in gated.bad if check.step in effect.steps for one in check.abrupt]
    return any(
        a - _BESIDE * (b - a) < found.values[line] < b + _BESIDE * (b - a)
        for a, b in bands
        for line in effect.resonance_parameters
    )


def verdict_with(gated: Gated, verdict: Verdict) -> Verdict:
    """Return the verdict adjusted for the data: wrong polarity counts as explained, a disturbance never entirely."""
    if gated.bad:
        disturbed: dict[Verdict, Verdict] = {"no-mismatch": "unexplained", "explained": "partly-explained"}
        return disturbed.get(verdict, verdict)
    return "explained" if gated.turned and verdict == "no-mismatch" else verdict


def _says(check: DataCheck) -> str:
    more = len(check.abrupt) - _SPELLED
    told = "; ".join(one.says for one in check.abrupt[:_SPELLED]) + (f"; and {more} more" if more > 0 else "")
    return f"The recording of {check.step} was disturbed: {told}."


def _finding(
    effect: str,
    where: str,
    step: str,
    probability: float,
    bands_Hz: tuple[tuple[float, float], ...],
    moves: float,
    says: str,
    chi2: tuple[float, float],
    held_out: tuple[float, float],
) -> Finding:
    return Finding(
        effect=effect,
        where=where,
        step=step,
        probability=probability,
        bands_Hz=bands_Hz,
        parameters={},
        chi2_per_dof_before=chi2[0],
        chi2_per_dof_after=chi2[1],
        held_out_before=held_out[0],
        held_out_after=held_out[1],
        alternatives=(),
        says=says,
        moves=moves,
    )
