"""A comparison as the JSON object that `pzctl compare --json` prints: the form of a diagnosis."""

from typing import Any

import msgspec

from ....fitters.compare.comparison import ChangeFinding, Comparison
from .fit_json import number

_NUMBERS = (
    "chi2_per_dof_before",
    "chi2_per_dof_after",
    "held_out_before",
    "held_out_after",
    "probability",
    "share",
    "moves",
)


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as one JSON object, without the curves; a number that is missing or infinite is null."""
    return {
        "verdict": comparison.verdict,
        "probability": number(comparison.probability),
        "change": comparison.change,
        "baseline": {
            "chi2_per_dof": number(comparison.chi2_per_dof_before),
            "held_out": number(comparison.held_out_before),
        },
        "final": {
            "chi2_per_dof": number(comparison.chi2_per_dof_after),
            "held_out": number(comparison.held_out_after),
        },
        "findings": [_finding(one) for one in comparison.findings],
        "remaining": msgspec.to_builtins(comparison.remaining),
        "limits": [msgspec.to_builtins(one) for one in comparison.limits],
        "repeatability": [msgspec.to_builtins(one) for one in comparison.repeatability],
        "resonances": [msgspec.to_builtins(one) for one in comparison.resonances],
        "held_out_Hz": msgspec.to_builtins(comparison.held_out_Hz),
        "says": list(comparison.says),
        "seconds": comparison.seconds,
    }


def _finding(finding: ChangeFinding) -> dict[str, Any]:
    made = msgspec.to_builtins(finding)
    return made | {name: number(made[name]) for name in _NUMBERS}
